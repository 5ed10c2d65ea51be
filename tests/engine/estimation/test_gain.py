"""The gain of the identification system against a Riccati solver and against simulated noise."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, solve_discrete_are

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.parameters import PARAMETERS, Parameter
from observer_rt.engine.estimation.predictor import NoiseLevels, Window, gain_schedule
from observer_rt.model.effective import Coefficients, averaged, coefficients
from tests.engine.conftest import NOISE, SAMPLE_RATE, Case, event_inputs, innovations_at, simulated_event, worn_theta
from tests.model.conftest import with_line
from tests.plants.arrays import Array

HEALTHY = np.zeros(PARAMETERS)


def steady_kalman(
    c: Coefficients, noise: NoiseLevels, sample_rate: float, lag: float, late: float = 0.0, is_mean: bool = False
) -> tuple[Array, float]:
    """Gain (3,) and innovation sigma by matrix exponentials and the algebraic Riccati equation.

    States p_L, Q_L, indication (p_L is a ramp), and the recorded one: a share `late` of a sample late, or a mean.
    """
    interval = 1.0 / sample_rate
    rates = np.zeros((4, 4))  # p_L, Q_L, integral of p_L, rail
    rates[0, 1], rates[1, 0], rates[1, 3], rates[2, 0] = c.line.a1, -c.line.a3, c.line.a3, 1.0
    line = expm(rates * interval)
    by_start, by_end, by_shown = seen_by_sensor(lag, interval)
    rows = np.zeros((4, 5))  # from p_L, Q_L, indicated, recorded, rail
    rows[:2, [0, 1, 4]] = line[:2][:, [0, 1, 3]]
    rows[2] = by_end * rows[0] + [by_start, 0.0, by_shown, 0.0, 0.0]
    if is_mean:
        rows[3, [0, 1, 4]] = line[2, [0, 1, 3]] / interval
        late = lag / interval
        rows[3] -= late * rows[2]
    else:
        rows[3] = (1 - late) * rows[2]
    rows[3, 2] += late
    return riccati(rows[:, :4], rows[:, 4], c, noise)


def seen_by_sensor(lag: float, interval: float) -> tuple[float, float, float]:
    """Shares of the pressure at the start and the end of an interval, and of the indication before, in that after."""
    slowness = max(lag, 1e-3 * interval)
    ramp = expm(np.array([[-1.0, 1.0, 0.0], [0.0, 0.0, slowness], [0.0, 0.0, 0.0]]) * interval / slowness)[0]
    return ramp[1] - ramp[2] / interval, ramp[2] / interval, ramp[0]


def riccati(transition: Array, rail: Array, c: Coefficients, noise: NoiseLevels) -> tuple[Array, float]:
    """Steady gain (3,) of four states, the last measured, that the rail's noise drives; and innovation sigma."""
    process = np.outer(rail, rail) * (noise.rail_pressure / c.pressure_scale) ** 2
    measurement = np.array([[(noise.line_pressure / c.pressure_scale) ** 2]])
    covariance = solve_discrete_are(transition.T, np.array([[0.0, 0.0, 0.0, 1.0]]).T, process, measurement)
    variance = covariance[3, 3] + measurement[0, 0]
    return covariance[:3, 3] / variance, math.sqrt(variance)


@pytest.mark.parametrize("sample_rate", [20e3, 50e3, 100e3])
@pytest.mark.parametrize(
    ("rail_noise", "every", "lag", "late"),
    [
        *product((0.05e6, 0.1e6, 0.5e6), (1.0,), (0.0, 10e-6, 40e-6), (0.0,)),
        *product((0.1e6,), (20.0,), (0.0, 10e-6, 40e-6), (0.0,)),
        *product((0.1e6,), (1.0,), (0.0, 40e-6), (0.3, 0.9)),
    ],
)
def test_steady_gain_solves_the_riccati_equation(
    nominal: Case, sample_rate: float, rail_noise: float, every: float, lag: float, late: float
) -> None:
    """every: samples to one of the rail pressure, whose noise drives the line by so many times the power."""
    noise = NoiseLevels(rail_noise, 0.15e6, 0.4e-6)
    schedule = gain_schedule(nominal.c, noise, sample_rate, lag, late, rail_every=every)
    driving = replace(noise, rail_pressure=math.sqrt(every) * rail_noise)
    gain, sigma = steady_kalman(nominal.c, driving, sample_rate, lag, late)
    np.testing.assert_allclose(schedule.gains[-1], gain, rtol=0.02)
    assert schedule.innovation_sigma == pytest.approx(sigma, rel=2e-3)


