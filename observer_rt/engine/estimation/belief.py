"""The Gaussian belief about the parameters, carried from event to event.

A held parameter keeps a value found elsewhere, considered by Schmidt's filter (Application of state-space methods to
navigation problems, 1966): events teach nothing of it, but its uncertainty adds to all that depends on it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from observer_rt.core.learning.gating import search_subsets
from observer_rt.core.learning.matrices import inverse_of
from observer_rt.engine.estimation.parameters import Gate
from observer_rt.foundation.units import Floats, Ints

_EXACTLY = 1e-14  # variance of a held parameter
Vector = Floats
Matrix = Floats
ENTER = 16.0  # gain of chi2 (4 sigma) from which on a scalar is active
STAY = 6.25  # the same (2.5 sigma) of one that is active already
ALIKE = 60.0  # the same of one that looks like another that is active


@dataclass(frozen=True, eq=False)
class Belief:
    """Mean (m,) of theta and two covariances (m, m), with and without drift.

    `covariance` decides how much the next event teaches, by the drift any event may bring. `error_covariance` has
    only the changes that showed: drift, there to forget by, is far larger than wear, so a filter that lives on it is
    up to sqrt(2) nearer to parameters that stand still than `covariance` says.
    """

    mean: Vector
    covariance: Matrix
    error_covariance: Matrix

    @property
    def parts(self) -> dict[str, Matrix]:
        """The arrays that define the belief, by name."""
        return {"mean": self.mean, "covariance": self.covariance, "error_covariance": self.error_covariance}

    @property
    def sigma(self) -> Vector:
        """Standard deviations (m,), drift included."""
        return np.array(np.sqrt(np.diag(self.covariance)), np.float64)

    def drifted(self, drift: Vector) -> "Belief":
        """The belief one event later, when each parameter may have moved by `drift` (m,) (one sigma)."""
        return Belief(self.mean, _moved(self.covariance, drift), self.error_covariance)

    def widened(self, change: Vector) -> "Belief":
        """The belief after each parameter has moved, by `change` (m,) (one sigma)."""
        return Belief(self.mean, *self._of_each(lambda covariance: _moved(covariance, change)))

    def narrowed(self, columns: Sequence[int], share: float) -> "Belief":
        """The belief in which the standard deviations of these parameters are a share of what they were."""
        factor = np.ones(self.mean.size)
        factor[list(columns)] = share
        both = np.outer(factor, factor)
        return Belief(self.mean, both * self.covariance, both * self.error_covariance)

    def part(self, columns: Ints) -> "Belief":
        """The belief about the parameters of some columns (k,)."""
        return Belief(self.mean[columns], *self._of_each(lambda own: own.take(columns, 0).take(columns, 1)))

    def complete(self, columns: Ints, variances: Vector) -> "Belief":
        """The belief about all m parameters, this one being a part; the others are 0, with variances (m,)."""

        def placed(covariance: Matrix) -> Matrix:
            result = np.diag(variances)
            result[columns[:, None], columns] = covariance
            return result

        mean = np.zeros(variances.size)
        mean[columns] = self.mean
        return Belief(mean, *self._of_each(placed))

    def _of_each(self, change: Callable[[Matrix], Matrix]) -> tuple[Matrix, Matrix]:
        covariance = change(self.covariance)
        return covariance, covariance if self.error_covariance is self.covariance else change(self.error_covariance)

    def distance(self, theta: Vector) -> float:
        """Square of the distance of theta (m,) from the mean, in standard deviations."""
        away = theta - self.mean
        return float(away @ self.information @ away)

    @property
    def information(self) -> Matrix:
        """Inverse covariance (m, m). Raises numpy.linalg.LinAlgError when not positive definite."""
        return self.inverse[0]

    @cached_property
    def inverse(self) -> tuple[Matrix, float]:
        """Inverse (m, m) of the covariance, and half the logarithm of its determinant, as of `inverse_of`."""
        return inverse_of(self.covariance)

    def updated(self, information: Matrix, vector: Vector) -> "Belief":
        """The belief after measurements with Gauss-Newton `information` (m, m) and vector (m,) = information @ theta.

        The error afterwards is P (P0^-1 e0 + noise), noise with the covariance `information`. Raises
        numpy.linalg.LinAlgError when the sum of both informations is singular, not positive definite or holds NaN.
        """
        covariance, _ = inverse_of(self.information + information)
        gain = covariance @ information
        kept = np.eye(self.mean.size) - gain
        error = kept @ self.error_covariance @ kept.T + gain @ covariance
        mean = self.mean + covariance @ (vector - information @ self.mean)
        return Belief(mean, covariance, symmetric(error))


def prior_belief(mean: Vector, covariance: Matrix) -> Belief:
    """Belief before any event: mean (m,), covariance (m, m)."""
    return Belief(mean, covariance, covariance)


def _moved(covariance: Matrix, change: Vector) -> Matrix:
    """A covariance (m, m) with the variances `change`^2 (m,) added."""
    result = covariance.copy()
    result.ravel()[:: len(result) + 1] += change**2
    return result


def symmetric(matrix: Matrix) -> Matrix:
    """A covariance (m, m) with the same numbers on both sides of its diagonal, which rounding made unequal."""
    return np.asarray(0.5 * (matrix + matrix.T), np.float64)


def conditioned(rows: Matrix, row: int, column: int) -> Matrix:
    """Rows (k, m) of a covariance once the parameter of a column is known exactly; row: number of its own row."""
    return np.asarray(rows - np.outer(rows[:, column], rows[row]) / rows[row, column])


@dataclass(frozen=True, eq=False)
class HeldBelief:
    """A belief before an event with one parameter held at a value."""

    prior: Belief
    column: int | None = None  # None: nothing is held
    by: Vector = field(default_factory=lambda: np.empty(0))  # (m,) change of theta with the held value
    variance: float = 0.0  # of the held value
    log: float = 0.0  # nats that holding it adds to the evidence of the event

    def held_in(self, theta: Vector) -> Vector:
        """Theta (m,) itself, or with the value that is held, if it has another."""
        if self.column is None or abs(theta[self.column] - self.prior.mean[self.column]) <= math.sqrt(_EXACTLY):
            return theta
        theta = theta.copy()
        theta[self.column] = self.prior.mean[self.column]
        return theta

    def considered(self, after: Belief, information: Matrix) -> Belief:
        """The belief after an event of `information` (m, m), with the held value's uncertainty in it."""
        if self.column is None:
            return after
        toward = self.prior.information @ _zeroed(self.by, self.column) - information[:, self.column]
        moves = after.covariance @ _zeroed(toward, self.column)
        moves[self.column] = 1.0
        more = self.variance * np.outer(moves, moves)
        return Belief(after.mean, symmetric(after.covariance + more), symmetric(after.error_covariance + more))


def held_at(belief: Belief, column: int, value: float, variance: float) -> HeldBelief:
    """A belief with a column held at a value, whose variance includes what the belief says of it."""
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


def _zeroed(values: Vector, column: int) -> Vector:
    result = values.copy()
    result[column] = 0.0
    return result


def best_subset(
    mean: Vector, covariance: Matrix, gate: Gate, active: frozenset[int], carried: bool = False
) -> tuple[Vector, frozenset[int]]:
    """Parameters (m,) and active columns that maximise the likelihood less the price of the active scalars.

    Tries all subsets of the gated columns, by mean (m,) and covariance (m, m) of the joint belief. carried: the
    result goes on to the next event, and is no step of a fit. Raises numpy.linalg.LinAlgError when singular.
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
        """Error covariance (m, m) of `best_subset`, else 0. Raises numpy.linalg.LinAlgError when singular."""
        return self._by_joint @ self.belief.error_covariance @ self._by_joint.T

    @cached_property
    def _by_joint(self) -> Matrix:
        """Map (m, m) from the joint mean to the estimate, conditioned on the scalars left out (0) and those held."""
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
