"""Others on the bus of a daemon under test: a measuring device, a listener, and a link that obeys the test."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.link import Frame, Link
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_bench
from observer_rt.foundation.errors import RunError
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.recording.replay.player import play
from observer_rt.service import opening
from observer_rt.service.daemon import Daemon
from observer_rt.service.warm_up import warm_up
from observer_rt.service.watch.arrivals import Arrivals
from tests.benches import SAMPLE_RATE
from tests.links import FakeLink
from tests.service.end_to_end import STATUS, Heard, Listener, decoded, output_bus, write_bench

BLOCK_ID = 0x100  # of the message with samples
PATIENCE = 60.0  # s, after which the test fails: the machine is too slow, or the daemon stuck


def until(condition: Callable[[], bool]) -> None:
    """Wait until it holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "machine too slow, or the daemon is stuck"
        time.sleep(0.005)


class ScriptedLink(FakeLink):
    """Delivers given frames at once, then nothing, or fails if told so; keeps what is sent."""

    def __init__(self, frames: Iterable[TimedFrame] = (), failure: RunError | None = None) -> None:
        super().__init__()
        self.empty = threading.Event()
        self._frames = deque(frames)
        self._failure = failure

    def receive(self, timeout_s: float) -> Frame | None:
        if self._frames:
            frame = self._frames.popleft()
            return Frame(frame.frame_id, frame.payload, 0, frame.is_extended, frame.is_fd)
        if self._failure is not None:
            raise self._failure
        self.empty.set()
        time.sleep(timeout_s)
        return None

    def statuses(self) -> list[dict[str, float]]:
        """Status frames sent so far, decoded by cantools."""
        return [decoded(STATUS, f.payload) for f in self.sent if f.frame_id == STATUS.frame_id]


@contextmanager
def serving(daemon: Daemon) -> Iterator[threading.Event]:
    """The daemon's loop in a thread; the event stops it, and what it raised is raised at the end."""
    stop = threading.Event()
    failure: list[BaseException] = []

    def loop() -> None:
        try:
            daemon.run(stop)
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=loop, name="daemon under test")
    thread.start()
    try:
        yield stop
    finally:
        stop.set()
        thread.join()
    if failure:
        raise failure[0]


@contextmanager
def listening(interface: str, channel: str) -> Iterator[Listener]:
    """Another participant that notes what the daemon says."""
    with output_bus(interface, channel) as bus:
        listener = Listener(bus)
        try:
            yield listener
        finally:
            listener.stop()


def give_link(monkeypatch: pytest.MonkeyPatch, link: Link) -> None:
    """What the service opens to observe; nobody else sends on it."""

    def opened(_interface: str, _channel: str, _fd: bool, wanted: list[tuple[int, bool]], _: bool) -> Link:
        is_input = (BLOCK_ID, False) in wanted
        return link if is_input else FakeLink()

    monkeypatch.setattr(opening, "open_link", opened)


def bench_file(folder: Path, channel: str, interface: str = "virtual") -> Path:
    """Bench at SAMPLE_RATE, learning in lockstep."""
    return write_bench(folder, interface, channel, SAMPLE_RATE)


def assert_warm_up_takes_all(bench: Bench) -> None:
    """Every message of the bench goes through the core that warms up, and none is refused."""
    taken = set()

    class Watched(Arrivals):
        def set(self, layout: MessageLayout, frames: int, last: int) -> None:
            taken.update([layout] if frames else [])
            super().set(layout, frames, last)

    bus = map_bus(bench)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("observer_rt.service.warm_up.Arrivals", Watched)
        counters = warm_up(bench, bus).counters
    assert taken >= set(bus.received)
    assert counters.samples > 0
    assert counters.crc_errors == counters.length_errors == 0


def over_bus(path: Path, frames: Sequence[TimedFrame], speed: float = math.inf) -> tuple[Heard, Daemon]:
    """Frames played to a daemon over the bench's bus; what a third participant heard, all in this process."""
    bench = load_bench(path)
    bus = map_bus(bench)
    link = bench.config.link
    warm_up(bench, bus)
    inputs = [(layout.frame_id, layout.is_extended) for layout in bus.input_layouts]
    with (
        listening(link.interface, link.channel) as listener,
        open_link(link.interface, link.channel, True, inputs) as daemon_link,
        open_link(link.interface, link.channel, True, []) as player_link,
    ):
        daemon = Daemon(bench, bus, [daemon_link])
        with serving(daemon):
            play(frames, player_link, speed)
            until(lambda: daemon.core.counters.frames + daemon.dropped >= len(frames))
        until(lambda: bool(listener.heard.statuses) and _samples(listener.heard) == daemon.core.processed)
    if daemon.dropped:
        pytest.fail("machine too slow: the daemon's socket dropped frames")
    return listener.heard, daemon


def _samples(heard: Heard) -> int:
    return int(heard.last_status()["SamplesProcessed"])
