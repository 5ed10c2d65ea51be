"""Frames of several buses: distinguished by their bus, joined by their index, in whatever order they are read.

Those of a bench with two injectors go to the cores that have samples for them: as if each injector were alone.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.bus.mapping.timing import SLOTS
from observer_rt.config.bench import load_bench
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.files.replay.framing import TimedFrame
from tests.benches import SAMPLE_RATE, twin_bench
from tests.device import Traffic, delayed, frames_of, hand, merged, run, shuffled, worn_recording
from tests.two_injectors import one_injector, two_injectors

LOOK_BACK = SLOTS / SAMPLE_RATE  # s


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Traffic:
    """In order of time."""
    path = twin_bench(tmp_path_factory.mktemp("twins"))
    frames = frames_of(path, worn_recording())
    return Traffic(path, frames, run(path, frames))


def test_equal_messages_of_three_buses_are_three_messages(twins: Traffic) -> None:
    bus = map_bus(load_bench(twins.bench))
    assert [layout.bus for layout in bus.input_layouts] == [0, 1, 2]
    assert {(layout.frame_id, layout.e2e_data_id) for layout in bus.input_layouts} == {(291, 7)}
    counters = twins.result.core.counters
    assert (counters.frames, counters.lost_samples, counters.injections) == (len(twins.frames), 0, 4)
    assert (counters.sequence_errors, counters.repeated_frames, counters.old_frames) == (0, 0, 0)
    assert {frame.bus for frame in twins.result.frames} == {0}


def test_a_frame_on_another_bus_is_not_ours(twins: Traffic) -> None:
    core = twins.run([frame._replace(bus=3) for frame in twins.frames[:30]]).core
    assert core.counters.frames == 0


REORDERED: dict[str, Callable[[list[TimedFrame]], list[TimedFrame]]] = {
    **{
        f"late by {late} s": partial(delayed, seconds=late)
        for late in ((0.0, 0.03, 0.0), (0.0, 0.0, 0.03), (0.02, 0.0, 0.01))
    },
    **{f"at random, {seed}": partial(shuffled, seconds=0.5 * LOOK_BACK, seed=seed) for seed in range(3)},
}


@pytest.mark.parametrize("order", REORDERED)
def test_the_order_in_which_buses_are_read_changes_no_result(twins: Traffic, order: str) -> None:
    """Within the look-back."""
    assert LOOK_BACK > 0.03
    reordered = REORDERED[order](twins.frames)
    assert reordered != twins.frames
    assert twins.run(reordered).frames == twins.result.frames


def test_beyond_the_look_back_samples_are_lost_and_nothing_is_valid(twins: Traffic) -> None:
    core = twins.run(delayed(twins.frames, (0.0, 1.5 * LOOK_BACK, 0.0))).core
    assert core.counters.samples < 0.2 * len(twins.frames) / 3 * 28
    assert core.counters.lost_samples > 0 or core.counters.samples == 0
    rows = core.rows(0, core.processed)
    assert not rows["valid"].any()


def test_a_shared_rail_pressure_feeds_both(tmp_path: Path) -> None:
    left = worn_recording()
    right = replace(left, needle_lift=0.0 * left.needle_lift, line_pressure=left.rail_pressure)  # stays shut
    bench = load_bench(two_injectors(tmp_path))
    mapped = map_bench(bench)
    cores = [Core(injector, bus) for injector, bus in zip(bench.injectors, mapped.injectors, strict=True)]
    frames = frames_of(one_injector(tmp_path, "left", 1), left)
    frames += (f for f in frames_of(one_injector(tmp_path, "right", 2), right) if f.bus > 0)
    results: list[list[OutputFrame]] = [[], []]
    for frame in merged(frames):
        key = frame_key(frame.frame_id, frame.is_extended, frame.bus)
        for number, bus in enumerate(mapped.injectors):
            if key in {layout.key for layout in bus.input_layouts}:
                results[number] += hand(cores[number], [frame])
    for number, (name, recording) in enumerate((("left", left), ("right", right))):
        path = one_injector(tmp_path, name, number + 1)
        alone = run(path, frames_of(path, recording))
        assert results[number] + cores[number].finish() == alone.frames
        assert cores[number].counters == alone.core.counters
    assert [core.counters.injections for core in cores] == [4, 0]
    assert [core.counters.lost_samples for core in cores] == [0, 0]
