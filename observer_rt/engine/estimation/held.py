"""A belief in which one parameter is held at a value found elsewhere, and considered: Schmidt's filter.

Schmidt, Application of state-space methods to navigation problems, 1966: an event teaches nothing of the held
parameter, and all else is as uncertain by it as it depends on it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief, conditioned, symmetric

_EXACTLY = 1e-14  # variance of what is held
_NOWHERE = np.empty(0)


@dataclass(frozen=True, eq=False)
class HeldBelief:
    """A belief before an event, given the value of a column; column None: nothing is held.

    by: change (m,) of theta with the held value, (0,) without any; variance: of that; log: nats by which the value is
    less likely than the belief alone makes the event.
    """

    prior: Belief
    column: int | None
    by: NDArray[np.float64]
    variance: float = 0.0
    log: float = 0.0

    def considered(self, after: Belief, information: NDArray[np.float64]) -> Belief:
        """The belief after an event, by its `information` (m, m), where `after` is what it makes of the prior."""
        if self.column is None:
            return after
        toward = self.prior.information @ _but(self.by, self.column) - information[:, self.column]
        moves = after.covariance @ _but(toward, self.column)
        moves[self.column] = 1.0
        more = self.variance * np.outer(moves, moves)
        return Belief(
            after.mean, symmetric(after.covariance + more), symmetric(after.error_covariance + more)
        )


def nothing_held(belief: Belief) -> HeldBelief:
    """A belief that is learned with as it is."""
    return HeldBelief(belief, None, _NOWHERE)


def held_at(belief: Belief, column: int, value: float, variance: float) -> HeldBelief:
    """A belief with a column at a value, known with a variance that includes what the belief knows of it."""
    own = float(belief.covariance[column, column])
    by = belief.covariance[:, column] / own
    away = value - float(belief.mean[column])
    parts = []
    for matrix in (belief.covariance, belief.error_covariance):
        part = symmetric(conditioned(matrix, column, column))
        part[column, :] = part[:, column] = 0.0
        part[column, column] = _EXACTLY
        parts.append(part)
    log = 0.5 * math.log(variance / own) - 0.5 * away**2 / own
    return HeldBelief(Belief(belief.mean + by * away, *parts), column, by, variance, log)


def _but(values: NDArray[np.float64], column: int) -> NDArray[np.float64]:
    """Values (m,), 0 in a column."""
    result = values.copy()
    result[column] = 0.0
    return result
