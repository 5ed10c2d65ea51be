"""The rate of x^ and its derivatives over an event."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.estimation.learned import learned_of
from observer_rt.estimation.open_loop import rate_with_sensitivity
from observer_rt.estimation.predictor import Window
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.coefficients import with_line_terms
from observer_rt.model.integrator import advance
from observer_rt.model.right_hand_side import injection_rate
from tests.estimation.conftest import Case, event_inputs, simulated_event, worn_theta

HEALTHY = np.zeros(PARAMETERS)
SENSOR = (Parameter.LINE_PRESSURE_OFFSET, Parameter.SENSOR_LAG)


def rate_of(
    case: Case, window: Window, theta: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rate = np.empty(window.output.size)
    slopes = np.empty((window.output.size, PARAMETERS))
    rate_with_sensitivity(window, case.setting, learned_of(theta), rate, slopes)
    return rate, slopes


def quiet_event(case: Case) -> Window:
    """An event before which x~ is at the truth whatever theta says: the needle opens with the second sample."""
    inputs = event_inputs()[99:]
    window = simulated_event(case, HEALTHY, inputs, seed=3)
    assert window.opening == 2
    return window._replace(opening=1)


@pytest.mark.parametrize("theta", [HEALTHY, worn_theta()], ids=["healthy", "worn"])
@pytest.mark.parametrize("parameter", range(PARAMETERS))
def test_slopes_are_the_derivatives_of_the_rate(
    case: Case, theta: NDArray[np.float64], parameter: int
) -> None:
    window = quiet_event(case)
    _, slopes = rate_of(case, window, theta)
    step = np.zeros(PARAMETERS)
    step[parameter] = 1e-5
    numeric = (rate_of(case, window, theta + step)[0] - rate_of(case, window, theta - step)[0]) / 2e-5
    largest = np.abs(numeric).max()
    if parameter in SENSOR:
        assert largest == 0.0  # x^ runs open loop
        assert not slopes[:, parameter].any()
    else:
        assert largest > 1e-9  # m3/s
        np.testing.assert_allclose(slopes[:, parameter], numeric, atol=1e-6 * largest)


@pytest.mark.parametrize("parameter", [p for p in range(PARAMETERS) if p not in SENSOR])
def test_slopes_with_effects_in_force(affected: Case, parameter: int) -> None:
    window = quiet_event(affected)
    theta = worn_theta()
    _, slopes = rate_of(affected, window, theta)
    step = np.zeros(PARAMETERS)
    step[parameter] = 1e-5
    ahead, behind = (rate_of(affected, window, theta + sign * step)[0] for sign in (1, -1))
    numeric = (ahead - behind) / 2e-5
    np.testing.assert_allclose(slopes[:, parameter], numeric, atol=1e-6 * np.abs(numeric).max())


def test_rate_is_that_of_the_observer_in_open_loop(case: Case) -> None:
    theta = worn_theta()
    window = quiet_event(case)
    rate, _ = rate_of(case, window, theta)
    learned = learned_of(theta)
    c = with_line_terms(case.c, learned.line)
    x = (float(window.start[0]), float(window.start[1]), float(window.start[2]))
    inputs = [(float(rail), float(area)) for rail, area in window.inputs]
    expected = [0.0]
    for k in range(1, window.output.size):
        x = advance(x, inputs[k - 1], inputs[k], 1e-5, case.setting.substeps, c, learned.network)
        expected.append(injection_rate(x, inputs[k], c, learned.network))
    assert max(expected) > 40e-6  # m3/s
    np.testing.assert_allclose(rate, expected, atol=1e-12 * max(expected))


def test_before_the_opening_there_is_no_rate_and_no_slope(case: Case) -> None:
    window = simulated_event(case, worn_theta(), event_inputs(), seed=3)
    rate, slopes = rate_of(case, window, worn_theta())
    assert not rate[: window.opening].any()
    assert not slopes[: window.opening].any()
    assert rate[window.opening + 5] > 0.0


def test_line_pressure_after_the_opening_does_not_matter(case: Case) -> None:
    window = simulated_event(case, worn_theta(), event_inputs(), seed=3)
    output = window.output.copy()
    output[window.opening :] += 0.05
    for one, other in zip(
        rate_of(case, window, worn_theta()),
        rate_of(case, window._replace(output=output), worn_theta()),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)
