"""Damaged frames, two devices with one identifier, and outages are reported with a remedy."""

from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from observer_rt.daemon.arrivals import Arrivals
from observer_rt.daemon.input_watch import LOOKS, LOOKS_WAITED, REPORTED_AFTER, REPORTED_SHARES, FrameWatch
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import Counters
from observer_rt.engine.words import COUNTERS
from tests.benches import THREE_MESSAGES, sample_bench

RATE = 100e3


@pytest.fixture
def arrivals() -> Arrivals:
    return Arrivals(map_bus(load_bench()))


@pytest.mark.parametrize("silent", [["needle_lift"], ["rail_pressure"], ["needle_lift", "rail_pressure"], []])
def test_a_lift_that_alone_stays_away_may_be_replaced(tmp_path: Path, silent: list[str]) -> None:
    arrivals = Arrivals(map_bus(load_bench(sample_bench(tmp_path, THREE_MESSAGES))))
    for source in arrivals.sources:
        arrivals.note(0, source.layout.frame_id, source.layout.is_extended, 0 if source.roles[0] in silent else 10**9)
    assert arrivals.lacks_only(Role.NEEDLE_LIFT, 10**9) == (silent == ["needle_lift"])


@pytest.fixture
def counters() -> Counters:
    bench = load_bench()
    return Core(bench.injector, map_bus(bench), learning=False).counters


def messages_of_looks(
    arrivals: Arrivals,
    watch: FrameWatch,
    counters: Counters,
    step: dict[str, int],
    looks: int,
    is_explained: bool = False,
    dropped: int = 0,
) -> list[str]:
    """Texts reported in so many looks; before each, counters and frames of every message rise by `step`."""
    texts = []
    for _ in range(looks):
        for source in arrivals.sources:
            arrivals.set_count(source.layout, arrivals.count_of(source).frames + step.get("frames", 0), 0)
        vars(counters).update({name: getattr(counters, name) + more for name, more in step.items()})
        texts += [notice.text for notice in watch.look(replace(counters), is_explained, dropped)]
    return texts


@pytest.mark.parametrize("counter", REPORTED_SHARES)
def test_useless_frames_are_reported_once_and_their_end(arrivals: Arrivals, counters: Counters, counter: str) -> None:
    watch, words = FrameWatch(arrivals, RATE), COUNTERS[counter]
    few = {"frames": 1000, counter: 1}
    assert messages_of_looks(arrivals, watch, counters, few, 2 * LOOKS + 1) == []
    (message,) = messages_of_looks(arrivals, watch, counters, {"frames": 1000, counter: 150}, 4 * LOOKS)
    assert message == f"1500 of 10000 input frames: {words.what}\n  remedy: {words.remedy}"
    (over,) = messages_of_looks(arrivals, watch, counters, {"frames": 1000}, 3 * LOOKS)
    assert over == f"no more {words.what}"


def test_no_more_frames_are_useless_than_there_are(arrivals: Arrivals, counters: Counters) -> None:
    """Counters are read after the frames were counted."""
    watch = FrameWatch(arrivals, RATE)
    (message,) = messages_of_looks(arrivals, watch, counters, {"frames": 80, "length_errors": 83}, 2 * LOOKS)
    assert message.startswith("800 of 800 input frames: ")


def test_frames_whose_fault_another_watch_reported_are_passed_over(arrivals: Arrivals, counters: Counters) -> None:
    watch, step = FrameWatch(arrivals, RATE), {"frames": 1000, "crc_errors": 900}
    assert messages_of_looks(arrivals, watch, counters, step, 4 * LOOKS, is_explained=True) == []


def test_an_outage_is_reported_with_its_length(arrivals: Arrivals, counters: Counters) -> None:
    watch = FrameWatch(arrivals, RATE)
    assert messages_of_looks(arrivals, watch, counters, {"frames": 1000, "lost_samples": 90}, 5) == []
    (message,) = messages_of_looks(arrivals, watch, counters, {"lost_samples": 20_000}, 1)
    assert message.startswith("samples of 0.2 s were lost at once\n  remedy: ")
    own = f"at once, with 300 frames that this computer dropped\n  remedy: {COUNTERS['dropped_frames'].remedy}"
    for looks in (LOOKS_WAITED - 2, 1):  # samples are missed some time after the computer dropped their frames
        assert messages_of_looks(arrivals, watch, counters, {"frames": 1000}, looks, dropped=300) == []
        (message,) = messages_of_looks(arrivals, watch, counters, {"lost_samples": 20_000}, 1, dropped=300)
        assert message.endswith(own) == (looks > 1)
    silence = {"lost_samples": round(REPORTED_AFTER * RATE)}  # which is reported by itself
    assert messages_of_looks(arrivals, watch, counters, silence, 1) == []
