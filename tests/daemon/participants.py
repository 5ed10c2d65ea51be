"""Others on the bus of a daemon under test: a measuring device, a listener, and a link that obeys the test."""

import io
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Self

import can
import pytest
from rich.console import Console

from observer_rt.bus.links.controller import BusCondition
from observer_rt.bus.links.link import Frame, Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_bench
from observer_rt.daemon.arrivals import Arrivals, watched_messages
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.pump import FramePump
from observer_rt.daemon.snapshot_keeper import SnapshotKeeper
from observer_rt.daemon.view import View
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.service.nominal import References
from observer_rt.engine.stream.state import Reason, State
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.player import play
from tests.benches import SAMPLE_RATE
from tests.daemon.end_to_end import OUTPUTS, STATUS, Listener, ResultFrames, decoded, output_bus, write_bench
from tests.device import Notes
from tests.links import FakeLink

BLOCK_ID = 0x100  # of the message with samples
PATIENCE = 180.0  # s, after which the test fails: the machine is too slow, or the daemon stuck


def until(condition: Callable[[], bool], patience: float = PATIENCE) -> None:
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end, "machine too slow, or the daemon is stuck"
        time.sleep(0.005)


class ScriptedLink(FakeLink):
    """Delivers given frames at once, then nothing, or fails on request; keeps sent frames."""

    def __init__(self, frames: Iterable[TimedFrame] = (), failure: Exception | None = None) -> None:
        super().__init__()
        self.empty = threading.Event()
        self._frames = deque(frames)
        self.frames = len(self._frames)
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
        return [decoded(STATUS, f.payload) for f in self.sent if f.frame_id == STATUS.frame_id]


class TroubledLink(ScriptedLink):
    """A scripted link that can be unplugged, and whose transmit queue can be full."""

    def __init__(self, frames: Iterable[TimedFrame] = (), has_room: bool = True) -> None:
        super().__init__(frames)
        self.plugged = threading.Event()
        self.plugged.set()
        self.has_room = has_room
        self.why = "can5 is down\n  remedy: plug it in"
        self.reported_condition = BusCondition()

    def receive(self, timeout_s: float) -> Frame | None:
        self._require()
        return super().receive(timeout_s)

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        self._require()
        if self.has_room:
            self.send(frame_id, payload, is_extended, is_fd)
        return self.has_room

    def reconnect(self) -> None:
        self._require()

    def deliver(self, frames: Iterable[TimedFrame]) -> None:
        self.empty.clear()
        self._frames = deque(frames)

    @property
    def condition(self) -> BusCondition:
        return self.reported_condition

    def _require(self) -> None:
        if not self.plugged.is_set():
            raise LinkDownError(self.why)


class HeardDaemon(Daemon):
    """A daemon of a bench on the links given, whose news are kept, and shown by a view."""

    def __init__(
        self, bench: Path | Bench, *links: Link, references: References | None = None, **options: Any
    ) -> None:
        loaded = bench if isinstance(bench, Bench) else load_bench(bench)
        bus = map_bus(loaded)
        self.notes, self.snapshots = Notes(), SnapshotKeeper(loaded, references)
        self.view = View("title of the view", self.snapshots.take)
        super().__init__(loaded, bus, links, listeners=(self.notes, self.snapshots.hear), **options)
        self.snapshots.watch(self)
        self.messages = self.notes.messages

    def drawn(self, width: int = 80, height: int = 24) -> str:
        return "\n".join(drawn(self.view, width, height))

    def now(self) -> tuple[State, Reason]:
        return self.state(time.monotonic_ns())


class PumpRun:
    """A pump without a daemon on one link, closed at the end; unsent: counts of rates it gave up."""

    def __init__(self, path: Path, link: Link, waits_for_verdicts: bool = True) -> None:
        bench = load_bench(path)
        bus = map_bus(bench)
        self.core, self.arrivals, self.unsent = Core(bench.injector, bus), Arrivals(bus), list[int]()
        self.core.compiled.observer.memory["mode"]["waits_for_verdicts"] = waits_for_verdicts
        self.pump = FramePump([link], self.core, bus, self.arrivals, self.unsent.append)

    def serve_until_taken(self, frames: int) -> list[OutputFrame]:
        handed: list[OutputFrame] = []
        end = time.monotonic() + PATIENCE
        while self.arrivals.frames < frames:
            assert time.monotonic() < end
            handed += self.pump.serve(1e-3)
        return handed

    def ends(self) -> bool:
        ending = threading.Thread(target=self.pump.finish, daemon=True)
        ending.start()
        ending.join(PATIENCE)
        return not ending.is_alive()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.pump.close()


def drawn(screen: View, width: int = 80, height: int = 24) -> list[str]:
    file = io.StringIO()
    console = Console(file=file, width=width, height=height, force_terminal=True, color_system=None)
    console.print(screen.render(width, height))
    return file.getvalue().splitlines()


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
def listening(interface: str, channel: str, filters: can.typechecking.CanFilters = OUTPUTS) -> Iterator[Listener]:
    with output_bus(interface, channel, filters) as bus:
        listener = Listener(bus)
        try:
            yield listener
        finally:
            listener.stop()


def bench_file(folder: Path, channel: str, interface: str = "virtual") -> Path:
    return write_bench(folder, interface, channel, SAMPLE_RATE)


@contextmanager
def opened(path: Path, sending: bool) -> Iterator[list[Link]]:
    bench = load_bench(path)
    bus = map_bus(bench)
    with ExitStack() as stack:
        links, wanted = [], [] if sending else watched_messages(bus)
        for number, named in enumerate(bench.config.buses):
            inputs = [(message.frame_id, message.is_extended) for message in wanted if message.bus == number]
            computer_time = not sending and len(bench.config.buses) > 1
            link = open_link(named.config.interface, named.config.channel, True, inputs, computer_time)
            links.append(stack.enter_context(link))
        yield links


def over_bus(path: Path, frames: Sequence[TimedFrame], speed: float = math.inf) -> tuple[ResultFrames, Daemon]:
    """Frames played to a daemon over the buses of a bench; the results on the last, all in this process."""
    bench = load_bench(path)
    results = bench.config.buses[-1].config
    with (
        listening(results.interface, results.channel) as listener,
        opened(path, sending=False) as links,
        opened(path, sending=True) as players,
    ):
        daemon = HeardDaemon(bench, *links)
        with serving(daemon):
            play(frames, players[0], speed, by_bus=dict(enumerate(players)))
            until(lambda: daemon.core.counters.frames + daemon.dropped >= len(frames))
        outcome = listener.results
        until(lambda: bool(outcome.statuses) and outcome.last_status()["SamplesProcessed"] == daemon.core.processed)
    if daemon.dropped:
        pytest.fail("machine too slow: the daemon's socket dropped frames")
    return outcome, daemon
