"""Bound functions work on the tuple they are bound to, and their callers are compiled once for all of them."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.foundation.referenced import Bound, bind, call, referenced


@referenced()
class Few(NamedTuple):
    """One array."""

    values: NDArray[np.float64]


@referenced()
class More(NamedTuple):
    """Something else."""

    factor: int
    table: NDArray[np.float64]


@njit
def _of_few(few: Few, what: int, place: int) -> float:
    few.values[place] += what
    return float(few.values[place])


@njit
def _of_more(more: More, what: int, place: int) -> float:
    return float(more.factor * more.table[what, place])


@njit
def _twice(bound: Bound, what: int, place: int) -> float:
    return float(call(bound, what, place) + call(bound, what, place))


def test_a_caller_knows_neither_function_nor_tuple() -> None:
    few, more = Few(np.array([1.0, 2.0])), More(3, np.array([[1.0, 2.0], [4.0, 5.0]]))
    (first, of_first), (second, of_second) = bind(_of_few, few), bind(_of_more, more)
    assert _twice(first, 10, 1) == 12.0 + 22.0
    assert few.values.tolist() == [1.0, 22.0]
    assert _twice(second, 1, 0) == 2 * 3 * 4.0
    assert len(_twice.signatures) == 1
    assert of_first[0] is few
    assert of_second[0] is more
