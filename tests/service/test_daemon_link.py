"""The daemon on a link in trouble: it stays, says what is the matter, and goes on by itself."""

import time
from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.bus.links.controller import BusCondition, BusState
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.replay.framing import TimedFrame
from tests.device import frames_of, worn_recording
from tests.service.end_to_end import RATE, payloads, published_rates
from tests.service.participants import HeardDaemon, TroubledLink, bench_file, serving, until

BLOCK = 9  # samples of a SampleBlock
FIRST, LOST, LAST = 600, 200, 600  # frames before, during and after an outage


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bench_file(tmp_path_factory.mktemp("bench"), "can5")


@pytest.fixture(scope="module")
def frames(bench: Path) -> list[TimedFrame]:
    recording = worn_recording()
    return frames_of(bench, recording)


def test_an_interface_that_goes_and_comes_back(bench: Path, frames: list[TimedFrame]) -> None:
    link = TroubledLink(frames[:FIRST])
    daemon = HeardDaemon(bench, link, is_warm=True)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == FIRST)
        until(lambda: daemon.now()[0] in (State.RUNNING_NOMINAL, State.ADAPTED))
        before = len(link.sent)
        link.plugged.clear()
        until(lambda: len(daemon.messages) == 1)
        assert daemon.messages[0].startswith("waiting for the interface: can5 is down\n  remedy: plug it in")
        assert daemon.now() == (State.WAITING_FOR_DATA, Reason.INPUT_TIMEOUT)
        time.sleep(0.3)
        assert len(link.sent) <= before + 5  # status frames until it was noticed
        link.deliver(frames[FIRST + LOST : FIRST + LOST + LAST])
        link.plugged.set()
        until(lambda: daemon.core.counters.frames == FIRST + LAST)
        assert daemon.messages[1:] == ["can5 is back"]
        until(lambda: daemon.now()[0] in (State.RUNNING_NOMINAL, State.ADAPTED))
    assert link.statuses()[-1]["LinkTroubles"] == 1
    assert link.statuses()[-1]["LostSamples"] == LOST * BLOCK
    _, count = published_rates(payloads(link.sent, RATE), 1400 * BLOCK)
    assert count.max() == 1


def test_a_changed_reason_is_told(bench: Path) -> None:
    link = TroubledLink()
    daemon = HeardDaemon(bench, link, is_warm=True)
    with serving(daemon):
        link.plugged.clear()
        until(lambda: len(daemon.messages) == 1)
        link.why = "there is no interface can5"
        until(lambda: len(daemon.messages) == 2)
    assert "there is no interface can5" in daemon.messages[1]


def test_a_device_that_comes_and_goes_is_told_once(bench: Path) -> None:
    class LooseLink(TroubledLink):
        """Can be connected, and fails at once."""

        def reconnect(self) -> None:
            pass

    link = LooseLink()
    link.plugged.clear()
    daemon = HeardDaemon(bench, link, is_warm=True)
    with serving(daemon):
        until(lambda: daemon.troubles >= 5)
    assert len(daemon.messages) == 2
    assert daemon.messages[1] == "can5 is back"


def test_it_can_be_stopped_while_it_waits(bench: Path, frames: list[TimedFrame]) -> None:
    link = TroubledLink(frames)
    daemon = HeardDaemon(bench, link, is_warm=True)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == len(frames))
        link.plugged.clear()
        until(lambda: bool(daemon.messages))
    assert daemon.core.knowledge.events >= 3
    assert daemon.unsent >= 1  # at least the last status


def test_a_full_transmit_queue_does_not_stop_the_observer(bench: Path) -> None:
    recording = worn_recording(8)
    frames = frames_of(bench, recording)
    link = TroubledLink(frames)
    link.has_room = False
    daemon = HeardDaemon(bench, link, is_warm=True)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == len(frames))
        until(lambda: bool(daemon.messages))
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
        until(lambda: sum(int(message.split(" results")[0]) for message in daemon.messages) == given_up)
    assert "txqueuelen" in daemon.messages[0]
    rates = payloads(link.sent, RATE)
    _, count = published_rates(rates, len(frames) * BLOCK)
    assert count.max() == 1
    assert count[-3 * BLOCK :].all()  # the latest are those that were kept


def test_what_the_controller_tells_is_passed_on(bench: Path) -> None:
    link = TroubledLink()
    daemon = HeardDaemon(bench, link, is_warm=True)
    with serving(daemon):
        until(lambda: bool(link.statuses()))
        link.told = BusCondition(BusState.PASSIVE, passives=1, error_frames=1)
        until(lambda: len(daemon.messages) == 1)
        for n in range(20):  # flickers
            link.told = replace(link.told, passives=2 + n, error_frames=2 + n)
            time.sleep(0.02)
        link.told = BusCondition(BusState.OFF, passives=25, bus_offs=1, error_frames=30)
        until(lambda: "bus-off" in daemon.messages[-1])
        until(lambda: link.statuses()[-1]["LinkTroubles"] == 26)
    assert "error-passive" in daemon.messages[0]
    assert len(daemon.messages) <= 3


def test_frames_lost_before_the_loop_are_told(bench: Path) -> None:
    link = TroubledLink()
    daemon = HeardDaemon(bench, link, is_warm=True)
    with serving(daemon):
        link.lost = 7
        until(lambda: bool(daemon.messages))
    assert daemon.messages[0].startswith("7 frames of can5 were lost before")
