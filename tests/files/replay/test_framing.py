"""Frames of recordings, decoded by plain cantools; that each is protected and counted tests/test_device.py says."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.engine.signal_survey import Survey
from observer_rt.files.replay.framing import Framer, all_samples, clamped_in, windows_of
from observer_rt.files.signals.recording import Recording
from tests.benches import THREE_MESSAGES, sample_bench
from tests.files.replay.decoded import decoded

RATE = 100e3
RAIL_BLOCK, LIFT_BLOCK, LINE_BLOCK = 0x110, 0x111, 0x112


def recording_of(samples: int, lift: NDArray[np.float64] | None = None) -> Recording:
    random = np.random.default_rng(samples)
    return Recording(
        time=3.0 + np.arange(samples) / RATE,
        rail_pressure=random.uniform(0, 200e6, samples),
        needle_lift=random.uniform(0, 0.3e-3, samples) if lift is None else lift,
        line_pressure=random.uniform(-5e6, 200e6, samples),
    )


def test_missing_values_and_a_frame_not_filled_are_not_available() -> None:
    lift = np.full(10, 1e-4)
    lift[4] = np.nan
    recording = recording_of(10, lift)
    values = decoded(list(Framer(map_bus(load_bench())).frames(recording, all_samples(recording))))
    assert np.flatnonzero(np.isnan(list(values[1].values()))).tolist() == [4, *range(10, 18)]
    assert np.flatnonzero(np.isnan(list(values[0].values()))).tolist() == list(range(10, 18))


def test_messages_of_their_own_come_in_order_of_time(tmp_path: Path) -> None:
    bus = map_bus(load_bench(sample_bench(tmp_path, THREE_MESSAGES, rate=RATE)))
    recording = recording_of(28 * 5 + 3)
    frames = list(Framer(bus).frames(recording, all_samples(recording)))
    assert [frame.frame_id for frame in frames] == [RAIL_BLOCK, LIFT_BLOCK, LINE_BLOCK] * 6
    times = [frame.time for frame in frames]
    assert times == sorted(times)


def test_noise_of_the_lift_opens_no_window() -> None:
    assert windows_of([recording_of(50_000, np.random.default_rng(0).normal(0.0, 0.4e-6, 50_000))]) == []


def warnings_of(**changed: float) -> list[str]:
    survey = Survey()
    for name, inside in (("rail_pressure", 100e6), ("needle_lift", 100e-6), ("line_pressure", 100e6)):
        survey.take(name, np.array([inside, changed.get(name, inside), np.nan]))
    return clamped_in(survey, map_bus(load_bench()))


def test_values_out_of_range_are_told_by_role() -> None:
    assert warnings_of(needle_lift=605.334e-6) == []  # rounds to the largest value
    (lift,) = warnings_of(needle_lift=605.336e-6)
    assert lift.startswith("needle_lift: reaches 0.605336 mm, beyond 0.60533 mm")
    (above,) = warnings_of(line_pressure=400e6)
    assert above.startswith("line_pressure: reaches 400 MPa, beyond 317.665 MPa, the limit of ")
    (below,) = warnings_of(line_pressure=-10.1e6)
    assert below.startswith("line_pressure: reaches -10.1 MPa, beyond -10 MPa")
