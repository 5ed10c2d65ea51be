"""Frames of several buses: told apart by their bus, joined by their index, in whatever order they are read."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.timing import SLOTS
from observer_rt.config.bench import load_bench
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.service.core.messages import OutputFrame
from tests.benches import SAMPLE_RATE, block_bench, twin_bench
from tests.device import delayed, frames_of, run, shuffled, worn_recording

LOOK_BACK = SLOTS / SAMPLE_RATE  # s


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return twin_bench(tmp_path_factory.mktemp("twins"))


@pytest.fixture(scope="module")
def frames(twins: Path) -> list[TimedFrame]:
    return frames_of(twins, worn_recording())


@pytest.fixture(scope="module")
def in_time(twins: Path, frames: list[TimedFrame]) -> list[OutputFrame]:
    """The results of the frames in order of time."""
    return run(twins, frames).frames


def test_equal_messages_of_three_buses_are_three_messages(
    twins: Path, frames: list[TimedFrame], in_time: list[OutputFrame]
) -> None:
    bus = map_bus(load_bench(twins))
    assert [layout.bus for layout in bus.input_layouts] == [0, 1, 2]
    assert {(layout.frame_id, layout.e2e_data_id) for layout in bus.input_layouts} == {(291, 7)}
    core = run(twins, frames).core
    counters = core.counters
    assert (counters.frames, counters.lost_samples, counters.injections) == (len(frames), 0, 4)
    assert (counters.sequence_errors, counters.repeated_frames, counters.old_frames) == (0, 0, 0)
    assert {frame.bus for frame in in_time} == {0}


def test_a_frame_on_another_bus_is_not_ours(twins: Path, frames: list[TimedFrame]) -> None:
    core = run(twins, [frame._replace(bus=3) for frame in frames[:30]]).core
    assert core.counters.frames == 0


@pytest.mark.parametrize("late", [(0.0, 0.03, 0.0), (0.0, 0.0, 0.03), (0.02, 0.0, 0.01)])
def test_a_bus_that_is_read_late_changes_no_result(
    twins: Path, frames: list[TimedFrame], in_time: list[OutputFrame], late: tuple[float, ...]
) -> None:
    assert max(late) < LOOK_BACK
    reordered = delayed(frames, late)
    assert reordered != frames
    assert run(twins, reordered).frames == in_time


@pytest.mark.parametrize("seed", range(3))
def test_buses_interleaved_at_random_change_no_result(
    twins: Path, frames: list[TimedFrame], in_time: list[OutputFrame], seed: int
) -> None:
    reordered = shuffled(frames, 0.5 * LOOK_BACK, seed)
    assert reordered != frames
    assert run(twins, reordered).frames == in_time


def test_beyond_the_look_back_samples_are_lost_and_nothing_is_valid(
    twins: Path, frames: list[TimedFrame]
) -> None:
    core = run(twins, delayed(frames, (0.0, 1.5 * LOOK_BACK, 0.0))).core
    assert core.counters.samples < 0.2 * len(frames) / 3 * 28
    assert core.counters.lost_samples > 0 or core.counters.samples == 0
    rows = core.rows(0, core.processed)
    assert not rows["valid"].any()


def test_three_buses_and_a_fourth_for_the_results_equal_one_bus(tmp_path: Path) -> None:
    recording = worn_recording()
    one = block_bench(tmp_path / "one", "virtual", ["a"])
    four = block_bench(tmp_path / "four", "virtual", ["a", "b", "c", "d"])
    expected = run(one, frames_of(one, recording)).frames
    found = run(four, frames_of(four, recording)).frames
    assert {frame.bus for frame in found} == {3}
    assert [frame._replace(bus=0) for frame in found] == expected
    assert len(expected) > 300
