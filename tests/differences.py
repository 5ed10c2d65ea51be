"""Derivatives of a function of a vector as differences of the function itself, to compare slopes with."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def differences(function: Callable[[Array], Array | float], at: Array, step: float) -> Array:
    """Central differences (..., n) by each of the n entries of a vector."""
    moved = step * np.eye(at.size)
    return np.stack([np.subtract(function(at + d), function(at - d)) for d in moved], axis=-1) / (2.0 * step)


def assert_columns_agree(actual: Array, expected: Array, share: float) -> None:
    error, largest = np.abs(actual - expected).max(axis=0), np.abs(expected).max(axis=0)
    assert (error <= share * largest).all(), np.flatnonzero(error > share * largest)
