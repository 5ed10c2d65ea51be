"""A user's own bus database, and frames of several buses: the same rates; two injectors: as if each were alone.

Frames that take turns, protected and windowed: a pause is legal only if the counter went on over all of them.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.config.bench import Bench, load_bench
from observer_rt.core.frames.frames import SLOTS
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import Counters, OutputFrame
from observer_rt.files.replay.framing import Span, TimedFrame
from observer_rt.files.signals.recording import Recording
from tests.benches import SAMPLE_RATE, attributes, own_bench, twin_bench
from tests.device import Traffic, damaged, delayed, frames_of, hand, merged, run, shuffled, worn_recording
from tests.two_injectors import one_injector, two_injectors

WINDOWS = [Span(0, 600), Span(3000, 3600)]
TURNS = """VERSION ""
BU_: Daq
BO_ 291 Turns: 12 Daq
 SG_ Channel M : 12|4@1+ (1,0) [0|0] "" Daq
 SG_ Index : 16|32@1+ (1,0) [0|0] "" Daq
{signals}
"""

LOOK_BACK = SLOTS / SAMPLE_RATE  # s


@pytest.fixture(scope="module")
def turns(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    folder = tmp_path_factory.mktemp("turns")
    channels = (
        ("Rail", '(0.005,0) [0|0] "MPa"'),
        ("Lift", '(0.01,-50) [0|0] "um"'),
        ("Line", '(0.005,0) [0|0] "MPa"'),
    )
    signals = [
        f" SG_ {name}{k} m{channel} : {48 + 16 * k}|16@1+ {code} Daq"
        for channel, (name, code) in enumerate(channels)
        for k in range(3)
    ]
    database = TURNS.format(signals="\n".join(signals)) + attributes([291], {291: (1, 291)})
    roles = zip(("rail_pressure", "needle_lift", "line_pressure"), channels, strict=True)
    lines = {role: f'message = "Turns"\nindex = "Index"\npattern = "{name}{{}}"' for role, (name, _) in roles}
    return load_bench(own_bench(folder, database, lines, f"[sampling]\nrate_hz = {SAMPLE_RATE}\n"))


def standstill_frames(turns: Bench) -> list[TimedFrame]:
    samples = 4000
    pressure = np.full(samples, 100e6)
    recording = Recording(np.arange(samples) / SAMPLE_RATE, pressure, np.zeros(samples), pressure)
    return frames_of(turns, recording, WINDOWS)


def counted(turns: Bench, frames: list[TimedFrame]) -> Counters:
    return run(turns, frames).core.counters


def test_a_pause_is_no_loss(turns: Bench) -> None:
    counters = counted(turns, standstill_frames(turns))
    assert (counters.jumps, counters.lost_samples, counters.sequence_errors) == (1, 0, 0)
    assert counters.samples == 1200


@pytest.mark.parametrize("missing", range(6))
def test_a_frame_lost_at_a_pause_makes_it_a_loss(turns: Bench, missing: int) -> None:
    """Any of the last three frames before it and the first three after it."""
    frames = standstill_frames(turns)
    first = len(frames) // 2 - 3 + missing
    counters = counted(turns, frames[:first] + frames[first + 1 :])
    assert counters.jumps == 0
    assert counters.lost_samples >= 2400


def test_a_repeated_frame_changes_nothing(turns: Bench) -> None:
    frames = standstill_frames(turns)
    last = len(frames) // 2 - 1
    counters = counted(turns, [*frames[: last + 1], frames[last], *frames[last + 1 :]])
    assert (counters.jumps, counters.lost_samples, counters.repeated_frames) == (1, 0, 1)


def test_damaged_frames_are_counted_once(turns: Bench) -> None:
    frames = standstill_frames(turns)
    frames[9] = damaged(frames[9], 56)
    counters = counted(turns, frames)
    assert (counters.crc_errors, counters.frames, counters.lost_samples) == (1, len(frames), 3)


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Traffic:
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
