"""The daemon on links in trouble, one or several: it stays, reports the trouble, and goes on by itself."""

import math
import time
import uuid
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from observer_rt.bus.links.controller import BusCondition, BusState
from observer_rt.bus.links.link import Frame
from observer_rt.config.bench import load_bench
from observer_rt.daemon.daemon import Daemon
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.stream.state import Reason, State
from observer_rt.files.replay.framing import TimedFrame
from tests.benches import block_bench
from tests.daemon.end_to_end import RATE, payloads, published_rates, results_of
from tests.daemon.participants import HeardDaemon, TroubledLink, over_bus, serving, until
from tests.device import frames_of, worn_recording

BLOCK = 9  # samples of a SampleBlock
FIRST, LOST, LAST = 600, 200, 600  # frames before, during and after an outage


def test_an_interface_that_goes_and_comes_back(bench: Path, frames: list[TimedFrame]) -> None:
    link = TroubledLink(frames[:FIRST])
    daemon = HeardDaemon(bench, link)
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
    assert (link.statuses()[-1]["LinkTroubles"], link.statuses()[-1]["LostSamples"]) == (1, LOST * BLOCK)
    _, count = published_rates(payloads(link.sent, RATE), 1400 * BLOCK)
    assert count.max() == 1


def test_a_device_that_comes_and_goes_is_told_once(bench: Path) -> None:
    class LooseLink(TroubledLink):
        def reconnect(self) -> None:
            pass

    link = LooseLink()
    link.plugged.clear()
    daemon = HeardDaemon(bench, link)
    with serving(daemon):
        until(lambda: daemon.troubles >= 5)
    assert (len(daemon.messages), daemon.messages[1]) == (2, "can5 is back")


def test_it_can_be_stopped_while_it_waits(bench: Path, frames: list[TimedFrame]) -> None:
    link = TroubledLink(frames)
    daemon = HeardDaemon(bench, link)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == len(frames))
        link.plugged.clear()
        until(lambda: bool(daemon.messages))
    assert daemon.core.knowledge.state.events >= 3
    assert daemon.unsent >= 1  # at least the last status


def test_a_full_transmit_queue_does_not_stop_the_observer(bench: Path) -> None:
    frames = frames_of(bench, worn_recording(8))
    link = TroubledLink(frames, has_room=False)
    daemon = HeardDaemon(bench, link)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames == len(frames))
        until(lambda: bool(daemon.messages))
        assert link.sent == []

        def is_settled() -> bool:
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
    _, count = published_rates(payloads(link.sent, RATE), len(frames) * BLOCK)
    assert count.max() == 1
    assert count[-3 * BLOCK :].all()  # the latest are those that were kept


def test_what_the_controller_tells_is_passed_on(bench: Path) -> None:
    link = TroubledLink()
    daemon = HeardDaemon(bench, link)
    with serving(daemon):
        until(lambda: bool(link.statuses()))
        link.reported_condition = BusCondition(BusState.PASSIVE, passives=1, error_frames=1)
        until(lambda: len(daemon.messages) == 1)
        for n in range(20):  # flickers
            link.reported_condition = replace(link.reported_condition, passives=2 + n, error_frames=2 + n)
            time.sleep(0.02)
        link.reported_condition = BusCondition(BusState.OFF, passives=25, bus_offs=1, error_frames=30)
        until(lambda: "bus-off" in daemon.messages[-1])
        until(lambda: link.statuses()[-1]["LinkTroubles"] == 26)
    assert "error-passive" in daemon.messages[0]
    assert len(daemon.messages) <= 3


PORTION = 60  # frames


@pytest.mark.parametrize(
    "interface", ["virtual", pytest.param("socketcan", marks=[pytest.mark.vcan, pytest.mark.slow])]
)
def test_results_over_four_buses_equal_one(request: pytest.FixtureRequest, tmp_path: Path, interface: str) -> None:
    """Played as fast as it goes, frames wait in the drivers; on real interfaces no faster than they take."""
    channels, speed = ([f"{uuid.uuid4().hex[:8]}-{name}" for name in ("rail", "lift", "line", "results")], math.inf)
    if interface == "socketcan":
        further = request.getfixturevalue("interfaces")
        channels, speed = [request.getfixturevalue("vcan"), *(each.name for each in further)], 0.05
    path = block_bench(tmp_path / "four", interface, channels)
    results, daemon = over_bus(path, frames_of(path, worn_recording()), speed)
    one_bus = load_bench(block_bench(tmp_path / "one", "virtual", ["one"]))
    assert results.results == results_of(evaluate(one_bus, [worn_recording()]).frames)
    assert (len(results.summaries), daemon.core.counters.lost_samples) == (4, 0)
    assert results.last_status()["TroubledBus"] == 0


@pytest.fixture
def four(tmp_path: Path) -> Path:
    return block_bench(tmp_path / "four", "virtual", ["can5", "can6", "can7", "can8"])


def on_links(path: Path) -> tuple[HeardDaemon, list[TroubledLink]]:
    links = [TroubledLink() for _ in range(4)]
    return HeardDaemon(path, *links), links


def has_taken(daemon: Daemon, frames: int) -> bool:
    return daemon.core.counters.frames == frames


