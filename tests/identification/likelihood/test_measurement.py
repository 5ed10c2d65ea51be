"""Recordings as discovery sees them."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.desk.simulation.simulate import SimulatedNoise
from observer_rt.foundation.errors import UserError
from observer_rt.identification.likelihood.events import COUNTED_LEAD, RING_DOWN, Lack
from observer_rt.identification.likelihood.excerpts import every_second_point
from observer_rt.identification.likelihood.measurement import measurements
from tests.identification.discovery.hidden import recordings

POINT = ((100e6, 1.0e-3),)
(RECORDING,) = recordings(points=POINT)
(COMPLETE,) = measurements([RECORDING])


def test_noise_events_and_operating_point_are_found() -> None:
    (measurement,) = measurements(recordings(points=POINT, measured_rate=True))
    expected = SimulatedNoise()
    assert measurement.noise.rail_pressure == pytest.approx(expected.rail_pressure, rel=0.03)
    assert measurement.noise.line_pressure == pytest.approx(expected.line_pressure, rel=0.03)
    assert measurement.noise.needle_lift == pytest.approx(expected.needle_lift, rel=0.15)
    assert measurement.rate_noise == pytest.approx(expected.injection_rate, rel=0.03)
    assert measurement.rail_pressure == pytest.approx(100e6, rel=1e-3)
    assert measurement.duration == pytest.approx(1.283e-3, rel=0.03)  # delays and flanks of the needle
    assert len(measurement.events) == 2
    for event in measurement.events:
        opening = event.openings[0]
        assert opening.first - event.counted == round(COUNTED_LEAD * 100e3)
        assert event.end - opening.last == round(RING_DOWN * 100e3)


def test_a_lift_whose_zero_crosses_the_dead_band_is_named() -> None:
    raised = replace(RECORDING, needle_lift=RECORDING.needle_lift + 2.4e-6)
    words = r"shut needle is 2\.4 ± 0\.4 um, .* open above 2 um and as shut below 1 um(?s:.*)offset = -2\.4"
    with pytest.raises(UserError, match=words):
        measurements([raised])


def test_lift_noise_behind_a_filter_widens_the_dead_band() -> None:
    """Of a shut needle .8 ± .8 um: neither its zero nor its noise keeps it open."""
    noise = 1.6e-6 * np.random.default_rng(1).normal(size=RECORDING.samples)
    blurred = np.convolve(noise, [0.25, 0.5, 0.25], "same") + 0.8e-6
    (measurement,) = measurements([replace(RECORDING, needle_lift=RECORDING.needle_lift + blurred)])
    assert len(measurement.events) == 2
    assert measurement.noise.needle_lift == pytest.approx(1.0e-6, rel=0.2)


def test_pilot_and_main_are_one_event() -> None:
    lift = RECORDING.needle_lift.copy()
    pilot = np.flatnonzero(lift > 10e-6)[0] - 400  # 4 ms before the first injection
    lift[pilot : pilot + 30] = 40e-6
    (measurement,) = measurements([replace(RECORDING, needle_lift=lift)])
    assert [len(event.openings) for event in measurement.events] == [2, 1]


def test_an_event_with_missing_samples_is_left_out() -> None:
    line = RECORDING.line_pressure.copy()
    line[np.flatnonzero(RECORDING.needle_lift > 10e-6)[-1] + 200] = np.nan  # rings down after the second
    (measurement,) = measurements([replace(RECORDING, line_pressure=line)])
    assert len(measurement.events) == 1
    (left_out,) = measurement.injections.left_out
    assert left_out.lack is Lack.GAP
    assert left_out.time == RECORDING.time[COMPLETE.events[1].openings[0].first]
    assert COMPLETE.injections.left_out == ()


@pytest.mark.parametrize("position", [0, 1, 4, -1])
def test_a_sample_of_the_lift_missing_in_a_ramp_costs_that_event_only(position: int) -> None:
    lift = RECORDING.needle_lift.copy()
    opening = COMPLETE.events[0].openings[0]
    lift[(opening.first if position >= 0 else opening.last + 1) + position] = np.nan
    (measurement,) = measurements([replace(RECORDING, needle_lift=lift)])
    assert measurement.events == COMPLETE.events[1:]
    assert [event.lack for event in measurement.injections.left_out] == [Lack.GAP]


def test_an_event_cut_off_at_either_end_is_left_out() -> None:
    first, second = (event.openings[0] for event in COMPLETE.events)

    def between(start: int, end: int) -> list[Lack]:
        kept = {name: values[start:end] for name, values in RECORDING.signals.items()}
        (measurement,) = measurements([RECORDING.with_arrays({"time": RECORDING.time[: end - start], **kept})])
        assert len(measurement.events) == 1
        return [event.lack for event in measurement.injections.left_out]

    assert between(first.first - 100, RECORDING.samples) == [Lack.BEFORE]
    assert between(0, second.last + 100) == [Lack.AFTER]


def test_no_recording_one_without_injection_and_a_slow_one_are_refused() -> None:
    shut = replace(RECORDING, needle_lift=np.zeros(RECORDING.samples))
    slow = replace(RECORDING, **{name: getattr(RECORDING, name)[::20] for name in ("time", *RECORDING.signals)})
    for made, words in (([shut], "no complete injection"), ([slow], "ringing"), ([], "no recordings")):
        with pytest.raises(UserError, match=words):
            measurements(made)


def test_every_second_operating_point_like_the_squares_of_a_chessboard() -> None:
    points = ((140e6, 1.9e-3), (60e6, 0.6e-3), (60e6, 1.9e-3), (140e6, 0.6e-3), (60e6, 0.6e-3))
    fitted, held_out = every_second_point(measurements(recordings(points=points)))
    assert sorted(fitted) == [0, 1, 4]  # both of the first point, and the longest of the next pressure
    assert sorted(held_out) == [2, 3]
