"""Vectors of compiled code against the same sums, number by number."""

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from observer_rt.foundation.small_arrays import WIDTH, load, store, whole_vectors

Numbers = NDArray[np.float64]


@njit
def combined(first: Numbers, second: Numbers, factor: float, result: Numbers) -> None:
    """(factor * first + second - first) / factor, from the second vector on."""
    for place in range(WIDTH, first.size, WIDTH):
        along = load(first, place)
        store(result, place, (factor * along + load(second, place) - along) / factor)


def test_as_the_same_numbers_one_by_one() -> None:
    first, second = np.random.default_rng(1).normal(size=(2, 3 * WIDTH))
    result = np.full(3 * WIDTH, 7.0)
    combined(first, second, 1.7, result)
    expected = (1.7 * first + second - first) / 1.7
    np.testing.assert_array_equal(result[WIDTH:], expected[WIDTH:])
    np.testing.assert_array_equal(result[:WIDTH], 7.0)


@pytest.mark.parametrize(("columns", "whole"), [(0, 0), (1, WIDTH), (WIDTH, WIDTH), (WIDTH + 1, 2 * WIDTH)])
def test_columns_fill_vectors(columns: int, whole: int) -> None:
    assert whole_vectors(columns) == whole
