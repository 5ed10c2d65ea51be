"""The smooth signed root of the orifice laws."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from observer_rt.core.model.laws import root

DIFFERENCES = st.floats(-3, 3, allow_nan=False)
TRANSITIONS = st.floats(1e-4, 1e-1)
compiled = settings(deadline=None)  # the first example may compile


@compiled
@given(DIFFERENCES, TRANSITIONS)
def test_root_is_odd(difference: float, transition: float) -> None:
    assert root(-difference, transition) == -root(difference, transition)


@compiled
@given(st.floats(-1, 1), TRANSITIONS)
def test_root_is_the_signed_square_root_far_from_zero(direction: float, transition: float) -> None:
    """The relative difference is (t/d)^2 / 4 to first order: never more than that."""
    assume(abs(direction) > 10 * transition)
    exact = math.copysign(math.sqrt(abs(direction)), direction)
    shortfall = 1.0 - root(direction, transition) / exact
    assert 0.0 <= shortfall <= 0.25 * (transition / direction) ** 2 + 1e-15


@compiled
@given(DIFFERENCES, TRANSITIONS)
def test_it_rises_and_is_steepest_at_zero(difference: float, transition: float) -> None:
    """The bound that the number of integration steps rests on."""
    step = 1e-4 * math.hypot(difference, transition)
    rise = (root(difference + step, transition) - root(difference - step, transition)) / (2 * step)
    assert 0.0 < rise <= (1 + 1e-7) / math.sqrt(transition)
    assert root(1e-6 * transition, transition) == pytest.approx(1e-6 * math.sqrt(transition), rel=1e-9)
