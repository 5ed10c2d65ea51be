"""Gates of a belief: a gated scalar is in the estimate only where it explains enough."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.gating import search_subsets
from observer_rt.core.learning.matrices import inverse_of
from observer_rt.engine.estimation.belief import Belief, Matrix, Vector, conditioned

ENTER = 16.0  # gain of chi2 (4 sigma) from which on a scalar is active
STAY = 6.25  # the same (2.5 sigma) of one that is active already
ALIKE = 60.0  # the same of one that looks like another that is active


class Alike(NamedTuple):
    """Two columns that one event may not tell apart, and the least value of the first that is carried on."""

    first: int
    other: int
    least: float


@dataclass(frozen=True)
class Gate:
    """Lowest values that the gated parameters may take, by column; held: columns that no event tells of.

    alike: while its first column is active, that stays at no price, and the other enters at a high one.
    """

    lowest: Mapping[int, float]
    held: tuple[int, ...] = ()
    alike: Alike | None = None

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns of the gated parameters."""
        return tuple(self.lowest)


def best_subset(
    mean: Vector, covariance: Matrix, gate: Gate, active: frozenset[int], carried: bool = False
) -> tuple[Vector, frozenset[int]]:
    """Parameters (m,) and active columns that maximise the likelihood less the price of the active scalars.

    mean (m,) and covariance (m, m) are those of the joint belief; columns left out are 0. carried: the result is
    carried on to the next event, and is no step of a fit. All subsets of the gated columns are tried.
    Raises numpy.linalg.LinAlgError when singular.
    """
    columns, theta = np.array(gate.columns), np.empty_like(mean)
    prices = {column: STAY if column in active else ENTER for column in gate.columns}

    def search(prices: Mapping[int, float], lowest: Mapping[int, float]) -> frozenset[int]:
        limits, costs = np.array([*lowest.values()]), np.array([*prices.values()])
        subset = search_subsets(mean, covariance, columns, limits, costs, theta)
        return frozenset(column for i, column in enumerate(gate.columns) if subset >> i & 1)

    if gate.alike and gate.alike.first in active:
        first, other, least = gate.alike
        if other not in active:
            prices[other] = ALIKE
        chosen = search(prices | {first: 0.0}, {**gate.lowest, first: least} if carried else gate.lowest)
        if first in chosen:
            return theta, chosen
    return theta, search(prices, gate.lowest)


@dataclass(frozen=True, eq=False)
class GatedBelief:
    """A belief in which the gated scalars are 0 but for the `active` ones."""

    belief: Belief
    gate: Gate
    active: frozenset[int]

    @cached_property
    def covariance(self) -> Matrix:
        """Error covariance (m, m) of the free and active parameters as `best_subset` estimates them; 0 of the others.

        If the belief's error covariance is its covariance, it is the inverse of their part of the information.
        Raises numpy.linalg.LinAlgError when singular.
        """
        return self._by_joint @ self.belief.error_covariance @ self._by_joint.T

    @cached_property
    def _by_joint(self) -> Matrix:
        """Map (m, m) from the joint mean to the estimate: the scalars left out are known to be 0.

        The others are conditioned on that and on the held scalars, which keep their values.
        """
        covariance, result = self.belief.covariance, np.eye(self.belief.mean.size)
        out = [column for column in self.gate.columns if column not in self.active]
        if out:
            rows = covariance[[*self.gate.held, *out]]
            for i, column in enumerate(self.gate.held):
                rows = conditioned(rows, i, column)
            rows = rows[len(self.gate.held) :]
            result[:, out] = -(inverse_of(rows[:, out])[0] @ rows).T
            result[out] = 0.0
        return result
