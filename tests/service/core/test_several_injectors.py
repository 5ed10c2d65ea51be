"""Frames of a bench with two injectors, each to the cores it has samples for: as if each injector were alone."""

from dataclasses import replace
from pathlib import Path

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import load_bench
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame
from tests.device import frames_of, hand, merged, run, worn_recording
from tests.two_injectors import one_injector, two_injectors


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
        for to in mapped.destinations[key]:
            results[to.injector] += hand(cores[to.injector], [frame])
    for number, (name, recording) in enumerate((("left", left), ("right", right))):
        path = one_injector(tmp_path, name, number + 1)
        alone = run(path, frames_of(path, recording))
        assert results[number] + cores[number].finish() == alone.frames
        assert cores[number].counters == alone.core.counters
    assert [core.counters.injections for core in cores] == [4, 0]
    assert [core.counters.lost_samples for core in cores] == [0, 0]
