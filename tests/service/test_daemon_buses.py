"""The daemon on several buses: results as from one, and a bus that goes away and comes back."""

import math
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest
from rich.console import Console

from observer_rt.bus.links.controller import BusCondition, BusState
from observer_rt.bus.links.link import Frame, Link
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.recording.replay.player import play
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.news import Notes
from observer_rt.service.screen.view import View
from observer_rt.service.warm_up import warm_up
from tests.benches import block_bench
from tests.device import frames_of, worn_recording
from tests.service.end_to_end import RATE, SUMMARY, Heard
from tests.service.participants import listening, serving, until
from tests.service.test_daemon_link import TroubledLink

BLOCK = 28
PORTION = 60  # frames


def expected_payloads(folder: Path) -> tuple[list[bytes], list[bytes]]:
    """Rates and summaries that one bus gives, by `evaluate`."""
    one = load_bench(block_bench(folder / "one", "virtual", ["one"]))
    frames = evaluate(one, [worn_recording()]).frames
    return tuple([f.payload for f in frames if f.frame_id == m.frame_id] for m in (RATE, SUMMARY))  # type: ignore[return-value]


@contextmanager
def opened(path: Path, sending: bool) -> Iterator[list[Link]]:
    """A link to each bus of a bench, for the daemon or for the measuring devices."""
    bench = load_bench(path)
    bus = map_bus(bench)
    with ExitStack() as stack:
        yield [
            stack.enter_context(
                open_link(
                    each.config.interface,
                    each.config.channel,
                    True,
                    [] if sending else bus.received_on(number),
                    not sending,
                )
            )
            for number, each in enumerate(bench.config.buses)
        ]


def over_buses(path: Path, frames: Sequence[TimedFrame]) -> tuple[Heard, Daemon]:
    """Frames played to a daemon over all buses of a bench; what is heard on the last."""
    bench = load_bench(path)
    bus = map_bus(bench)
    warm_up(bench, bus)
    results = bench.config.buses[-1].config
    with (
        listening(results.interface, results.channel) as listener,
        opened(path, sending=False) as links,
        opened(path, sending=True) as players,
    ):
        daemon = Daemon(bench, bus, links)
        with serving(daemon):
            play(frames, players[0], math.inf, by_bus=dict(enumerate(players)))
            until(lambda: daemon.core.counters.frames >= len(frames))
        until(
            lambda: (
                bool(listener.heard.statuses)
                and int(listener.heard.last_status()["SamplesProcessed"]) == daemon.core.processed
            )
        )
    return listener.heard, daemon


def test_results_over_four_buses_equal_those_of_one(tmp_path: Path) -> None:
    """Played as fast as it goes: frames wait in the drivers."""
    channels = [f"{uuid.uuid4().hex[:8]}-{name}" for name in ("rail", "lift", "line", "results")]
    path = block_bench(tmp_path / "four", "virtual", channels)
    heard, daemon = over_buses(path, frames_of(path, worn_recording()))
    assert (heard.rates, heard.summaries) == expected_payloads(tmp_path)
    assert len(heard.summaries) == 4
    assert daemon.core.counters.lost_samples == 0


@pytest.fixture
def four(tmp_path: Path) -> Path:
    return block_bench(tmp_path / "four", "virtual", ["can5", "can6", "can7", "can8"])


def on_links(path: Path) -> tuple[Daemon, list[TroubledLink], list[str]]:
    """A daemon, its links and what it says."""
    bench = load_bench(path)
    bus = map_bus(bench)
    warm_up(bench, bus)
    links, notes = [TroubledLink() for _ in range(4)], Notes()
    return Daemon(bench, bus, links, listeners=[notes]), links, notes.messages


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
    daemon, links, _ = on_links(four)
    for bus, link in enumerate(links):
        link.deliver([frame for frame in frames if frame.bus == bus])
    with serving(daemon):
        until(partial(has_taken, daemon, len(frames)))
    assert daemon.core.counters.lost_samples == 0
    assert daemon.core.counters.injections == 4


def test_a_bus_that_falls_silent_keeps_none_waiting(four: Path) -> None:
    frames = frames_of(four, worn_recording())
    daemon, links, _ = on_links(four)
    with serving(daemon):
        deliver(daemon, links, frames[:300])
        deliver(daemon, links, [frame for frame in frames[300:] if frame.bus != 1])
        until(lambda: links[3].statuses()[-1]["Reason"] == Reason.INPUT_STALE)


def test_one_bus_goes_and_comes_back_while_the_others_are_served(four: Path) -> None:
    frames = frames_of(four, worn_recording())
    first, last = frames[: 3 * 200], frames[3 * 260 :]
    daemon, links, messages = on_links(four)
    with serving(daemon):
        deliver(daemon, links, first)
        links[1].why = "can6 is down\n  remedy: plug it in"
        links[1].plugged.clear()
        until(lambda: bool(messages))
        assert messages == ["waiting for the interface: can6 is down\n  remedy: plug it in"]
        until(lambda: links[3].statuses()[-1]["State"] == State.WAITING_FOR_DATA)
        assert links[3].statuses()[-1]["Reason"] == Reason.INPUT_TIMEOUT
        assert links[3].statuses()[-1]["TroubledBus"] == 2
        during = [frame for frame in frames[3 * 200 : 3 * 260] if frame.bus != 1]
        deliver(daemon, links, during)
        links[1].plugged.set()
        until(lambda: len(messages) == 2)
        assert messages[1] == "lift (can6) is back"
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
    daemon, links, messages = on_links(four)
    with serving(daemon):
        links[3].why = "can8 is down"
        links[3].plugged.clear()
        until(lambda: bool(messages))
        deliver(daemon, links, frames)
        until(lambda: daemon.core.counters.events >= 3)
        links[3].plugged.set()
        until(lambda: bool(links[3].statuses()))
    assert messages == ["waiting for the interface: can8 is down", "results (can8) is back"]
    assert daemon.unsent > 100
    assert links[3].statuses()[-1]["State"] in (State.RUNNING_NOMINAL, State.ADAPTED)


def test_trouble_is_named_by_bus(four: Path) -> None:
    daemon, links, messages = on_links(four)
    view = View("four buses", load_bench(four).injector)
    view.watch(daemon)
    with serving(daemon):
        until(lambda: bool(links[3].statuses()))
        links[2].told = BusCondition(BusState.PASSIVE, passives=1, error_frames=1)
        links[0].lost = 7
        until(lambda: len(messages) == 2)
        until(lambda: links[3].statuses()[-1]["LinkTroubles"] == 1)
    lost, passive = sorted(messages)
    assert lost.startswith("7 frames of can5 were lost")
    assert passive.startswith("can7 is error-passive")
    assert links[3].statuses()[-1]["DroppedFrames"] == 7
    assert links[3].statuses()[-1]["TroubledBus"] == 3
    console = Console(width=100, record=True)
    with console.capture() as capture:
        console.print(view.render(0, 100, 30))
    shown = capture.get()
    assert "can5 error-active, stamps by arrival; lost here 7," in shown
    assert "line (can7) error-passive, stamps by arrival; lost here 0," in shown
    assert "results (can8) error-active, stamps by arrival; lost here 0," in shown
