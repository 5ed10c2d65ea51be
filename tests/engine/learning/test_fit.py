"""An event fitted from a prior."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.belief import prior_belief
from observer_rt.engine.estimation.parameters import EVERY, PARAMETERS, Parameter, Theta
from observer_rt.engine.learning.fit import EventFitter, evidence_of, theta_limits
from observer_rt.engine.learning.run import EventCost, EventRun
from tests.engine.conftest import make_case


class CostOfOne(EventCost):
    """A cost by one column of theta, whose slope, and information of 1, are said to be the same everywhere."""

    def __init__(self, column: int, cost: Callable[[float], float], slope: float) -> None:
        vars(self).update(column=int(column), cost=cost, slope=slope * np.eye(PARAMETERS)[column])

    def linearised(self, theta: Theta, near: EventRun | None = None) -> EventRun:
        column: int = vars(self)["column"]
        value, information = vars(self)["cost"](float(theta[column])), np.diag(np.eye(PARAMETERS)[column])
        return EventRun(theta, value, vars(self)["slope"], information, theta[[column]])

    def at(self, theta: Theta, near: EventRun) -> EventRun:
        return replace(self.linearised(theta), gradient=near.gradient + near.information @ (theta - near.theta))


@pytest.mark.parametrize(
    ("column", "cost", "slope", "start", "end", "stuck"),
    [
        (Parameter.NOZZLE_BIAS, lambda size: 100.0 * abs(size - 0.1) ** 0.5, -1.0, 0.1, 0.1, True),  # beside a cusp
        (
            Parameter.NOZZLE_BIAS,
            lambda size: 100.0 * abs(size - 0.1) ** 0.5,
            -0.1,
            0.1,
            0.1,
            False,
        ),  # by next to nothing
        (Parameter.NOZZLE_BIAS, lambda size: -1.3 * size, -1.0, 0.0, 1.5, False),  # lower than slopes say: on it goes
        (Parameter.SENSOR_LAG, lambda size: 0.5 * (size - 0.5) ** 2, 0.0, 0.5, 0.0, False),  # a scalar is left out
        (Parameter.SENSOR_LAG, lambda size: 0.5 * (size - 4.0) ** 2, 0.0, 4.0, 4.0, False),  # one that pays is not
    ],
)
def test_a_step_that_lowers_nothing_is_not_taken_unless_a_scalar_does_not_pay(
    column: Parameter, cost: Callable[[float], float], slope: float, start: float, end: float, stuck: bool
) -> None:
    event, wide = CostOfOne(column, cost, slope), prior_belief(np.zeros(PARAMETERS), 1e4 * np.eye(PARAMETERS))
    active, limits = frozenset({int(Parameter.SENSOR_LAG)}), theta_limits(make_case(load_injector()).c)
    fit = EventFitter(event, active, limits).fit(event.linearised(start * np.eye(PARAMETERS)[column]), wide, 8)
    assert fit.stuck is stuck
    assert fit.run.theta[column] == fit.run.innovations[0] == pytest.approx(end, abs=2e-3)
    if stuck:  # what the slopes promise is not believed
        assert evidence_of(fit.run, wide, limits, EVERY).theta[column] == pytest.approx(end)
