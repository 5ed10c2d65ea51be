"""Compiled code works on what lies behind the one pointer by which it is given a big named tuple.

With the package's tuples: those of a test, in the shared cache, would be looked for by whoever runs without tests.
"""

import sys

import numpy as np
import pytest
from numba import njit, typeof
from numba.core.errors import TypingError

from observer_rt.config.bench import load_bench
from observer_rt.observer.stream.state import Constants
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.compiled.publisher import Publisher, make_publisher


@njit
def _add(publisher: Publisher, amount: float) -> None:
    publisher.values[1] += amount
    publisher.memory[0].frames += 1


@njit
def _add_twice(publisher: Publisher, amount: float) -> float:
    _add(publisher, amount)
    _add(publisher, amount)
    return float(publisher.values.sum())


@njit
def _read(constants: Constants) -> tuple[float, int, bool, float]:
    """Of a tuple that is referenced, too, and of one by value."""
    timing, c = constants.timing, constants.coefficients
    return constants.interval, timing.bridge, constants.undoing.stated, c.nozzle.flow + c.density


def _publisher(*values: float) -> Publisher:
    return make_publisher(None, False)._replace(values=np.array(values))


def test_arrays_are_read_and_written() -> None:
    publisher = _publisher(1.0, 10.0)
    assert _add_twice(publisher, 2.0) == 15.0
    assert publisher.values.tolist() == [1.0, 14.0]
    assert publisher.memory["frames"].tolist() == [2]


def test_each_call_sees_the_tuple_it_was_given() -> None:
    first, second = _publisher(0.0, 1.0), _publisher(0.0, 5.0, 7.0)
    assert [_add_twice(each, 1.0) for each in (first, second, first)] == [3.0, 14.0, 5.0]
    assert len(_add_twice.signatures) == 1


def test_numbers_are_read_at_every_depth() -> None:
    constants = bench_constants(load_bench().injector)
    c = constants.coefficients
    for bridge in (50, 7):
        changed = constants._replace(timing=constants.timing._replace(bridge=bridge))
        assert _read(changed) == (constants.interval, bridge, False, c.nozzle.flow + c.density)


def test_nobody_holds_an_array_after_the_call() -> None:
    publisher = _publisher(0.0, 0.0)
    before = sys.getrefcount(publisher.values)
    _add_twice(publisher, 1.0)
    after = sys.getrefcount(publisher.values)
    assert after == before


def test_what_is_hidden_is_not_part_of_the_type() -> None:
    constants = bench_constants(load_bench().injector)
    averaged_line = constants.coefficients.line.with_mean()
    other = constants._replace(coefficients=constants.coefficients._replace(line=averaged_line))
    assert typeof(other.coefficients) != typeof(constants.coefficients)
    assert typeof(other) == typeof(constants)


def test_compiled_code_does_not_see_what_is_hidden() -> None:
    @njit
    def read(constants: Constants) -> float:
        return float(constants.coefficients.line.a1)

    with pytest.raises(TypingError, match="a1"):
        read(bench_constants(load_bench().injector))
