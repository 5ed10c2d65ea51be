"""Quantisation agrees with the bus database, code by code."""

from importlib.resources import files

import cantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.simulation.simulate import LIFT, PRESSURE, Quantisation

DATABASE = cantools.database.load_string((files("observer_rt.data") / "observer_fd.dbc").read_text("utf-8"))
SIGNALS = {signal.name: signal for signal in DATABASE.get_message_by_name("SampleBlock").signals}

QUANTITIES = pytest.mark.parametrize(
    ("quantisation", "signal", "factor"),
    [
        (PRESSURE, "RailPressure_00", 1e6),
        (PRESSURE, "LinePressure_00", 1e6),
        (LIFT, "NeedleLift_00", 1e-6),
    ],
)


@QUANTITIES
def test_every_code_of_the_bus_is_left_as_it_is(
    quantisation: Quantisation, signal: str, factor: float
) -> None:
    codes = np.arange(0xFFFE, dtype=np.float64)
    values = (codes + quantisation.lowest) * quantisation.multiple / quantisation.divisor
    assert np.array_equal(quantisation.apply(values), values)
    physical = SIGNALS[signal]
    shown = np.array([physical.raw_to_scaled(int(code)) for code in codes], dtype=np.float64)
    np.testing.assert_allclose(values, shown * factor, rtol=1e-14, atol=1e-9 * factor)


@QUANTITIES
@given(value=st.floats(-9.0, 300.0))
def test_values_are_rounded_as_on_the_bus(
    quantisation: Quantisation, signal: str, factor: float, value: float
) -> None:
    (found,) = quantisation.apply(np.array([value * factor]))
    physical = SIGNALS[signal]
    exact = (value - float(physical.offset)) / float(physical.scale)
    if abs(exact % 1.0 - 0.5) > 1e-6:  # ties may fall either way by the last bit of the arithmetic
        assert physical.scaled_to_raw(found / factor) == round(exact)


@QUANTITIES
def test_out_of_range_is_clipped_below_the_error_code(
    quantisation: Quantisation, signal: str, factor: float
) -> None:
    low, high = quantisation.apply(np.array([-1e4, 1e4]) * factor) / factor
    assert low == pytest.approx(float(SIGNALS[signal].offset))
    assert SIGNALS[signal].scaled_to_raw(high) == 0xFFFD
