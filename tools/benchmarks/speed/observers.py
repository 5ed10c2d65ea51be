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

import psutil

from observer_rt.foundation.errors import RunError

READY = re.compile(r"\bready\b")
START_TIMEOUT = 300.0  # s, compiling included
_END_TIMEOUT = 30.0
RUN = (sys.executable, "-m", "observer_rt", "run", "--bench")
_DISTURBED = (sys.executable, "-m", "tools.benchmarks.speed.disturbed")
BUSY_RUN = (*_DISTURBED, "busy", *RUN[-2:])
PAUSED_RUN = (*_DISTURBED, "paused", *RUN[-2:])


@dataclass(frozen=True)
class Observer:
    """A running one. ready_after [s]: from its start until it said so."""

    process: subprocess.Popen[str]
    ready_after: float
    said: list[str] = field(default_factory=list)

    @property
    def resources(self) -> psutil.Process:
        return psutil.Process(self.process.pid)

    def cpu_time(self) -> float:
        times = self.resources.cpu_times()
        return float(times.user + times.system)

    def memory(self) -> int:
        """Bytes resident now."""
        return int(self.resources.memory_info().rss)

    @contextmanager
    def resumed(self) -> Iterator[None]:
        self.process.send_signal(signal.SIGCONT)
        try:
            yield
        finally:
            self.suspend()

    def suspend(self) -> None:
        self.process.send_signal(signal.SIGSTOP)


@contextmanager
def observer(
    command: Sequence[str | Path], descriptors: Sequence[int] = (), environment: dict[str, Path] | None = None
) -> Iterator[Observer]:
    """Start one, and wait until it has said `ready`; end it with SIGTERM. Raises RunError."""
    begin = time.monotonic()
    variables: dict[str, str | Path] = {**os.environ, "COLUMNS": "300", **(environment or {})}
    process = subprocess.Popen(
        list(map(str, command)),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        pass_fds=descriptors,
        env=variables,
    )
    said, ready_at = list[str](), list[float]()
    ready = threading.Event()

    def listen() -> None:
        assert process.stdout is not None
        for line in process.stdout:
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
        yield Observer(process, ready_at[0] - begin, said)
    finally:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        try:
            process.wait(_END_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
        listener.join()
