"""The network's activation against the C library's."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.core.model.laws import take_tanh


def tanh(argument: float) -> float:
    values = np.array([[argument]])
    take_tanh(values)
    return float(values[0, 0])


@given(st.floats(-1e6, 1e6))
@example(math.inf)
@example(-math.inf)
@example(-20.0)
@example(7.76)  # where the error is largest
def test_tanh_is_that_of_the_c_library(argument: float) -> None:
    assert tanh(argument) == pytest.approx(math.tanh(argument), abs=1e-12)


@given(st.floats(1e-150, 1e-3))
def test_tanh_of_small_arguments_keeps_its_relative_accuracy(argument: float) -> None:
    assert tanh(argument) == pytest.approx(math.tanh(argument), rel=1e-14, abs=0.0)
    assert tanh(-argument) == -tanh(argument)


def test_tanh_of_nan_is_nan() -> None:
    assert math.isnan(tanh(math.nan))
