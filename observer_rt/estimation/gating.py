"""Scalars that must pay for themselves: the best subset of a joint Gaussian belief."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.posterior import Belief

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
    free = np.array([i for i in range(len(vector)) if i not in gate.columns], np.int64)
    prices = np.array([STAY if column in active else ENTER for column in gate.columns])
    theta = np.zeros_like(vector)
    subset = _search(
        information, vector, free, np.array(gate.columns, np.int64), np.array(gate.lowest), prices, theta
    )
    return theta, frozenset(column for i, column in enumerate(gate.columns) if subset >> i & 1)


@njit(cache=True, nogil=True)
def _search(
    information: NDArray[np.float64],
    vector: NDArray[np.float64],
    free: NDArray[np.int64],
    gated: NDArray[np.int64],
    lowest: NDArray[np.float64],
    prices: NDArray[np.float64],
    best: NDArray[np.float64],
) -> int:
    """The best subset as a bit mask over `gated`, its parameters into `best` (m,)."""
    columns = np.empty(vector.shape[0], np.int64)
    columns[: free.shape[0]] = free
    best_value, best_subset = -np.inf, 0
    for subset in range(1 << gated.shape[0]):
        size, price = free.shape[0], 0.0
        for i in range(gated.shape[0]):
            if subset >> i & 1:
                columns[size] = gated[i]
                size += 1
                price += prices[i]
        matrix, target = np.empty((size, size)), np.empty(size)
        for i in range(size):
            target[i] = vector[columns[i]]
            for j in range(size):
                matrix[i, j] = information[columns[i], columns[j]]
        solution = np.linalg.solve(matrix, target)
        value = float(target @ solution) - price
        if not value > best_value:
            continue
        admissible = True
        place = free.shape[0]
        for i in range(gated.shape[0]):
            if subset >> i & 1:
                admissible = admissible and solution[place] >= lowest[i]
                place += 1
        if admissible:
            best_value, best_subset = value, subset
            best[:] = 0.0
            for i in range(size):
                best[columns[i]] = solution[i]
    return best_subset


def gated_covariance(belief: Belief, gate: Gate, active: frozenset[int]) -> NDArray[np.float64]:
    """Error covariance (m, m) of the free and active parameters as `best_subset` estimates them, the others being 0.

    Where the belief's error covariance is its covariance, the result is the inverse of that part of the information.
    Raises numpy.linalg.LinAlgError when singular.
    """
    by_joint = _by_joint(belief.information(), gate, active)
    return by_joint @ belief.error_covariance @ by_joint.T


def carried_covariance(
    theta: NDArray[np.float64], belief: Belief, gate: Gate, active: frozenset[int]
) -> NDArray[np.float64]:
    """Error covariance (m, m) of a theta (m,) carried under a belief: `gated_covariance`, and two squares.

    One of what lies between theta and the estimate (it was not adopted). One of what the scalars that do not pay yet
    for being active would change, by the share that noise does not explain: 1 - k/chi2 for k of them (the positive
    part estimator of James and Stein 1961).
    """
    information = belief.information()
    estimate = _by_joint(information, gate, active) @ belief.mean
    left_out = sum(column not in active for column in gate.columns)
    shift = estimate - belief.mean
    chi2 = float(shift @ information @ shift)
    share = 1.0 - left_out / chi2 if chi2 > left_out else 0.0
    known = gated_covariance(belief, gate, active)
    return known + np.outer(theta - estimate, theta - estimate) + share * np.outer(shift, shift)


def _by_joint(information: NDArray[np.float64], gate: Gate, active: frozenset[int]) -> NDArray[np.float64]:
    """What the estimate with the active columns is of the joint mean, (m, m): the others' rows are 0."""
    columns = [i for i in range(len(information)) if i not in gate.columns or i in active]
    result = np.zeros_like(information)
    result[columns] = np.linalg.solve(information[np.ix_(columns, columns)], information[columns])
    return result
