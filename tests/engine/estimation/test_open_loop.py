"""The rate of x^ over an event: derivatives by parameters and by the state, and noise of the inputs through it."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.core.model.laws import seat_area_slope
from observer_rt.core.model.model import advance_state, phi_and_rate
from observer_rt.engine.estimation.parameters import NEEDLE_LAW, PARAMETERS, Parameter, learned_of
from observer_rt.engine.estimation.predictor import NoiseLevels, Window, input_variance, open_loop
from observer_rt.model.effective import LAG_UNIT
from tests.differences import assert_columns_agree, differences
from tests.engine.conftest import NOISE, SMOOTH, Case, event_inputs, simulated_event, with_time, worn_theta
from tests.intervals import Interval
from tests.plants.arrays import Array

HEALTHY = np.zeros(PARAMETERS)
VALVE = range(Parameter.CONTROL_START, Parameter.DISPLACEMENT)  # does nothing without flow
SENSOR = (Parameter.LINE_PRESSURE_OFFSET, Parameter.SENSOR_LAG, Parameter.LINE_PRESSURE_GAIN)

DRAWS = 300
SILENT = NoiseLevels(0.0, 0.0, 0.0)
INTERVAL = 1e-5  # s


def rate_of(case: Case, window: Window, theta: Array) -> tuple[Array, Array]:
    run = open_loop(window, case.setting, theta)
    return run.rate, run.slopes


def quiet_event(case: Case) -> Window:
    """An event before which x~ is at the truth whatever theta says: the needle opens with the second sample."""
    window = simulated_event(case, HEALTHY, event_inputs()[99:], seed=3)
    assert window.opening == 2
    return window._replace(opening=1)


def assert_slopes(case: Case, theta: Array, by_corners: float = 0.2) -> None:
    """Against differences of the rate, by every parameter."""
    window = quiet_event(case)
    _, slopes = rate_of(case, window, theta)
    expected = differences(lambda moved: rate_of(case, window, moved)[0], theta, 1e-5)
    assert_columns_agree(slopes[:, SMOOTH], expected[:, SMOOTH], 1e-6)
    move = np.eye(PARAMETERS)[Parameter.LIFT_DELAY] * 5e-6 / LAG_UNIT
    moved = rate_of(case, window, theta + move)[0] - rate_of(case, window, theta - move)[0]
    beyond_corner = slice(window.opening + 5, None)
    left = moved - slopes @ (2.0 * move)
    assert np.linalg.norm(left[beyond_corner]) < by_corners * np.linalg.norm(moved[beyond_corner])
    largest = np.abs(expected).max(axis=0)  # m3/s
    assert not largest[list(SENSOR)].any()  # x^ runs open loop
    assert np.delete(largest, [*SENSOR, *VALVE, *NEEDLE_LAW.columns]).min() > 1e-9


@pytest.mark.parametrize("theta", [HEALTHY, worn_theta()], ids=["healthy", "worn"])
def test_slopes_are_the_derivatives_of_the_rate(case: Case, theta: Array) -> None:
    assert_slopes(case, theta)


def test_slopes_with_effects_in_force(affected: Case) -> None:
    assert_slopes(affected, worn_theta(), by_corners=0.4)


def test_rate_is_that_of_the_observer_in_open_loop(case: Case) -> None:
    theta = worn_theta()
    window = quiet_event(case)
    rate, _ = rate_of(case, window, theta)
    learned = learned_of(theta, case.c)
    c = learned.coefficients
    x = window.start[:3].copy()
    inputs = with_time(window.inputs, case.setting.interval)
    expected = [0.0]
    for k in range(1, window.output.size):
        advance_state(x, Interval(inputs[k - 1], inputs[k], 1e-5, case.setting.substeps), c, learned.network, None)
        expected.append(phi_and_rate(x, inputs[k], c, learned.network)[1])
    assert max(expected) > 40e-6  # m3/s
    np.testing.assert_allclose(rate, expected, atol=1e-12 * max(expected))


def test_before_the_opening_there_is_no_rate_and_no_slope(case: Case) -> None:
    window = simulated_event(case, worn_theta(), event_inputs(), seed=3)
    rate, slopes = rate_of(case, window, worn_theta())
    assert not rate[: window.opening].any()
    assert not slopes[: window.opening, SMOOTH].any()
    assert not slopes[: window.opening - 1].any()
    assert rate[window.opening + 5] > 0.0


@pytest.mark.parametrize("row", range(2))
def test_transitions_carry_an_error_of_the_start(case: Case, row: int) -> None:
    """Of p_L or Q_L at the opening, into the rate of every later sample."""
    window, theta = quiet_event(case), worn_theta()
    run = open_loop(window, case.setting, theta)
    step = np.zeros(4)
    step[row] = 1e-6
    rates = [rate_of(case, window._replace(start=window.start + side * step), theta)[0] for side in (-1, 1)]
    numeric = (rates[1] - rates[0]) / 2e-6
    error = np.eye(3)[row]
    expected = np.zeros(window.output.size)
    for k in range(1, len(run.transition)):
        error = run.transition[k] @ error
        expected[k] = run.gradient[k, :3] @ error
    assert np.abs(numeric).max() > 1e-6  # m3/s
    np.testing.assert_allclose(expected, numeric, atol=1e-5 * np.abs(numeric).max())


def test_sac_goes_where_the_area_leads_it(case: Case) -> None:
    """A small step of the area at a constant opening, linear from one sample to the next."""
    inputs = np.tile([0.95, 0.4], (60, 1))
    window = quiet_event(case)._replace(inputs=inputs, output=np.zeros(60), resting=np.zeros(60, np.bool_))
    theta = worn_theta()
    run = open_loop(window, case.setting, theta)
    wider = inputs.copy()
    wider[41:, 1] += 1e-4
    change = open_loop(window._replace(inputs=wider), case.setting, theta).rate - run.rate
    assert 2e4 < run.relaxation[41] < 2e5  # 1/s
    constants = float(run.relaxation[41]) * 1e-5  # time constants in a sample
    first = 1.0 - (1.0 - np.exp(-constants)) / constants  # of a ramp, that a first-order lag has followed at its end
    by_sac = run.gradient[41, 2] * run.by_area[41] * first
    assert min(by_sac, run.gradient[41, 3]) > 1e-6  # m3/s, the sac's and the network's share both matter
    assert change[41] == pytest.approx(1e-4 * (by_sac + run.gradient[41, 3]), rel=0.03)


def noisy(case: Case, window: Window, noise: NoiseLevels, random: np.random.Generator) -> Window:
    """The window with other noise in its inputs, and in the output x~ follows up to the opening."""
    c = case.c
    inputs, n = window.inputs.copy(), window.output.size
    inputs[:, 0] += random.normal(0.0, noise.rail_pressure / c.pressure_scale, n)
    slope = np.array([seat_area_slope(float(a), c.seat) for a in inputs[:, 1]])
    inputs[:, 1] += slope / c.area_scale * random.normal(0.0, noise.needle_lift, n)
    output = window.output + random.normal(0.0, noise.line_pressure / c.pressure_scale, n)
    return window._replace(inputs=inputs, output=output)


@pytest.fixture(scope="module")
def event(nominal: Case) -> Window:
    """Opened and shut slowly, so that the lift matters for long."""
    inputs = event_inputs()
    time = np.arange(len(inputs)) * INTERVAL
    inputs[:, 1] = np.interp(time, [1.0e-3, 1.6e-3, 2.1e-3, 2.7e-3], [0.0, 0.8, 0.8, 0.0])
    return simulated_event(nominal, np.zeros_like(worn_theta()), inputs)


@pytest.mark.parametrize(
    ("noise", "tolerance"),
    [
        (replace(SILENT, rail_pressure=NOISE.rail_pressure, line_pressure=NOISE.line_pressure), 0.15),
        (replace(SILENT, needle_lift=NOISE.needle_lift), 0.2),
        (NOISE, 0.2),
    ],
    ids=["pressures", "lift", "all"],
)
def test_variances_are_those_of_draws(nominal: Case, event: Window, noise: NoiseLevels, tolerance: float) -> None:
    random = np.random.default_rng(4)
    theta = worn_theta()
    variance = input_variance(event, open_loop(event, nominal.setting, theta), nominal.setting, noise)
    rates = np.array(
        [open_loop(noisy(nominal, event, noise, random), nominal.setting, theta).rate for _ in range(DRAWS)]
    )
    assert rms(np.sqrt(variance.rate)) == pytest.approx(rms(rates.std(axis=0)), rel=tolerance)
    volumes = np.trapezoid(rates, axis=1) * INTERVAL
    assert np.sqrt(variance.volume[-1]) == pytest.approx(volumes.std(), rel=tolerance)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_nothing_is_uncertain_without_noise_nor_before_the_opening(nominal: Case, event: Window) -> None:
    run = open_loop(event, nominal.setting, worn_theta())
    for noise, certain in ((SILENT, slice(None)), (NOISE, slice(event.opening))):
        variance = input_variance(event, run, nominal.setting, noise)
        assert not variance.rate[certain].any()
        assert not variance.volume[certain].any()


def test_volume_is_counted_from_the_last_opening(nominal: Case) -> None:
    """Two equal shots, the line at rest between them: what the first left open is not counted again."""
    shot = event_inputs(samples=1200)
    shot[:, 1] += np.roll(shot[:, 1], 600)
    window = simulated_event(nominal, np.zeros_like(worn_theta()), shot)
    run = open_loop(window, nominal.setting, np.zeros_like(worn_theta()))
    volume = input_variance(window, run, nominal.setting, replace(SILENT, needle_lift=NOISE.needle_lift)).volume
    assert volume[600] > 0.0
    assert volume[-1] == pytest.approx(volume[600], rel=0.2)
