"""`run` on a real SocketCAN interface: it waits for it at the start, and two of them hear each other."""

import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.interface import OwnInterface
from tests.service.end_to_end import START_TIMEOUT, command
from tests.service.participants import bench_file


class Run:
    """A daemon process and its lines so far."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def until_told(self, text: str) -> str:
        """The first line with a text, waited for."""
        end = time.monotonic() + START_TIMEOUT
        while True:
            for line in self.lines:
                if text in line:
                    return line
            assert self.process.poll() is None, self.lines
            assert time.monotonic() < end, self.lines
            time.sleep(0.05)

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        self._reader.join(START_TIMEOUT)
        return self.process.wait(START_TIMEOUT)

    def _read(self) -> None:
        assert self.process.stderr is not None
        self.lines.extend(self.process.stderr)


@contextmanager
def running(bench: Path) -> Iterator[Run]:
    process = subprocess.Popen(command("run", "--bench", bench), stderr=subprocess.PIPE, text=True)
    try:
        run = Run(process)
        yield run
        assert run.stop() == 0, run.lines
    finally:
        process.kill()


@pytest.mark.slow
@pytest.mark.vcan
def test_the_interface_is_waited_for_and_another_daemon_is_heard(
    own_interface: OwnInterface, tmp_path: Path
) -> None:
    bench = bench_file(tmp_path, own_interface.name, "socketcan")
    own_interface.remove()
    with running(bench) as first:
        waiting = first.until_told("waiting for the interface")
        assert "WARNING link: waiting for the interface: there is no interface vcan9" in waiting
        own_interface.add()
        first.until_told("INFO link: vcan9 is there")
        first.until_told("INFO start: ready")
        with running(bench) as second:
            second.until_told("WARNING sender: another node sends ObserverStatus 0x202 already")
            first.until_told("WARNING sender: another node sends ObserverStatus 0x202: ")
            first.until_told("SECOND_SENDER: another node sends what only this observer should")
        first.until_told("INFO sender: the other sender is silent after")
