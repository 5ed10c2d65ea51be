"""Buses for machines without any: sockets that hear each other."""

import socket
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from tools.benchmarks.speed import native
from tools.benchmarks.speed.sustained import socket_pair


@dataclass(frozen=True)
class SocketBus:
    """A bus with a place for the devices, the daemon and a listener."""

    devices: socket.socket
    daemon: socket.socket
    listener: socket.socket


class Hub:
    """What connects the sockets of some buses."""

    def __init__(self, process: subprocess.Popen[str], ends: list[list[int]]) -> None:
        self._process = process
        self._listeners = [each[-1] for each in ends]

    def lost_to_listeners(self) -> int:
        """Frames so far that listeners were too late for."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("?")
        self._process.stdin.flush()
        numbers = list(map(int, self._process.stdout.readline().split()))
        lost = dict(zip(numbers[::2], numbers[1::2], strict=True))
        return sum(lost[each] for each in self._listeners)


@contextmanager
def socket_buses(folder: Path, count: int) -> Iterator[tuple[list[SocketBus], Hub]]:
    """So many buses. Raises UserError without a C compiler."""
    with ExitStack() as stack:
        pairs = [[socket_pair(stack) for _ in range(3)] for _ in range(count)]
        ends = [[pair.receiver.fileno() for pair in each] for each in pairs]
        words = [native.program("hub", folder), *(",".join(map(str, each)) for each in ends)]
        process = stack.enter_context(
            subprocess.Popen(
                list(map(str, words)),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                pass_fds=[number for each in ends for number in each],
            )
        )
        buses = [SocketBus(*(pair.sender for pair in each)) for each in pairs]
        yield buses, Hub(process, ends)
        assert process.stdin is not None
        process.stdin.close()
