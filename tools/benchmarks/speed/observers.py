"""Observers as processes of their own: ours as a user starts it, and others."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from observer_rt.foundation.errors import RunError

READY = re.compile(r"\bready\b")
START_TIMEOUT = 300.0  # s, compiling included
_END_TIMEOUT = 30.0
_TICK = os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")
RUN = (sys.executable, "-m", "observer_rt", "run", "--bench")
_DISTURBED = (sys.executable, "-m", "tools.benchmarks.speed.disturbed")
BUSY_RUN = (*_DISTURBED, "busy", *RUN[-2:])
PAUSED_RUN = (*_DISTURBED, "paused", *RUN[-2:])


@dataclass(frozen=True)
class Observer:
    """A running one. spoke_after, ready_after [s]: from its start until it said anything, and that it is ready."""

    process: subprocess.Popen[str]
    spoke_after: float
    ready_after: float
    said: list[str] = field(default_factory=list)

    def cpu_time(self) -> float:
        """Seconds of processor time so far, of all its threads."""
        return _cpu_time(Path(f"/proc/{self.process.pid}"))

    def cpu_time_by_thread(self) -> dict[str, float]:
        """The same, thread by thread."""
        return {task.name: _cpu_time(task) for task in Path(f"/proc/{self.process.pid}/task").iterdir()}

    def memory(self) -> int:
        """Bytes resident now."""
        return int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * _PAGE

    @contextmanager
    def resumed(self) -> Iterator[None]:
        """Let one that was suspended run for a while."""
        self.process.send_signal(signal.SIGCONT)
        try:
            yield
        finally:
            self.suspend()

    def suspend(self) -> None:
        """Let it run no more until `resumed`."""
        self.process.send_signal(signal.SIGSTOP)


def _cpu_time(task: Path) -> float:
    fields = (task / "stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICK


@contextmanager
def observer(
    command: Sequence[str | Path], descriptors: Sequence[int] = (), environment: dict[str, str] | None = None
) -> Iterator[Observer]:
    """Start one, and wait until it has said `ready`; end it with SIGTERM. Raises RunError."""
    begin = time.monotonic()
    process = subprocess.Popen(
        list(map(str, command)),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        pass_fds=descriptors,
        env=os.environ | {"COLUMNS": "300"} | (environment or {}),
    )
    said: list[str] = []
    ready = threading.Event()
    said_at: list[float] = []
    ready_at: list[float] = []

    def listen() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            said_at.append(time.monotonic())
            said.append(line.rstrip())
            if READY.search(line) and not ready_at:
                ready_at.append(time.monotonic())
                ready.set()
        ready.set()

    listener = threading.Thread(target=listen)
    listener.start()
    try:
        if not ready.wait(START_TIMEOUT) or not ready_at:
            raise RunError("an observer did not get ready:\n" + "\n".join(said[-20:]))
        yield Observer(process, said_at[0] - begin, ready_at[0] - begin, said)
    finally:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        try:
            process.wait(_END_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
        listener.join()