def test_first_gain_trusts_the_measurement_where_the_start_is_unknown(nominal: Case) -> None:
    """Q_L is unknown by 10 mm3/ms at the start: its gain falls by far more than that of p_L, known as y."""
    gains = nominal.schedule.gains
    assert gains[:, 1].max() > 3 * gains[-1, 1]
    assert (gains[:, 0] > 0.0).all()
    assert (gains[:, 0] < 1.0).all()


def test_start_in_a_ringing_line_is_good_after_a_millisecond(nominal: Case) -> None:
    """From p_L = y and Q_L = 0 in a line that swings by 10 mm3/ms: then within five steady sigmas of x~."""
    c, setting = nominal.c, nominal.setting
    angle = c.line.mode * (np.arange(300) / SAMPLE_RATE)
    flow = 1e-5 / c.flow_scale
    line = 0.95 + flow * c.line.impedance * np.sin(angle)
    random = np.random.default_rng(5)
    output = line + random.normal(0.0, NOISE.line_pressure / c.pressure_scale, line.size)
    x = np.array([output[0], 0.0, 0.0])
    for k in range(1, 101):
        start = np.append(x, x[0])
        pair = Window(np.array([[0.95, 0.0]] * 2), output[k - 1 : k + 1], np.ones(2, np.bool_), start, opening=2)
        gain = nominal.schedule.gains[min(k - 1, len(nominal.schedule.gains) - 1)]
        error = innovations_at(replace(nominal, setting=setting._replace(gain=gain)), pair, HEALTHY)
        predicted = output[k] - error[1]
        x = _free_line(c, x)
        assert x[0] == pytest.approx(predicted, abs=1e-4)
        x = x + np.array([gain[0], gain[1], 0.0]) * error[1]
    assert abs(x[0] - line[100]) < nominal.schedule.innovation_sigma
    assert abs(x[1] - flow * math.cos(angle[100])) < 2e-6 / c.flow_scale


def _free_line(c: Coefficients, x: Array) -> Array:
    """A shut line one sample later, its friction by one Euler step."""
    moved = expm(np.array([[0.0, c.line.a1], [-c.line.a3, 0.0]]) / SAMPLE_RATE) @ np.array([x[0] - 0.95, x[1]])
    friction = c.line.a4 * x[1] * abs(x[1]) / SAMPLE_RATE
    return np.array([moved[0] + 0.95, moved[1] - friction, 0.0])


def test_innovations_of_injections_are_white_with_the_true_wear(case: Case) -> None:
    """Wear, line terms, lag and offset at once, and the gain that belongs to them."""
    theta = worn_theta()
    tuned = case.tuned_to(theta)
    pieces = []
    for seed in range(40):
        window = simulated_event(case, theta, event_inputs(rail=0.4 + 0.03 * seed), seed=seed)
        pieces.append(innovations_at(tuned, window, theta)[50:])
    e, sigma = np.concatenate(pieces), tuned.schedule.innovation_sigma
    assert e.std() == pytest.approx(sigma, rel=0.03)
    assert abs(e.mean()) < 0.03 * sigma
    correlations = [np.corrcoef(e[lag:], e[:-lag])[0, 1] for lag in (1, 2, 3, 5, 8, 20, 80)]
    assert np.abs(correlations).max() < 0.03


@pytest.mark.parametrize(
    "parameter",
    [Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS, Parameter.BULK_MODULUS, Parameter.SENSOR_LAG],
    ids=lambda parameter: parameter.name,
)
def test_wrong_parameter_colours_the_innovations(nominal: Case, parameter: Parameter) -> None:
    """So that the tests above can fail."""
    theta = worn_theta()
    theta[parameter] = 0.0
    window = simulated_event(nominal, worn_theta(), event_inputs(), seed=1)
    result = innovations_at(nominal.tuned_to(theta), window, theta)
    assert np.corrcoef(result[51:], result[50:-1])[0, 1] > 0.2


@settings(max_examples=20)
@given(
    st.sampled_from(["lump", "wave"]),
    st.sampled_from([1e4, 1e5, 5e5, 2e6]),
    st.floats(5e3, 1e6),
    st.floats(5e3, 1e6),
    st.floats(0.0, 40e-6),
    st.floats(0.0, 0.9),
    st.sampled_from([0.0, 50e-6]),
)
def test_gain_of_means_lasts_at_every_sample_rate_and_noise(
    model: str, rate: float, rail: float, line: float, lag: float, late: float, smoothing: float
) -> None:
    """Rounding once let the covariance grow less and less symmetric, until a variance was negative."""
    c = averaged(coefficients(with_line(load_injector(), model=model)))
    schedule = gain_schedule(c, NoiseLevels(rail, line, 0.4e-6), rate, lag, late, rail_smoothing=smoothing)
    assert np.isfinite(schedule.gains).all()
    assert schedule.innovation_sigma >= 0.999 * line / c.pressure_scale
