"""Coefficients of (25) against figures beside the nominal parameters and the paper's; tanh against the C library."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import take_tanh
from observer_rt.model.effective import coefficients

NOMINAL = load_injector()


def test_coefficients_are_those_printed_with_the_nominal_parameters() -> None:
    """`crin3_nominal.toml`: a1..a6 = 1067, 1236, 6.056e4, 353.7, 5.498e4, 1.483e4 1/s, to the last digit."""
    c = coefficients(NOMINAL)
    assert c.line.a1 == pytest.approx(1067, abs=0.5)
    assert c.line.a2_nozzle == pytest.approx(1236, abs=0.5)
    assert (c.line.a3, c.line.a4) == (pytest.approx(6.056e4, abs=5), pytest.approx(353.7, abs=0.05))
    assert c.sac.a5 == pytest.approx(5.498e4, abs=5)
    assert c.sac.a6 == pytest.approx(1.483e4, abs=5)


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
