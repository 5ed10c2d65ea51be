"""The identification system of samples that are means: what it predicts, its slopes, its gain."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import lagged, recorded_mean
from observer_rt.engine.estimation.parameters import PARAMETERS, learned_of
from observer_rt.engine.estimation.predictor import (
    Setting,
    Window,
    gain_schedule,
    innovations,
    innovations_with_sensitivity,
)
from observer_rt.model.effective import averaged, coefficients
from observer_rt.model.stability import substeps_needed
from tests.differences import differences
from tests.engine.conftest import NOISE, SMOOTH, start_at_rest, worn_theta
from tests.engine.estimation.test_gain import steady_kalman
from tests.model.conftest import with_line

pytestmark = pytest.mark.slow  # compiles what only these tests call, or is a whole closed loop

SLOW = 20e3  # Hz
LAG = 25e-6  # s


def setting_for(model: str, late: float = 0.0, lag: float = 0.0) -> Setting:
    injector = with_line(load_injector(), model=model)
    c = averaged(coefficients(injector))
    gain = gain_schedule(c, NOISE, SLOW, lag, late).gains[-1].copy()
    return Setting(1 / SLOW, substeps_needed(injector, SLOW), c, gain, late=late, lag=lag)


def event(setting: Setting) -> Window:
    """An injection between sample times, with made-up pressures."""
    time = np.arange(80) / SLOW
    area = np.interp(time, [1.03e-3, 1.3e-3, 2.1e-3, 2.38e-3], [0.0, 0.9, 0.9, 0.0])
    knots = np.column_stack([np.full(80, 0.5), np.append(0.5 * (area[1:] + area[:-1]), 0.0)])
    output = 0.95 - 0.04 * area + np.random.default_rng(2).normal(0.0, 1e-3, 80)
    inputs, start = np.column_stack([np.full(80, 0.95), area]), start_at_rest(setting.coefficients, 0.95)
    return Window(inputs, output, time < 1e-3, start, 21, knots)


@pytest.mark.parametrize("model", ["lump", "wave"])
@pytest.mark.parametrize(("late", "lag"), [(0.0, 0.0), (0.4, LAG)])
def test_filtered_gradient_is_the_derivative(model: str, late: float, lag: float) -> None:
    setting = setting_for(model, late, lag)
    window, theta = event(setting), worn_theta()
    errors, slopes = np.empty(80), np.empty((80, PARAMETERS))
    innovations_with_sensitivity(window, setting, theta, errors, slopes)

    def innovations_of(moved: NDArray[np.float64]) -> NDArray[np.float64]:
        result = np.empty(80)
        innovations(window, setting, learned_of(moved, setting.coefficients), result)
        return result

    numeric = differences(innovations_of, theta, 1e-6)
    tolerance = 1e-5 * np.abs(numeric).max(axis=0) + 1e-8
    assert (np.abs(slopes - numeric).max(axis=0) < tolerance)[SMOOTH].all()


@pytest.mark.parametrize("fraction", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("lag", [0.0, 5e-6, 60e-6])
def test_mean_of_what_a_lagging_sensor_recorded_late_shows(fraction: float, lag: float) -> None:
    """Of a pressure that rises ever faster."""
    interval, fine = 1 / SLOW, 2000
    indicated = [1.0]
    pressure = 1.0 + 0.02 * np.arange(2 * fine + 1) / fine + 0.02 * (np.arange(2 * fine + 1) / fine) ** 2
    for before, after in pairwise(pressure.tolist()):
        indicated.append(lagged(indicated[-1], before, after, interval / fine, lag))
    curve = np.array(indicated)
    mean = float(np.mean(pressure[fine:-1] + pressure[fine + 1 :])) / 2
    shown = recorded_mean(curve[fine], curve[-1], mean, lag / interval, fraction)
    first = fine - round(fraction * fine)
    window = curve[first : first + fine + 1]
    expected = float(np.mean(window[:-1] + window[1:])) / 2
    assert shown == pytest.approx(expected, abs=1e-6 if fraction * lag == 0.0 else 1e-3)
    assert abs(curve[-1] - expected) > 5e-3  # the value at the end is something else


@pytest.mark.parametrize("lag", [0.0, LAG])
def test_steady_gain_solves_the_riccati_equation(lag: float) -> None:
    c = averaged(coefficients(load_injector()))
    schedule = gain_schedule(c, NOISE, SLOW, lag)
    gain, sigma = steady_kalman(c, NOISE, SLOW, lag, is_mean=True)
    np.testing.assert_allclose(schedule.gains[-1][:3], gain, rtol=0.02)
    assert schedule.innovation_sigma == pytest.approx(sigma, rel=2e-3)
    instant = gain_schedule(coefficients(load_injector()), NOISE, SLOW, lag).gains[-1]
    assert abs(instant[1] / gain[1] - 1.0) > 0.05  # the mean matters more than the tolerance
