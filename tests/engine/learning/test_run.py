"""The cost of prediction-error learning: its gradient, its robustness; what theta means; x^ re-simulated."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.core.learning.whitening import robust_cost
from observer_rt.engine.estimation.parameters import PARAMETERS, VALVE_LAW, WEIGHTS, Parameter, learned_of, network_of
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.run import EventCost, EventRun
from observer_rt.model.effective import coefficients
from observer_rt.model.line import stiffened
from tests.differences import differences
from tests.engine import conftest
from tests.engine.conftest import Case, event_inputs, simulated_event

BURN_IN = 20
HEALTHY = np.zeros(PARAMETERS)
VALVE = np.isin(np.arange(PARAMETERS), VALVE_LAW.columns)
SIGMA = 1.5e-3  # of p_0: what the predictor's innovations have at 100 kHz


def cost_of(case: Case, window: Window, burn_in: int = BURN_IN) -> EventCost:
    return EventCost(window, case.setting, SIGMA, burn_in)


def spiked(window: Window) -> Window:
    """Every fortieth sample off by 20 sigma, where the cost is linear."""
    output = window.output.copy()
    output[25::40] += 0.03
    return window._replace(output=output)


@pytest.mark.parametrize("outliers", [False, True])
@pytest.mark.parametrize("theta", [HEALTHY, conftest.worn_theta()], ids=["healthy", "worn"])
def test_gradient_is_the_derivative(case: Case, theta: NDArray[np.float64], outliers: bool) -> None:
    window = simulated_event(case, conftest.worn_theta(7), event_inputs(), seed=3)
    cost = cost_of(case, spiked(window) if outliers else window)
    linearised = cost.linearised(theta)
    assert linearised.value == cost.at(theta, linearised).value
    numeric = differences(lambda moved: cost.at(moved, linearised).value, theta, 1e-6)
    smooth, slopes = numeric[conftest.SMOOTH], linearised.gradient[conftest.SMOOTH]
    np.testing.assert_allclose(slopes, smooth, atol=1e-5 * np.abs(smooth).max())


def test_gauss_newton_finds_the_truth_without_noise(nominal: Case) -> None:
    """All parameters at once but the weights, which a wide prior hardly holds; a valve without flow says nothing."""
    truth, columns = conftest.worn_theta(), np.delete(np.arange(PARAMETERS), [*WEIGHTS, Parameter.LIFT_DELAY])
    truth[WEIGHTS] = 0.0
    events = [simulated_event(nominal, truth, event_inputs(rail=rail)) for rail in (0.45, 0.95, 1.55)]
    theta = HEALTHY.copy()
    for _ in range(12):
        parts = [cost_of(nominal, event).linearised(theta) for event in events]
        information = sum(part.information for part in parts) + np.diag(np.where(VALVE, 1e9, 1e-6))
        gradient = np.sum([part.gradient for part in parts], axis=0)
        theta[columns] -= np.linalg.solve(information[np.ix_(columns, columns)], gradient[columns])
    np.testing.assert_allclose(theta, truth, atol=1e-4)


def test_prediction_that_is_no_number_has_infinite_cost(nominal: Case) -> None:
    window = simulated_event(nominal, HEALTHY, event_inputs())
    output = window.output.copy()
    output[200] = np.nan
    cost = cost_of(nominal, window._replace(output=output))
    run = cost.linearised(HEALTHY)
    assert run.value == cost.at(HEALTHY, run).value == math.inf


def test_meaning_of_a_parameter_vector() -> None:
    """Every entry lands where its name says, and nowhere else."""
    x, u = (0.9, 1.0, 0.7), (0.95, 0.8)
    theta = np.zeros(PARAMETERS)
    theta[Parameter.LINE_PRESSURE_OFFSET] = 0.3
    theta[Parameter.LINE_FRICTION] = 2.0
    theta[Parameter.GUIDE_LEAKAGE] = 0.04
    theta[Parameter.BULK_MODULUS] = -0.1
    theta[Parameter.SENSOR_LAG] = 0.4
    theta[Parameter.ENTRAINED_AIR] = 0.05
    c = coefficients(load_injector())
    learned = learned_of(theta, c)
    softer = stiffened(c.line, -0.1)
    changed = softer._replace(a4=3.0 * c.line.a4, leak=c.line.leak + 0.04 * softer.a1, air=c.line.air + 0.05)
    assert learned.coefficients == c._replace(line=changed)
    assert learned.offset == 0.3
    assert learned.sensor[0] == pytest.approx(40e-6)
    assert conftest.changes_of_flows(x, u, learned.network) == (0.0, 0.0)
    theta[Parameter.NOZZLE_BIAS] = 0.2
    assert conftest.changes_of_flows(x, u, network_of(theta)) == pytest.approx((0.2, 0.0))
    theta[Parameter.SEAT_BIAS] = -0.1
    assert conftest.changes_of_flows(x, u, network_of(theta)) == pytest.approx((0.2, -0.1))
    theta[Parameter.NOZZLE_WEIGHT] = 0.05  # of the pressure drop, the centres .16 p_0 apart
    nozzle, seat = conftest.changes_of_flows(x, u, network_of(theta))
    assert nozzle == pytest.approx(0.2 + 0.05 * math.tanh((x[2] - 0.1) / (0.7 * 0.16)), abs=1e-5)
    assert seat == pytest.approx(-0.1)


@pytest.mark.parametrize("together", [1, 3, 5])
def test_samples_that_count_together_count_by_their_mean(together: int) -> None:
    """In units of the mean's own standard deviation; one that is left over at the end does not count."""
    e = np.random.default_rng(5).normal(0.0, 3.0 * SIGMA, 10 + 7 * together + together - 1)
    z = np.abs(e[10 : 10 + 7 * together].reshape(7, together).mean(axis=1)) / (SIGMA / math.sqrt(together))
    expected = np.where(z <= 4.0, 0.5 * z**2, 4.0 * (z - 2.0)).sum()
    assert robust_cost(e, 10, SIGMA, together) == pytest.approx(expected, rel=1e-12)


def test_what_an_event_cannot_tell_apart_is_no_singularity() -> None:
    """Two columns that do the same count as one, one that does nothing as none."""
    slopes = np.random.default_rng(3).normal(size=(200, 4))
    slopes[:, 2], slopes[:, 3] = -2.0 * slopes[:, 1], 0.0
    information, prior = slopes.T @ slopes, np.diag([0.1, 0.2, 1e-9, 0.3])
    gradient = slopes.T @ np.random.default_rng(4).normal(size=200)
    score = EventRun(np.zeros(4), 0.0, gradient, information).score(prior)
    both = np.ix_([0, 1], [0, 1])
    spread = information[both] + information[both] @ prior[both] @ information[both]
    chi2 = float(gradient[:2] @ np.linalg.solve(spread, gradient[:2]))
    assert score == pytest.approx(chi2 / 2.0, rel=0.02)
