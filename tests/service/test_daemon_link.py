"""The daemon on a link in trouble: it stays, says what is the matter, and goes on by itself."""

import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.bus.links.controller import BusCondition, BusState
from observer_rt.bus.links.link import Frame, LinkDownError
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.news import Notes
from observer_rt.service.warm_up import warm_up
from tests.device import frames_of, worn_recording
from tests.service.end_to_end import RATE, published_rates
from tests.service.participants import ScriptedLink, bench_file, serving, until

BLOCK = 9  # samples of a SampleBlock
FIRST, LOST, LAST = 600, 200, 600  # frames before, during and after an outage


class TroubledLink(ScriptedLink):
    """A scripted link that can be unplugged, and whose transmit queue can be full."""

    def __init__(self, frames: Iterable[TimedFrame] = ()) -> None:
        super().__init__(frames)
        self.plugged = threading.Event()
        self.plugged.set()
        self.has_room = True
        self.why = "can5 is down\n  remedy: plug it in"
        self.told = BusCondition()

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
        return self.told

    def _require(self) -> None:
        if not self.plugged.is_set():
            raise LinkDownError(self.why)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bench_file(tmp_path_factory.mktemp("bench"), "can5")


@pytest.fixture(scope="module")
def frames(bench: Path) -> list[TimedFrame]:
    recording = worn_recording()
    return frames_of(bench, recording)


def daemon_on(bench: Path, link: TroubledLink) -> tuple[Daemon, list[str]]:
    """And what it says."""
    loaded = load_bench(bench)
    bus = map_bus(loaded)
    warm_up(loaded, bus)
    notes = Notes()
    return Daemon(loaded, bus, [link], listeners=[notes]), notes.messages


def test_an_interface_that_goes_and_comes_back(bench: Path, frames: list[TimedFrame]) -> None:
    link = TroubledLink(frames[:FIRST])
    daemon, messages = daemon_on(bench, link)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == FIRST)
        until(lambda: daemon.state(time.monotonic_ns())[0] in (State.RUNNING_NOMINAL, State.ADAPTED))
        before = len(link.sent)
        link.plugged.clear()
        until(lambda: len(messages) == 1)
        assert messages[0].startswith("waiting for the interface: can5 is down\n  remedy: plug it in")
        assert daemon.state(time.monotonic_ns()) == (State.WAITING_FOR_DATA, Reason.INPUT_TIMEOUT)
        time.sleep(0.3)
        assert len(link.sent) <= before + 5  # status frames until it was noticed
        link.deliver(frames[FIRST + LOST : FIRST + LOST + LAST])
        link.plugged.set()
        until(lambda: daemon.core.counters.frames == FIRST + LAST)
        assert messages[1:] == ["can5 is back"]
        until(lambda: daemon.state(time.monotonic_ns())[0] in (State.RUNNING_NOMINAL, State.ADAPTED))
    assert link.statuses()[-1]["LinkTroubles"] == 1
    assert link.statuses()[-1]["LostSamples"] == LOST * BLOCK
    _, count = published_rates([f.payload for f in link.sent if f.frame_id == RATE.frame_id], 1400 * BLOCK)
    assert count.max() == 1


def test_a_changed_reason_is_told(bench: Path) -> None:
    link = TroubledLink()
    daemon, messages = daemon_on(bench, link)
    with serving(daemon):
        link.plugged.clear()
        until(lambda: len(messages) == 1)
        link.why = "there is no interface can5"
        until(lambda: len(messages) == 2)
    assert "there is no interface can5" in messages[1]


def test_a_device_that_comes_and_goes_is_told_once(bench: Path) -> None:
    class LooseLink(TroubledLink):
        """Can be connected, and fails at once."""

        def reconnect(self) -> None:
            pass

    link = LooseLink()
    link.plugged.clear()
    daemon, messages = daemon_on(bench, link)
    with serving(daemon):
        until(lambda: daemon.troubles >= 5)
    assert len(messages) == 2
    assert messages[1] == "can5 is back"


def test_it_can_be_stopped_while_it_waits(bench: Path, frames: list[TimedFrame]) -> None:
    link = TroubledLink(frames)
    daemon, messages = daemon_on(bench, link)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == len(frames))
        link.plugged.clear()
        until(lambda: bool(messages))
    assert daemon.core.knowledge.events >= 3
    assert daemon.unsent >= 1  # at least the last status


def test_a_full_transmit_queue_does_not_stop_the_observer(bench: Path) -> None:
    recording = worn_recording(8)
    frames = frames_of(bench, recording)
    link = TroubledLink(frames)
    link.has_room = False
    daemon, messages = daemon_on(bench, link)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == len(frames))
        until(lambda: bool(messages))
        assert link.sent == []

        def is_settled() -> bool:
            """Whether the rates of the last frames were given up, too."""
            before = daemon.unsent
            time.sleep(0.2)
            return daemon.unsent == before > 0

        until(is_settled)
        given_up = daemon.unsent
        link.has_room = True
        until(lambda: bool(link.statuses()))
        assert daemon.unsent == given_up > 0
        until(lambda: sum(int(message.split(" results")[0]) for message in messages) == given_up)
    assert "txqueuelen" in messages[0]
    rates = [f.payload for f in link.sent if f.frame_id == RATE.frame_id]
    _, count = published_rates(rates, len(frames) * BLOCK)
    assert count.max() == 1
    assert count[-3 * BLOCK :].all()  # the latest are those that were kept


def test_what_the_controller_tells_is_passed_on(bench: Path) -> None:
    link = TroubledLink()
    daemon, messages = daemon_on(bench, link)
    with serving(daemon):
        until(lambda: bool(link.statuses()))
        link.told = BusCondition(BusState.PASSIVE, passives=1, error_frames=1)
        until(lambda: len(messages) == 1)
        for n in range(20):  # flickers
            link.told = replace(link.told, passives=2 + n, error_frames=2 + n)
            time.sleep(0.02)
        link.told = BusCondition(BusState.OFF, passives=25, bus_offs=1, error_frames=30)
        until(lambda: "bus-off" in messages[-1])
        until(lambda: link.statuses()[-1]["LinkTroubles"] == 26)
    assert "error-passive" in messages[0]
    assert len(messages) <= 3


def test_frames_lost_before_the_loop_are_told(bench: Path) -> None:
    link = TroubledLink()
    daemon, messages = daemon_on(bench, link)
    with serving(daemon):
        link.lost = 7
        until(lambda: bool(messages))
    assert messages[0].startswith("7 frames of can5 were lost before")