def deliver(daemon: Daemon, links: Sequence[TroubledLink], frames: Sequence[TimedFrame]) -> None:
    for start in range(0, len(frames), PORTION):
        portion = frames[start : start + PORTION]
        taken = daemon.core.counters.frames + len(portion)
        for bus, link in enumerate(links):
            link.deliver([frame for frame in portion if frame.bus == bus])
        until(partial(has_taken, daemon, taken))


@pytest.mark.parametrize("first", [0, 100])
def test_a_bus_unreadable_for_a_while_is_waited_for(four: Path, monkeypatch: pytest.MonkeyPatch, first: int) -> None:
    """As by a machine that has no time for its thread: meanwhile the others could come to their end."""
    receive, taken = TroubledLink.receive, [0]

    def late(link: TroubledLink, timeout_s: float) -> Frame | None:
        if link is links[1]:
            if taken[0] == first:
                time.sleep(0.2)
            taken[0] += 1
        return receive(link, timeout_s)

    monkeypatch.setattr(TroubledLink, "receive", late)
    daemon, links = on_links(four)
    observes_all(daemon, links, frames_of(four, worn_recording()))


def observes_all(daemon: Daemon, links: Sequence[TroubledLink], frames: Sequence[TimedFrame]) -> None:
    for bus, link in enumerate(links):
        link.deliver([frame for frame in frames if frame.bus == bus])
    with serving(daemon):
        until(partial(has_taken, daemon, len(frames)))
    assert (daemon.core.counters.lost_samples, daemon.core.counters.injections) == (0, 4)


def test_a_bus_that_falls_silent_keeps_none_waiting(four: Path) -> None:
    frames = frames_of(four, worn_recording())
    daemon, links = on_links(four)
    with serving(daemon):
        deliver(daemon, links, frames[:300])
        deliver(daemon, links, [frame for frame in frames[300:] if frame.bus != 1])
        until(lambda: links[3].statuses()[-1]["Reason"] == Reason.INPUT_STALE)


def test_one_bus_goes_and_comes_back_while_the_others_are_served(four: Path) -> None:
    frames = frames_of(four, worn_recording())
    first, last = frames[: 3 * 200], frames[3 * 260 :]
    daemon, links = on_links(four)
    with serving(daemon):
        deliver(daemon, links, first)
        links[1].why = "can6 is down\n  remedy: plug it in"
        links[1].plugged.clear()
        until(lambda: bool(daemon.messages))
        assert daemon.messages == ["waiting for the interface: can6 is down\n  remedy: plug it in"]
        until(lambda: links[3].statuses()[-1]["State"] == State.WAITING_FOR_DATA)
        assert links[3].statuses()[-1]["Reason"] == Reason.INPUT_TIMEOUT
        assert links[3].statuses()[-1]["TroubledBus"] == 2
        deliver(daemon, links, [frame for frame in frames[3 * 200 : 3 * 260] if frame.bus != 1])
        links[1].plugged.set()
        until(lambda: len(daemon.messages) == 2)
        assert daemon.messages[1] == "lift (can6) is back"
        deliver(daemon, links, last)
        until(lambda: daemon.state(0)[0] in (State.RUNNING_NOMINAL, State.ADAPTED))
    status = links[3].statuses()[-1]
    assert (status["LinkTroubles"], status["TroubledBus"]) == (1, 0)
    assert (status["LostSamples"], [port.outages for port in daemon.ports]) == (60 * 28, [0, 1, 0, 0])
    assert [bool(link.sent) for link in links] == [False, False, False, True]
    assert daemon.core.counters.injections == 4


def test_without_the_bus_of_the_results_the_observer_goes_on(four: Path) -> None:
    frames = frames_of(four, worn_recording())
    daemon, links = on_links(four)
    with serving(daemon):
        links[3].why = "can8 is down"
        links[3].plugged.clear()
        until(lambda: bool(daemon.messages))
        deliver(daemon, links, frames)
        until(lambda: daemon.core.counters.events >= 3)
        links[3].plugged.set()
        until(lambda: bool(links[3].statuses()))
    assert daemon.messages == ["waiting for the interface: can8 is down", "results (can8) is back"]
    assert daemon.unsent > 100
    assert links[3].statuses()[-1]["State"] in (State.RUNNING_NOMINAL, State.ADAPTED)


def test_trouble_is_named_by_bus(four: Path) -> None:
    daemon, links = on_links(four)
    with serving(daemon):
        until(lambda: bool(links[3].statuses()))
        links[2].reported_condition = BusCondition(BusState.PASSIVE, passives=1, error_frames=1)
        links[0].lost = 7
        until(lambda: len(daemon.messages) == 2)
        until(lambda: links[3].statuses()[-1]["LinkTroubles"] == 1)
    lost, passive = sorted(daemon.messages)
    assert lost.startswith("7 frames of can5 were lost")
    assert passive.startswith("can7 is error-passive")
    assert (links[3].statuses()[-1]["DroppedFrames"], links[3].statuses()[-1]["TroubledBus"]) == (7, 3)
    shown = daemon.drawn(100, 30)
    assert "can5 error-active, stamps by arrival; lost here 7," in shown
    assert "line (can7) error-passive, stamps by arrival; lost here 0," in shown
    assert "results (can8) error-active, stamps by arrival; lost here 0," in shown
