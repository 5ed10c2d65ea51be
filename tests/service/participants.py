"""Others on the bus of a daemon under test: a measuring device, a listener, and a link that obeys the test."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can

from observer_rt.bus.link import Frame, Link, open_link
from observer_rt.bus.mapping import BusMap
from observer_rt.config import load_injector
from observer_rt.errors import RunError
from observer_rt.recording.framing import TimedFrame
from observer_rt.recording.recording import Recording
from observer_rt.service.daemon import Daemon
from observer_rt.simulation.effects import PlantEffects
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import simulate
from tests.service.end_to_end import STATUS, Listener, decoded, write_bench

SAMPLE_RATE = 50e3
PATIENCE = 60.0  # s, after which the test fails: the machine is too slow, or the daemon stuck

__all__ = ["SAMPLE_RATE", "ScriptedLink", "listening", "serving", "until", "worn_recording", "write_bench"]


def worn_recording(injections: int = 4, v_h: float = 0.3) -> Recording:
    """Events every 50 ms at alternating pressures, with noise."""
    schedule = make_schedule([60e6, 120e6], injections, 0.05, [1.1e-3])
    effects = PlantEffects(orifice_area=v_h)
    return simulate(load_injector(), schedule, SAMPLE_RATE, effects, NoiseLevels(), seed=3).recording


def until(condition: Callable[[], bool]) -> None:
    """Wait until it holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "machine too slow, or the daemon is stuck"
        time.sleep(0.005)


class ScriptedLink(Link):
    """Delivers given frames at once, then nothing, or fails if told so; keeps what is sent."""

    def __init__(self, frames: Iterable[TimedFrame] = (), failure: RunError | None = None) -> None:
        self.sent: list[Frame] = []
        self.lost = 0
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

    def send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> None:
        self.sent.append(Frame(frame_id, payload, 0, is_extended, is_fd))

    @property
    def dropped(self) -> int:
        return self.lost

    def close(self) -> None:
        pass

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
    with can.Bus(interface=interface, channel=channel, fd=True) as bus:
        listener = Listener(bus)
        try:
            yield listener
        finally:
            listener.stop()


def daemon_link(bus: BusMap, interface: str, channel: str) -> Link:
    """The link `observer-rt run` opens."""
    return open_link(interface, channel, True, [(m.frame_id, m.is_extended) for m in bus.input_layouts])


def bench_file(folder: Path, channel: str) -> Path:
    """Bench on the virtual bus."""
    return write_bench(folder, "virtual", channel, SAMPLE_RATE)
