"""The cost of prediction-error learning: its gradient, its bounds, its robustness, its prior."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.estimation.posterior import Belief
from observer_rt.estimation.prediction_error import PredictionError, network_of
from observer_rt.estimation.predictor import Window, innovations, open_loop_error
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.network import HIDDEN, flow_changes
from tests.estimation.conftest import Case, event_inputs, simulated_event, worn_theta

BOUNDS = np.full(PARAMETERS, 0.8)
BURN_IN = 20
HEALTHY = np.zeros(PARAMETERS)


def prior() -> Belief:
    """A prior with correlations, away from 0."""
    root = np.random.default_rng(4).normal(size=(PARAMETERS, PARAMETERS))
    return Belief(0.05 * worn_theta(9), 0.01 * (root @ root.T + np.eye(PARAMETERS)))


def cost_of(case: Case, window: Window, burn_in: int = BURN_IN) -> PredictionError:
    return PredictionError(window, case.setting, case.schedule.innovation_sigma, prior(), BOUNDS, burn_in)


def spiked(window: Window) -> Window:
    """Every fortieth sample off by 20 sigma, where the cost is linear."""
    output = window.output.copy()
    output[25::40] += 0.03
    return window._replace(output=output)


@pytest.mark.parametrize("outliers", [False, True])
@pytest.mark.parametrize("theta", [HEALTHY, worn_theta()], ids=["healthy", "worn"])
def test_gradient_is_the_derivative(case: Case, theta: NDArray[np.float64], outliers: bool) -> None:
    window = simulated_event(case, worn_theta(7), event_inputs(), seed=3)
    cost = cost_of(case, spiked(window) if outliers else window)
    value, gradient = cost.value_and_gradient(theta)
    assert value == cost.value(theta)
    numeric = np.empty(PARAMETERS)
    for j in range(PARAMETERS):
        step = np.zeros(PARAMETERS)
        step[j] = 1e-6
        numeric[j] = (cost.value(theta + step) - cost.value(theta - step)) / 2e-6
    np.testing.assert_allclose(gradient, numeric, atol=1e-5 * np.abs(numeric).max())


def test_value_is_half_the_sum_of_squares_and_the_prior(nominal: Case) -> None:
    window = simulated_event(nominal, worn_theta(7), event_inputs(), seed=3)
    theta = worn_theta(7)
    e = np.empty(window.output.size)
    offset = float(theta[Parameter.LINE_PRESSURE_OFFSET])
    innovations(window, nominal.setting, network_of(theta), offset, e)
    z = e[BURN_IN:] / nominal.schedule.innovation_sigma
    assert np.abs(z).max() < 4.0  # nothing is robustified here
    away = theta - prior().mean
    expected = 0.5 * z @ z + 0.5 * away @ np.linalg.solve(prior().covariance, away)
    assert cost_of(nominal, window).value(theta) == pytest.approx(expected, rel=1e-9)


def test_outlier_counts_linearly(nominal: Case) -> None:
    """Ten sigma more beyond the fourth cost forty, not hundreds."""
    window = simulated_event(nominal, HEALTHY, event_inputs(), seed=None)
    last = window.output.size - 1
    sigma = nominal.schedule.innovation_sigma
    values = []
    for size in (20.0, 30.0):
        output = window.output.copy()
        output[last] += size * sigma
        values.append(cost_of(nominal, window._replace(output=output)).value(HEALTHY))
    assert values[1] - values[0] == pytest.approx(4.0 * 10.0, rel=1e-6)


def test_information_is_that_of_the_slopes_and_the_prior(nominal: Case) -> None:
    window = simulated_event(nominal, worn_theta(7), event_inputs(), seed=3)
    theta = worn_theta(7)
    jacobian = np.empty((window.output.size, PARAMETERS))
    for j in range(PARAMETERS):
        ends = []
        for side in (1e-5, -1e-5):
            moved = theta.copy()
            moved[j] += side
            e = np.empty(window.output.size)
            offset = float(moved[Parameter.LINE_PRESSURE_OFFSET])
            innovations(window, nominal.setting, network_of(moved), offset, e)
            ends.append(e)
        jacobian[:, j] = (ends[0] - ends[1]) / 2e-5
    weighted = jacobian[BURN_IN:] / nominal.schedule.innovation_sigma
    expected = weighted.T @ weighted + np.linalg.inv(prior().covariance)
    cost = cost_of(nominal, window)
    cost.value_and_gradient(theta)
    np.testing.assert_allclose(cost.information, expected, atol=1e-6 * np.abs(expected).max())


def test_first_samples_do_not_count(nominal: Case) -> None:
    window = simulated_event(nominal, HEALTHY, event_inputs(), seed=3)
    all_of_it = window.output.size
    away = HEALTHY - prior().mean
    prior_cost = 0.5 * away @ np.linalg.solve(prior().covariance, away)
    assert cost_of(nominal, window, all_of_it).value(HEALTHY) == pytest.approx(prior_cost)
    assert cost_of(nominal, window).value(HEALTHY) > prior_cost + 100


@pytest.mark.parametrize("parameter", range(PARAMETERS))
def test_beyond_the_bounds_the_cost_is_infinite(nominal: Case, parameter: int) -> None:
    cost = cost_of(nominal, simulated_event(nominal, HEALTHY, event_inputs()))
    for sign in (-1.0, 1.0):
        theta = np.zeros(PARAMETERS)
        theta[parameter] = sign * 0.8
        assert math.isfinite(cost.value(theta))
        theta[parameter] = sign * 0.8001
        assert cost.value(theta) == math.inf


def test_prediction_that_is_no_number_has_infinite_cost(nominal: Case) -> None:
    window = simulated_event(nominal, HEALTHY, event_inputs())
    output = window.output.copy()
    output[200] = np.nan
    cost = cost_of(nominal, window._replace(output=output))
    assert cost.value(HEALTHY) == math.inf
    assert cost.value_and_gradient(HEALTHY)[0] == math.inf


def test_singular_prior_is_refused(nominal: Case) -> None:
    window = simulated_event(nominal, HEALTHY, event_inputs())
    singular = Belief(HEALTHY, np.zeros((PARAMETERS, PARAMETERS)))
    with pytest.raises(np.linalg.LinAlgError):
        PredictionError(window, nominal.setting, 1e-3, singular, BOUNDS, 0)


def test_network_of_a_parameter_vector() -> None:
    """Every entry lands where its name says: b_H, w_1.. in the nozzle, b_S in the seat, o in neither."""
    x, u = (0.9, 1.0, 0.7), (0.95, 0.8)
    theta = np.zeros(PARAMETERS)
    theta[Parameter.NOZZLE_BIAS] = 0.2
    assert flow_changes(x, u, network_of(theta)) == (0.2, 0.0)
    theta[Parameter.SEAT_BIAS] = -0.1
    assert flow_changes(x, u, network_of(theta)) == (0.2, -0.1)
    theta[Parameter.LINE_PRESSURE_OFFSET] = 0.3
    assert flow_changes(x, u, network_of(theta)) == (0.2, -0.1)
    theta[Parameter.NOZZLE_WEIGHT + HIDDEN - 1] = 0.05
    nozzle, seat = flow_changes(x, u, network_of(theta))
    assert nozzle == pytest.approx(0.2 + 0.05 * math.tanh(4 * u[1] - 3.2))
    assert seat == -0.1


def test_open_loop_error_is_lowest_for_the_truth(case: Case) -> None:
    theta = worn_theta()
    window = simulated_event(case, theta, event_inputs())

    def error(of: NDArray[np.float64]) -> float:
        offset = float(of[Parameter.LINE_PRESSURE_OFFSET])
        return float(open_loop_error(window, case.setting, network_of(of), offset))

    assert error(theta) < 1e-20
    for parameter in range(PARAMETERS):
        wrong = theta.copy()
        wrong[parameter] += 0.05
        assert error(wrong) > 1e-5


def test_open_loop_error_leaves_the_time_before_the_opening_out(nominal: Case) -> None:
    """A disturbance that the predictor has corrected before the needle opens costs next to nothing."""
    window = simulated_event(nominal, HEALTHY, event_inputs())
    start = window.start.copy()
    start[0] += 0.01
    network = network_of(HEALTHY)
    disturbed = open_loop_error(window._replace(start=start), nominal.setting, network, 0.0)
    assert disturbed < 0.02 * 0.01**2 * window.output.size
