"""Long recordings: which injections are kept of them, and in how much memory."""

import tracemalloc
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.errors import UserError
from observer_rt.identification.likelihood.events import JudgedEvent, Lack
from observer_rt.identification.likelihood.excerpts import BLOCK_SAMPLES, measured
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.reading import coverage
from tests.files.signals.generated import RepeatedRecording
from tests.identification.discovery.hidden import recordings

MOST = 150_000  # samples
PERIOD = 12_000  # samples of two injections


@cache
def pair(rail_pressure: float = 100e6) -> Recording:
    """Two injections, which may be repeated without a leap."""
    (recording,) = recordings(points=((rail_pressure, 1e-3),), measured_rate=True)
    return part(recording, 13_000, 13_000 + PERIOD)


def part(recording: Recording, start: int, end: int) -> Recording:
    rail, lift, line, rate = (values[start:end] for values in recording.signals.values())
    return Recording(np.arange(end - start) / 100e3, rail, lift, line, rate)


def joined(*parts: Recording) -> Recording:
    rail, lift, line, rate = (np.concatenate([part.signals[name] for part in parts]) for name in parts[0].signals)
    return Recording(np.arange(rail.size) / 100e3, rail, lift, line, rate)


def windows(measurement: Measurement) -> list[bytes]:
    lift = measurement.recording.needle_lift
    return [lift[event.start : event.end].tobytes() for event in measurement.events]


def lengths(event: JudgedEvent) -> tuple[int, ...]:
    return tuple(event.openings[0].first - place for place in (event.start, event.counted, event.end))


def test_a_recording_that_is_not_too_long_is_taken_whole() -> None:
    kept, (expected,) = measured(HeldSignals(pair())), measurements([pair()])
    assert kept.recording is pair()
    assert kept.events == expected.events
    assert (kept.noise, kept.rate_noise) == (expected.noise, expected.rate_noise)
    assert coverage(kept) == coverage(expected)


def test_every_injection_of_a_long_one_is_found_whole() -> None:
    times = 2 * BLOCK_SAMPLES // PERIOD + 5
    kept = measured(RepeatedRecording(pair(), times), most=MOST)
    (expected,) = measurements([RepeatedRecording(pair(), times).collected()])
    assert kept.injections.complete == len(expected.events) == 2 * times
    assert kept.injections.left_out == ()
    assert kept.recording.samples <= MOST
    assert len(kept.events) > MOST // PERIOD
    assert set(windows(kept)) <= set(windows(expected))
    assert {lengths(event) for event in kept.events} == {lengths(event) for event in expected.events}
    assert kept.noise.line_pressure == pytest.approx(expected.noise.line_pressure, rel=0.02)
    assert kept.noise.needle_lift == pytest.approx(expected.noise.needle_lift, rel=0.15)
    assert (kept.rail_pressure, kept.duration) == pytest.approx((expected.rail_pressure, expected.duration), rel=1e-3)


def test_a_rare_operating_point_keeps_all_of_its_injections() -> None:
    rare = pair(60e6)
    often = RepeatedRecording(pair(), 20).collected()
    kept = measured(HeldSignals(joined(often, rare, often, often)), most=MOST)
    pressures = [float(kept.recording.rail_pressure[event.openings[0].first - 100]) for event in kept.events]
    assert sum(pressure < 80e6 for pressure in pressures) == 2
    assert len(pressures) > 10


def test_what_is_kept_is_spread_over_the_whole() -> None:
    """The lift tells when: every injection is a little higher than the one before."""
    long = RepeatedRecording(pair(), 40).collected()
    long = replace(long, needle_lift=long.needle_lift * np.linspace(1.0, 1.5, long.samples))
    kept = measured(HeldSignals(long), most=MOST)
    lift = kept.recording.needle_lift
    heights = [float(np.max(lift[event.start : event.end])) for event in kept.events]
    steps = np.diff(heights) / (heights[-1] - heights[0]) * (len(heights) - 1)
    assert np.all((steps > 0.5) & (steps < 1.5))
    assert heights[-1] / heights[0] > 1.4


def test_what_is_missing_is_counted_and_left_out_as_of_the_whole() -> None:
    long = RepeatedRecording(pair(), 60).collected()
    rail = long.rail_pressure.copy()
    (complete,) = measurements([long])
    for number in (7, 50, 51):
        first = complete.events[number].openings[0].first
        rail[first + 20 : first + 29] = np.nan
    long = replace(long, rail_pressure=rail)
    kept, (expected,) = measured(HeldSignals(long), most=MOST), measurements([long])
    assert [event.lack for event in kept.injections.left_out] == [Lack.GAP] * 3
    assert kept.injections.left_out == expected.injections.left_out
    summary, chosen, left_out = coverage(kept).splitlines()
    judged = len(kept.events)
    assert summary.endswith(f"27 missing, {judged} of 120 injections judged")
    assert chosen.startswith(f"  {judged} of 117 complete injections chosen")
    assert left_out.startswith("  left out, samples are missing in it or beside it: at 0.")
    assert [left_out] == coverage(expected).splitlines()[1:]


def test_memory_does_not_depend_on_length() -> None:
    def peak(times: int) -> int:
        tracemalloc.start()
        measured(RepeatedRecording(pair(), times), most=MOST)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    assert peak(300) < 1.1 * peak(60)


def test_a_long_one_without_injection_is_refused() -> None:
    shut = replace(pair(), needle_lift=np.zeros(PERIOD))
    with pytest.raises(UserError, match=r"repeated\.csv: no complete injection"):
        measured(RepeatedRecording(shut, 20), most=MOST)
