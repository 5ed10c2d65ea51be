"""The daemon on several buses: results as from one, and a bus that goes away and comes back."""

import time
import uuid
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pytest

from observer_rt.bus.links.controller import BusCondition, BusState
from observer_rt.bus.links.link import Frame
from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.service.daemon import Daemon
from tests.benches import block_bench
from tests.device import frames_of, worn_recording
from tests.service.end_to_end import results_of
from tests.service.participants import HeardDaemon, TroubledLink, over_bus, serving, until

BLOCK = 28
PORTION = 60  # frames


def test_results_over_four_buses_equal_those_of_one(tmp_path: Path) -> None:
    """Played as fast as it goes: frames wait in the drivers."""
    channels = [f"{uuid.uuid4().hex[:8]}-{name}" for name in ("rail", "lift", "line", "results")]
    path = block_bench(tmp_path / "four", "virtual", channels)
    heard, daemon = over_bus(path, frames_of(path, worn_recording()))
    one = load_bench(block_bench(tmp_path / "one", "virtual", ["one"]))
    assert heard.results == results_of(evaluate(one, [worn_recording()]).frames)
    assert len(heard.summaries) == 4
    assert daemon.core.counters.lost_samples == 0


@pytest.fixture
def four(tmp_path: Path) -> Path:
    return block_bench(tmp_path / "four", "virtual", ["can5", "can6", "can7", "can8"])


def on_links(path: Path) -> tuple[HeardDaemon, list[TroubledLink]]:
    """A daemon and its links."""
    links = [TroubledLink() for _ in range(4)]
    return HeardDaemon(path, *links, is_warm=True), links


def has_taken(daemon: Daemon, frames: int) -> bool:
    return daemon.core.counters.frames == frames


def deliver(daemon: Daemon, links: Sequence[TroubledLink], frames: Sequence[TimedFrame]) -> None:
    """The frames, in portions, each when the one before has been taken."""
    for start in range(0, len(frames), PORTION):
        portion = frames[start : start + PORTION]
        taken = daemon.core.counters.frames + len(portion)
        for bus, link in enumerate(links):
            link.deliver([frame for frame in portion if frame.bus == bus])
        until(partial(has_taken, daemon, taken))


def test_a_bus_that_is_read_slowly_is_not_left_behind(four: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All frames wait in the drivers, one of which takes its time."""
    receive = TroubledLink.receive

    def slowly(link: TroubledLink, timeout_s: float) -> Frame | None:
        if link is links[1]:
            time.sleep(1e-3)
        return receive(link, timeout_s)

    monkeypatch.setattr(TroubledLink, "receive", slowly)
    frames = frames_of(four, worn_recording())
    daemon, links = on_links(four)
    for bus, link in enumerate(links):
        link.deliver([frame for frame in frames if frame.bus == bus])
    with serving(daemon):
        until(partial(has_taken, daemon, len(frames)))
    assert daemon.core.counters.lost_samples == 0
    assert daemon.core.counters.injections == 4


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
        during = [frame for frame in frames[3 * 200 : 3 * 260] if frame.bus != 1]
        deliver(daemon, links, during)
        links[1].plugged.set()
        until(lambda: len(daemon.messages) == 2)
        assert daemon.messages[1] == "lift (can6) is back"
        deliver(daemon, links, last)
        until(lambda: daemon.state(0)[0] in (State.RUNNING_NOMINAL, State.ADAPTED))
    status = links[3].statuses()[-1]
    assert (status["LinkTroubles"], status["TroubledBus"]) == (1, 0)
    assert status["LostSamples"] == 60 * BLOCK
    assert [port.outages for port in daemon.ports] == [0, 1, 0, 0]
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
        links[2].told = BusCondition(BusState.PASSIVE, passives=1, error_frames=1)
        links[0].lost = 7
        until(lambda: len(daemon.messages) == 2)
        until(lambda: links[3].statuses()[-1]["LinkTroubles"] == 1)
    lost, passive = sorted(daemon.messages)
    assert lost.startswith("7 frames of can5 were lost")
    assert passive.startswith("can7 is error-passive")
    assert links[3].statuses()[-1]["DroppedFrames"] == 7
    assert links[3].statuses()[-1]["TroubledBus"] == 3
    shown = daemon.drawn(100, 30)
    assert "can5 error-active, stamps by arrival; lost here 7," in shown
    assert "line (can7) error-passive, stamps by arrival; lost here 0," in shown
    assert "results (can8) error-active, stamps by arrival; lost here 0," in shown
