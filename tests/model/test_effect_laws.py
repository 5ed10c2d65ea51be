"""Laws that effects change against formulas in physical units; the root of the orifice laws."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import normalised_area, root
from observer_rt.core.model.model import rates_of_change
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.network import constant_network

NOMINAL = load_injector()
P_0, P_C = 1e8, 5e6

DIFFERENCES = st.floats(-3, 3, allow_nan=False)
TRANSITIONS = st.floats(1e-4, 1e-1)


def model(**parameters: dict[str, float]) -> Coefficients:
    return effective_model(NOMINAL, [sized(name, **sizes) for name, sizes in parameters.items()]).coefficients


@pytest.mark.parametrize("pressure", [-20e6, 0.0, 5e6, 400e6, 1e9])
@pytest.mark.parametrize("slope", [-8.0, 12.0])
def test_stiffness_stays_positive_where_no_injector_works(pressure: float, slope: float) -> None:
    """K_eff/K_L, by which the pressure of the shut line rises faster than that of the nominal one."""
    c = model(pressure_dependent_bulk_modulus={"n": slope}, entrained_air={"g": 0.03})
    x, shut = [(pressure - P_C) / P_0, 0.5, 0.0], (1.0, 0.0)
    changed, nominal = (rates_of_change(x, shut, each, constant_network())[0] for each in (c, model()))
    assert 0.0 < changed / nominal < 10.0


def test_a_shut_seat_has_no_area_whatever_its_coefficient() -> None:
    c = model(lift_dependent_seat_coefficient={"a": 0.5})
    assert {normalised_area(lift, c.seat) for lift in (0.0, -1e-9, -5e-6)} == {0.0}


@given(DIFFERENCES, TRANSITIONS)
def test_root_is_odd(difference: float, transition: float) -> None:
    assert root(-difference, transition) == -root(difference, transition)


@given(st.floats(-1, 1), TRANSITIONS)
def test_root_is_the_signed_square_root_far_from_zero(direction: float, transition: float) -> None:
    """The relative difference is (t/d)^2 / 4 to first order: never more than that."""
    assume(abs(direction) > 10 * transition)
    shortfall = 1.0 - root(direction, transition) / math.copysign(math.sqrt(abs(direction)), direction)
    assert 0.0 <= shortfall <= 0.25 * (transition / direction) ** 2 + 1e-15


@given(DIFFERENCES, TRANSITIONS)
def test_it_rises_and_is_steepest_at_zero(difference: float, transition: float) -> None:
    """The bound that the number of integration steps rests on."""
    step = 1e-4 * math.hypot(difference, transition)
    rise = (root(difference + step, transition) - root(difference - step, transition)) / (2 * step)
    assert 0.0 < rise <= (1 + 1e-7) / math.sqrt(transition)
    assert root(1e-6 * transition, transition) == pytest.approx(1e-6 * math.sqrt(transition), rel=1e-9)
