"""Compiled code works on the arrays of a named tuple that it is given by one pointer."""

import sys
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from observer_rt.foundation.referenced import referenced


class Value(NamedTuple):
    factor: float
    counts: bool
    shift: int


@referenced
class Part(NamedTuple):
    value: Value
    sums: NDArray[np.float64]


@referenced
class Whole(NamedTuple):
    name_of_nothing: int
    part: Part
    samples: NDArray[np.float64]


@njit
def _add(part: Part, sample: float) -> None:
    part.sums[0] += part.value.factor * sample + part.value.shift
    part.sums[1] += part.value.counts


@njit
def _gather(whole: Whole) -> float:
    part = whole.part
    for sample in whole.samples:
        _add(part, sample)
    return float(part.sums[0])


def _whole(samples: NDArray[np.float64], factor: float = 2.0) -> Whole:
    return Whole(7, Part(Value(factor, True, 3), np.zeros(2)), samples)


def test_what_lies_behind_the_pointer_is_read_and_written() -> None:
    whole = _whole(np.array([1.0, 10.0]))
    assert _gather(whole) == 28.0
    assert whole.part.sums.tolist() == [28.0, 2.0]


def test_each_call_sees_the_tuple_it_was_given() -> None:
    first, second = _whole(np.array([1.0])), _whole(np.array([1.0]), factor=-1.0)
    assert [_gather(each) for each in (first, second, first)] == [5.0, 2.0, 10.0]


def test_one_function_is_compiled_for_all_arrays_of_a_type() -> None:
    for samples in (np.zeros(1), np.zeros(3)):
        _gather(_whole(samples))
    assert len(_gather.signatures) == 1


def test_a_leaf_of_another_type_is_another_type() -> None:
    whole = _whole(np.array([1.0]))
    _gather(whole._replace(samples=np.array([1], np.int64)))
    assert len(_gather.signatures) == 2
    assert whole.part.sums.tolist() == [5.0, 1.0]


def test_nobody_holds_an_array_after_the_call() -> None:
    whole = _whole(np.array([1.0]))
    before = sys.getrefcount(whole.samples)
    _gather(whole)
    after = sys.getrefcount(whole.samples)
    assert after == before


def test_what_is_no_leaf_is_an_error() -> None:
    with pytest.raises(TypeError):
        _gather(_whole(np.array([1.0]))._replace(samples="text"))  # type: ignore[arg-type]
