"""One event fitted from a prior: Gauss-Newton on the prediction error, gated scalars chosen anew in every step."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.gating import inverse_of
from observer_rt.engine.estimation.gating import Belief, Gate, best_subset
from observer_rt.engine.estimation.prediction_error import EventCost, Linearisation
from observer_rt.engine.estimation.scalars import SCALARS, Parameter
from observer_rt.model.effective import Coefficients

HALVINGS = 4  # of a step that does not lower the cost
TOLERANCE = 0.02  # a step that lowers the cost by less, in units of chi2 / 2, is the last
AGREEMENT = 0.05  # of expected and actual cost [chi2 / 2]: within it a linearisation is not repeated


@dataclass(frozen=True, eq=False)
class Limits:
    """Lowest and highest theta (m,), its longest step in an iteration (m,), and the gate of its scalars."""

    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]
    longest_step: NDArray[np.float64]
    gate: Gate = SCALARS.gate


def theta_limits(c: Coefficients) -> Limits:
    """Limits of theta (m,) for a model; a pilot valve may lose all of its flow, but not more."""
    lowest, highest = SCALARS.bounds(c.pressure_scale)
    lowest[Parameter.CONTROL_FLOW] = -c.line.servo / c.line.a1
    gate = SCALARS.gate.replaced(Parameter.CONTROL_FLOW, float(lowest[Parameter.CONTROL_FLOW]))
    return Limits(lowest, highest, SCALARS.longest_step(c.pressure_scale), gate)


def freed(
    direction: NDArray[np.float64], slopes: NDArray[np.float64], prior: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Part of a direction (k,) of innovations that theta cannot explain, and the change of theta (m,) for the rest.

    slopes: (k, m) by theta; prior: standard deviations (m,) of theta. Raises numpy.linalg.LinAlgError when singular.
    """
    information = slopes.T @ slopes + np.diag(prior**-2)
    change = np.asarray(-np.linalg.solve(information, slopes.T @ direction), np.float64)
    return direction + slopes @ change, change


@dataclass(frozen=True)
class EventFit:
    """One event fitted: the active columns, the cost round the estimate, its prior.

    innovations: at the estimate (n,), unfiltered: with the colour of the noise; slopes: where it was last linearised
    (n, m).
    """

    active: frozenset[int]
    linearisation: Linearisation
    innovations: NDArray[np.float64]
    unfiltered: NDArray[np.float64]
    slopes: NDArray[np.float64]
    prior: Belief


@dataclass(frozen=True)
class EventFitter:
    """Fits one event from any prior; active: the gated columns in use."""

    cost: EventCost
    active: frozenset[int]
    limits: Limits

    def fit(self, start: Linearisation, prior: Belief, iterations: int) -> EventFit:
        """Minimise cost and distance from the prior, at most so many steps from `start`.

        A step that lowers the total as its linearisation says is the last: there is nothing to be learned from
        repeating it. One that does not lower it is halved. Raises numpy.linalg.LinAlgError when singular.
        """
        prior_information = prior.information
        prior_vector = prior_information @ prior.mean

        def total(theta: NDArray[np.float64], value: float) -> float:
            distance = theta - prior.mean
            return value + 0.5 * float(distance @ prior_information @ distance)

        here, active = start, self.active
        here_total = total(here.theta, here.value)
        for _ in range(iterations):
            covariance, _ = inverse_of(prior_information + here.information)
            joint = covariance @ (prior_vector + here.vector)
            best, active = best_subset(joint, covariance, self.limits.gate, active)
            target = self._within_reach(here.theta, best)
            value = self.cost.value(target)
            as_expected = abs(value - here.expected(target)) < AGREEMENT
            if as_expected and total(target, value) <= here_total:
                here = here.moved(target, value)
                break
            ahead = self.cost.linearised(target)
            for _ in range(HALVINGS):
                if total(ahead.theta, ahead.value) < here_total:
                    break
                ahead = self.cost.linearised(0.5 * (here.theta + ahead.theta))
            before = here_total
            here, here_total = ahead, total(ahead.theta, ahead.value)
            if abs(before - here_total) < TOLERANCE:
                break
        cost = self.cost
        return EventFit(active, here, cost.innovations, cost.unfiltered, cost.slopes, prior)

    def _within_reach(self, here: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
        """The target, or the point towards it up to which the slopes hold; within bounds."""
        length = np.max(np.abs(target - here) / self.limits.longest_step)
        reached = here + (target - here) / max(1.0, float(length))
        return np.asarray(np.clip(reached, self.limits.lowest, self.limits.highest), np.float64)
