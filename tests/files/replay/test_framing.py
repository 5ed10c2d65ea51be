"""Frames of recordings, decoded by plain cantools; that each is protected and counted tests/test_device.py says."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import load_bench
from observer_rt.engine.signal_survey import Survey
from observer_rt.files.replay.framing import Framer, Span, all_samples, clamped_in, windows_of
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


@pytest.fixture(scope="module")
def bus() -> BusMap:
    return map_bus(load_bench())


def test_missing_values_and_a_frame_not_filled_are_not_available(bus: BusMap) -> None:
    lift = np.full(10, 1e-4)
    lift[4] = np.nan
    recording = recording_of(10, lift)
    values = decoded(list(Framer(bus).frames(recording, all_samples(recording))))
    assert np.flatnonzero(np.isnan(list(values[1].values()))).tolist() == [4, *range(10, 18)]
    assert np.flatnonzero(np.isnan(list(values[0].values()))).tolist() == list(range(10, 18))


def test_messages_of_their_own_come_in_order_of_time(tmp_path: Path) -> None:
    """Of 28 samples each."""
    bus = map_bus(load_bench(sample_bench(tmp_path, THREE_MESSAGES, rate=RATE)))
    recording = recording_of(28 * 5 + 3)
    frames = list(Framer(bus).frames(recording, all_samples(recording)))
    assert [frame.frame_id for frame in frames] == [RAIL_BLOCK, LIFT_BLOCK, LINE_BLOCK] * 6
    times = [frame.time for frame in frames]
    assert times == sorted(times)


def test_spans_send_their_samples_only(bus: BusMap) -> None:
    recording = recording_of(900)
    frames = list(Framer(bus).frames(recording, [Span(100, 118), Span(500, 509)]))
    values = decoded(frames)
    assert list(values[0]) == [*range(100, 118), *range(500, 509)]
    assert [frame.payload[2] for frame in frames] == [0, 1, 2]  # no frame was lost between the spans
    assert [frame.time for frame in frames] == pytest.approx([108 / RATE, 117 / RATE, 508 / RATE])


def test_windows_reach_from_2_ms_before_to_4_ms_after_an_injection() -> None:
    lift = np.zeros(5000)
    lift[1000:1050] = lift[1150:1250] = 1e-4  # a pilot and its main injection
    lift[4900:4950] = 1e-4  # its window ends with the recording
    spans = windows_of([recording_of(5000, lift)])
    assert len(spans) == 2
    assert (spans[0].start, spans[1]) == (800, Span(4700, 5000))
    assert spans[0].end == pytest.approx(1650, abs=1)


def test_noise_of_the_lift_opens_no_window() -> None:
    assert windows_of([recording_of(50_000, np.random.default_rng(0).normal(0.0, 0.4e-6, 50_000))]) == []


def warnings_of(**changed: float) -> list[str]:
    """Warnings about signals that leave the range of the bus in one value each."""
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
