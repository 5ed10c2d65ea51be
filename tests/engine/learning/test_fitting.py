"""An event fitted from a prior."""

import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.belief import prior_belief
from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.scalars import PARAMETERS
from observer_rt.engine.learning.fitting import EventFitter, theta_limits
from tests.engine.estimation.conftest import event_inputs, make_case, simulated_event, worn_theta


def test_delays_of_shots_are_those_of_a_fit_whatever_followed_the_event_before() -> None:
    injector, theta = load_injector(), np.zeros(PARAMETERS)
    case = make_case(injector)
    window = simulated_event(case, theta, event_inputs(), seed=3)
    window = window._replace(needle=injector.needle_law, commands=np.array([[69.0, 192.0]]))
    cost = EventCost(window, case.setting, 1.5e-3, 20)
    start = [cost.linearised(theta) for _ in range(3)][-1]
    cost.linearised(0.1 * worn_theta())  # the fit of another kind of event
    for _ in range(3):
        cost.value(theta)
    prior = prior_belief(theta, 1e-12 * np.eye(PARAMETERS))
    fit = EventFitter(cost, frozenset(), theta_limits(case.c)).fit(start, prior, 1)
    assert fit.delays is not None
    np.testing.assert_allclose(fit.delays.theta, fit.linearisation.theta, atol=1e-3)
