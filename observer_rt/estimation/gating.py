"""Scalars that must pay for themselves: the best subset of a joint Gaussian belief."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.posterior import Belief
from observer_rt.foundation.compiled import compiled, inner_separate

ENTER = 16.0  # gain of chi2 (4 sigma) that activates a scalar
STAY = 6.25  # and (2.5 sigma) that keeps it active


@dataclass(frozen=True)
class Gate:
    """Which parameters are gated (column numbers), and the lowest value each may take."""

    columns: tuple[int, ...]
    lowest: tuple[float, ...]


def best_subset(
    information: NDArray[np.float64],
    vector: NDArray[np.float64],
    gate: Gate,
    active: frozenset[int],
) -> tuple[NDArray[np.float64], frozenset[int]]:
    """Parameters (m,) and active columns that maximise the likelihood less the price of the active scalars.

    information (m, m) and vector (m,) = information @ mean are those of the joint belief; columns left out are 0.
    All subsets of the gated columns are tried. Raises numpy.linalg.LinAlgError when singular.
    """
    free = [i for i in range(len(vector)) if i not in gate.columns]
    order = np.array([*free, *gate.columns], np.int64)
    prices = np.array([STAY if column in active else ENTER for column in gate.columns])
    theta = np.zeros_like(vector)
    subset = _search(information, vector, order, len(free), np.array(gate.lowest), prices, theta)
    if subset < 0:
        raise np.linalg.LinAlgError("information is not positive definite")
    return theta, frozenset(column for i, column in enumerate(gate.columns) if subset >> i & 1)


@compiled
def _search(
    information: NDArray[np.float64],
    vector: NDArray[np.float64],
    order: NDArray[np.int64],
    free: int,
    lowest: NDArray[np.float64],
    prices: NDArray[np.float64],
    best: NDArray[np.float64],
) -> int:
    """The best subset as a bit mask over the gated columns, its parameters into `best` (m,); < 0: singular.

    order (m,): the columns, first the free ones, so many, then the gated ones. All subsets share the Cholesky
    factor's rows of the free ones; the likelihood is half the sum of squares of what is left of the vector by it.
    """
    m = order.shape[0]
    factor, left, solution = np.zeros((m, m)), np.zeros(m), np.zeros(m)
    columns = order.copy()
    likelihood = 0.0
    for size in range(free):
        if not _extend(factor, left, information, vector, columns, size):
            return -1
        likelihood += left[size] * left[size]
    best_value, best_subset = -np.inf, 0
    for subset in range(1 << (m - free)):
        size, value = free, likelihood
        for i in range(m - free):
            if subset >> i & 1:
                columns[size] = order[free + i]
                if not _extend(factor, left, information, vector, columns, size):
                    return -1
                value += left[size] * left[size] - prices[i]
                size += 1
        if not value > best_value:
            continue
        _solve_back(factor, left, solution, size, free)
        admissible, place = True, free
        for i in range(m - free):
            if subset >> i & 1:
                admissible = admissible and solution[place] >= lowest[i]
                place += 1
        if admissible:
            best_value, best_subset = value, subset
            _solve_back(factor, left, solution, size, 0)
            best[:] = 0.0
            for i in range(size):
                best[columns[i]] = solution[i]
    return best_subset


@inner_separate
def _extend(
    factor: NDArray[np.float64],
    left: NDArray[np.float64],
    information: NDArray[np.float64],
    vector: NDArray[np.float64],
    columns: NDArray[np.int64],
    size: int,
) -> bool:
    """One more row of a Cholesky factor, for the column in that place, and what it leaves of the vector.

    False: the matrix is singular.
    """
    column = columns[size]
    pivot, rest = information[column, column], vector[column]
    for i in range(size):
        entry = information[column, columns[i]]
        for j in range(i):
            entry -= factor[size, j] * factor[i, j]
        entry /= factor[i, i]
        factor[size, i] = entry
        pivot -= entry * entry
        rest -= entry * left[i]
    if not pivot > 0.0:
        return False
    factor[size, size] = math.sqrt(pivot)
    left[size] = rest / factor[size, size]
    return True


@inner_separate
def _solve_back(
    factor: NDArray[np.float64],
    left: NDArray[np.float64],
    solution: NDArray[np.float64],
    size: int,
    first: int,
) -> None:
    """The parameters from place `first` on, of so many."""
    for i in range(size - 1, first - 1, -1):
        total = left[i]
        for j in range(i + 1, size):
            total -= factor[j, i] * solution[j]
        solution[i] = total / factor[i, i]


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

    def carried(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Error covariance (m, m) of a theta (m,) that is carried: that of the estimate, and two squares.

        One of what lies between theta and the estimate (it was not adopted). One of what the scalars that do not pay
        yet for being active would change, by the share that noise does not explain: 1 - k/chi2 for k of them (the
        positive part estimator of James and Stein 1961).
        """
        estimate = self._by_joint @ self.belief.mean
        left_out = sum(column not in self.active for column in self.gate.columns)
        shift = estimate - self.belief.mean
        chi2 = float(shift @ self.belief.information @ shift)
        share = 1.0 - left_out / chi2 if chi2 > left_out else 0.0
        return self.covariance + np.outer(theta - estimate, theta - estimate) + share * np.outer(shift, shift)

    @cached_property
    def _by_joint(self) -> NDArray[np.float64]:
        """What the estimate is of the joint mean, (m, m): the rows of what is left out are 0."""
        information = self.belief.information
        columns = [i for i in range(len(information)) if i not in self.gate.columns or i in self.active]
        result = np.zeros_like(information)
        rows = information[columns]
        result[columns] = np.linalg.solve(rows[:, columns], rows)
        return result
