"""Gates of a belief: scalars pay for being in the estimate."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.gating import search_subsets
from observer_rt.core.learning.matrices import inverse_of
from observer_rt.engine.estimation.belief import Belief, conditioned

ENTER = 16.0  # gain of chi2 (4 sigma) that activates a scalar
STAY = 6.25  # and (2.5 sigma) that keeps it active


@dataclass(frozen=True)
class Gate:
    """Columns of the gated parameters, and the lowest value each may take; held: columns that no event tells of."""

    columns: tuple[int, ...]
    lowest: tuple[float, ...]
    held: tuple[int, ...] = ()

    def replaced(self, column: int, lowest: float) -> "Gate":
        """Gate in which one parameter may take another lowest value."""
        pairs = zip(self.columns, self.lowest, strict=True)
        changed = tuple(lowest if one == column else before for one, before in pairs)
        return Gate(self.columns, changed, self.held)


def best_subset(
    mean: NDArray[np.float64], covariance: NDArray[np.float64], gate: Gate, active: frozenset[int]
) -> tuple[NDArray[np.float64], frozenset[int]]:
    """Parameters (m,) and active columns that maximise the likelihood less the price of the active scalars.

    mean (m,) and covariance (m, m) are those of the joint belief; columns left out are 0.
    All subsets of the gated columns are tried. Raises numpy.linalg.LinAlgError when singular.
    """
    columns, lowest, theta = np.array(gate.columns), np.array(gate.lowest), np.empty_like(mean)
    prices = np.array([STAY if column in active else ENTER for column in gate.columns])
    subset = search_subsets(mean, covariance, columns, lowest, prices, theta)
    return theta, frozenset(column for i, column in enumerate(gate.columns) if subset >> i & 1)


@dataclass(frozen=True, eq=False)
class GatedBelief:
    """A belief as the estimate has it in which the scalars that do not pay are 0; active: those that do."""

    belief: Belief
    gate: Gate
    active: frozenset[int]

    @cached_property
    def covariance(self) -> NDArray[np.float64]:
        """Error covariance (m, m) of the free and active parameters as `best_subset` estimates them.

        Where the belief's error covariance is its covariance, the result is the inverse of that part of the
        information. Raises numpy.linalg.LinAlgError when singular.
        """
        return self._by_joint @ self.belief.error_covariance @ self._by_joint.T

    @cached_property
    def _by_joint(self) -> NDArray[np.float64]:
        """Map (m, m) from the joint mean to the estimate: parameters left out are known to be 0.

        A held scalar keeps its value and conditions all others: leaving a scalar out tells nothing of it.
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
