"""True inputs and output of the predictor, for given input terms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.likelihood.measurement import Measurement, Rows, measurements
from observer_rt.identification.likelihood.true_inputs import TrueInputs
from observer_rt.identification.likelihood.windows import batch_of, phases
from observer_rt.model.effective import TRUE_INPUTS
from observer_rt.model.effects import effective_model, sized
from tests.identification.discovery.hidden import NOMINAL, recordings

C = effective_model(NOMINAL).coefficients
POINT = ((100e6, 1.0e-3),)


def _measurement(*, lift_offset: float = 0.0, noisy: bool = True) -> Measurement:
    effects = (sized("lift_offset", x_0=lift_offset),) if lift_offset else ()
    clean = recordings(effects, points=POINT, noise=None)
    if noisy:
        return measurements(recordings(effects, points=POINT))[0]
    rng = np.random.default_rng(1)
    for measurement in clean:  # a trace of noise, so that the noise can be measured
        measurement.line_pressure[:] += rng.normal(0.0, 1e3, measurement.samples)
        measurement.rail_pressure[:] += rng.normal(0.0, 1e3, measurement.samples)
    return measurements(clean)[0]


HEALTHY, BLIND = _measurement(noisy=False), _measurement(lift_offset=20e-6, noisy=False)
NOISY = _measurement()


def _opened(area: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Integral of the normalised seat area [samples], linear between samples, with negative areas counted as 0."""
    fine = np.interp(np.arange(0.0, area.size - 1, 0.01), np.arange(area.size), area)
    return float(np.maximum(fine, 0.0).sum()) * 0.01


def test_the_start_of_the_opening_that_a_lift_sensor_misses_is_restored() -> None:
    true = TrueInputs(HEALTHY, TRUE_INPUTS, C).area
    blind = TrueInputs(BLIND, TRUE_INPUTS, C).area
    restored = TrueInputs(BLIND, TRUE_INPUTS._replace(lift_shift=20e-6), C).area
    first = HEALTHY.events[0].openings[0].first
    foot = slice(first - 10, first + 3)
    missing = _opened(true[foot]) - _opened(blind[foot])
    assert missing > 0.05
    assert _opened(restored[foot]) == pytest.approx(_opened(true[foot]), abs=0.1 * missing)


def test_a_shut_needle_has_no_area_whatever_the_noise() -> None:
    area = TrueInputs(NOISY, TRUE_INPUTS, C).area
    shut = np.ones(area.size, np.bool_)
    for event in NOISY.events:
        for opening in event.openings:
            shut[opening.first - 1 : opening.last + 2] = False
    assert not area[shut].any()


@given(shift=st.floats(-10e-6, 30e-6))
def test_the_opened_area_has_no_jumps(shift: float) -> None:
    step = 1e-9
    here, ahead = (TrueInputs(NOISY, TRUE_INPUTS._replace(lift_shift=s), C).area for s in (shift, shift + step))
    opening = NOISY.events[0].openings[0]
    part = slice(opening.first - 10, opening.last + 10)
    samples = opening.last - opening.first + 20
    steepness = 5e3  # 1/m, of A_S/A_0 over the lift
    assert abs(_opened(ahead[part]) - _opened(here[part])) < 20.0 * samples * step * steepness


def test_the_rail_pressure_is_corrected() -> None:
    rail = TrueInputs(HEALTHY, TRUE_INPUTS._replace(rail_factor=1.02, rail_shift=-1e6), C).rail
    plain = TrueInputs(HEALTHY, TRUE_INPUTS, C).rail * C.pressure_scale + C.chamber_pressure
    assert rail == pytest.approx((1.02 * plain - 1e6 - C.chamber_pressure) / C.pressure_scale)


def test_a_late_rail_pressure_is_brought_back() -> None:
    ramp = replace(HEALTHY.recording, rail_pressure=1e8 + 1e10 * HEALTHY.recording.time)  # 10 MPa/ms
    late = replace(HEALTHY, recording=ramp)
    rail = TrueInputs(late, TRUE_INPUTS._replace(rail_delay=25e-6), C).rail
    inside = slice(25, -25)  # the ends of the recording are within the kernel's reach
    assert rail[inside] == pytest.approx(
        (1e8 + 1e10 * (ramp.time[inside] + 25e-6) - C.chamber_pressure) / 1e8, rel=1e-5
    )


def test_the_noise_of_a_rail_at_rest_is_not_moved() -> None:
    still, late = (TrueInputs(NOISY, TRUE_INPUTS._replace(rail_delay=d), C).rail for d in (0.0, 25e-6))
    assert np.array_equal(still, late)


def test_a_late_line_pressure_moves_the_inputs_and_not_the_output() -> None:
    rows = Rows(HEALTHY)
    inputs = TrueInputs(HEALTHY, TRUE_INPUTS, C)
    straight, late = (batch_of(HEALTHY, rows, inputs, n, 0.0, C) for n in (0, 3))
    assert np.array_equal(late.output, straight.output)
    inside = np.arange(100, straight.bounds[1] - 100)
    assert np.array_equal(late.inputs[inside + 3], straight.inputs[inside])
    assert late.openings[0] == straight.openings[0] + 3


def test_samples_of_all_phases_are_judged_from_the_first_that_counts() -> None:
    rows = Rows(HEALTHY)
    assert rows.samples[rows.counted].tolist() == [n for e in HEALTHY.events for n in range(e.counted, e.end)]
    batch = batch_of(HEALTHY, rows, TrueInputs(HEALTHY, TRUE_INPUTS, C), 0, 0.0, C)
    assert set(phases(HEALTHY, batch)) == set(Phase)
