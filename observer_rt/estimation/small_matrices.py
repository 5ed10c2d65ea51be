"""Products of matrices of a few rows, for compiled code: the libraries' take longer to begin than to compute."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import inner


@inner
def multiply(left: NDArray[np.float64], right: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """left (n, k) @ right (k, m) into `result` (n, m), another array."""
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            result[i, j] = 0.0
        for k in range(right.shape[0]):
            factor = left[i, k]
            for j in range(result.shape[1]):
                result[i, j] += factor * right[k, j]


@inner
def product(matrix: NDArray[np.float64], vector: NDArray[np.float64], row: int) -> float:
    """A row of a matrix times a vector."""
    total = 0.0
    for k in range(vector.shape[0]):
        total += matrix[row, k] * vector[k]
    return total
