"""Scalars that must pay for themselves: the best subset of a joint Gaussian belief."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

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
    best_value, best_theta, best_active = -np.inf, np.zeros_like(vector), active
    for chosen in _subsets(gate.columns):
        columns = [*free, *chosen]
        solution = np.linalg.solve(information[np.ix_(columns, columns)], vector[columns])
        theta = np.zeros_like(vector)
        theta[columns] = solution
        if any(theta[c] < low for c, low in zip(gate.columns, gate.lowest, strict=True) if c in chosen):
            continue
        price = sum(STAY if c in active else ENTER for c in chosen)
        value = float(vector[columns] @ solution) - price
        if value > best_value:
            best_value, best_theta, best_active = value, theta, frozenset(chosen)
    return best_theta, best_active


def _subsets(columns: Sequence[int]) -> list[tuple[int, ...]]:
    return [chosen for size in range(len(columns) + 1) for chosen in combinations(columns, size)]


def gated_covariance(
    information: NDArray[np.float64],
    error_covariance: NDArray[np.float64],
    gate: Gate,
    active: frozenset[int],
) -> NDArray[np.float64]:
    """Error covariance (m, m) of the free and active parameters as estimated by `best_subset`, the others being 0.

    information (m, m) of the joint belief and error_covariance (m, m) of its mean. Where that is the inverse of the
    information the result is the inverse of its part. Raises numpy.linalg.LinAlgError when singular.
    """
    columns = [i for i in range(len(information)) if i not in gate.columns or i in active]
    by_joint = np.linalg.solve(information[np.ix_(columns, columns)], information[columns])
    covariance = np.zeros_like(information)
    covariance[np.ix_(columns, columns)] = by_joint @ error_covariance @ by_joint.T
    return covariance
