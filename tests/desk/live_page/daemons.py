"""Daemons for tests of the live page: in this process, on links that bring a recording as fast as a test wants it."""

import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from observer_rt.bus.links.link import Frame
from observer_rt.config.bench import load_bench
from observer_rt.daemon.control_socket import control_socket, socket_places
from observer_rt.daemon.snapshot import SNAPSHOT
from observer_rt.files.replay.framing import TimedFrame
from tests.daemon.participants import HeardDaemon, ScriptedLink, serving


class PacedLink(ScriptedLink):
    """Brings frames `slowdown` times slower than they were recorded; 0 brings them at once."""

    def __init__(self, frames: Iterable[TimedFrame], slowdown: float = 0.0) -> None:
        super().__init__(frames)
        self._slowdown = slowdown
        self._begin = time.monotonic()

    def receive(self, timeout_s: float) -> Frame | None:
        if self._frames and self._slowdown:
            early = self._slowdown * self._frames[0].time - (time.monotonic() - self._begin)
            if early > 0.0:
                time.sleep(min(early, timeout_s))
                return None
        return super().receive(timeout_s)


@contextmanager
def daemons_of(path: Path, frames: Sequence[TimedFrame], slowdown: float = 0.0) -> Iterator[list[HeardDaemon]]:
    with ExitStack() as stack:
        daemons = []
        for bench in load_bench(path).per_injector:
            daemons.append(daemon := HeardDaemon(bench, PacedLink(frames, slowdown)))
            socket = socket_places(bench.injector)[0]
            stack.enter_context(control_socket(socket, {SNAPSHOT: daemon.snapshots.answer}))
            stack.enter_context(serving(daemon))
        yield daemons
