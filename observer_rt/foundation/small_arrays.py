"""Vectors and matrices of a few numbers, for compiled code: the libraries' take longer to begin, and to compile."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inlined, inner


@inlined
def copy_vector(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """All numbers of one (n,) into the other."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@inlined
def copy_matrix(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """All numbers of one (n, m) into the other."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@compiled
def ascending(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Places of a few values (n,) in ascending order, equal ones as they come."""
    order = np.arange(values.shape[0])
    for k in range(1, order.shape[0]):
        place, i = order[k], k
        while i > 0 and values[order[i - 1]] > values[place]:
            order[i] = order[i - 1]
            i -= 1
        order[i] = place
    return order


@inner
def multiply(left: NDArray[np.float64], right: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """left (n, k) @ right (k, m) into `result` (n, m), another array; what is 0 in `left` costs nothing."""
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            result[i, j] = 0.0
        for k in range(right.shape[0]):
            factor = left[i, k]
            if factor != 0.0:
                for j in range(result.shape[1]):
                    result[i, j] += factor * right[k, j]


@inner
def propagate(
    transition: NDArray[np.float64],
    covariance: NDArray[np.float64],
    moved: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> None:
    """transition @ covariance into `moved`, and that @ transition.T into `covariance`; all (m, m).

    The transition of a line of cells is nearly empty, and always on the left here.
    """
    multiply(transition, covariance, moved)
    for i in range(moved.shape[0]):
        for j in range(moved.shape[0]):
            scratch[i, j] = moved[j, i]
    multiply(transition, scratch, covariance)
    for i in range(moved.shape[0]):
        for j in range(i):
            covariance[i, j], covariance[j, i] = covariance[j, i], covariance[i, j]


@inner
def product(matrix: NDArray[np.float64], vector: NDArray[np.float64], row: int) -> float:
    """A row of a matrix times a vector."""
    total = 0.0
    for k in range(vector.shape[0]):
        total += matrix[row, k] * vector[k]
    return total
