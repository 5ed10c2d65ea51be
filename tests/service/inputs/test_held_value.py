"""Slow values and how long they count."""

import math

import pytest

from observer_rt.service.inputs.held_value import GRACE, HeldValue


def test_none_has_come_yet() -> None:
    assert math.isnan(HeldValue(math.inf).at(0.0))


def test_a_value_counts_until_its_time_out() -> None:
    held = HeldValue(0.5)
    held.take(3.0, 10.0)
    assert held.at(10.4) == 3.0
    assert math.isnan(held.at(10.6))
    held.take(4.0, 11.0)
    assert held.at(11.4) == 4.0


def test_without_a_time_out_it_counts_for_ever() -> None:
    held = HeldValue(math.inf)
    held.take(3.0, 0.0)
    assert held.at(1e9) == 3.0


@pytest.mark.parametrize("timeout", [0.5 * GRACE, 5 * GRACE, math.inf])
def test_a_sender_without_a_value_is_borne_for_a_while(timeout: float) -> None:
    held = HeldValue(timeout)
    held.take(3.0, 0.0)
    held.miss(0.1)
    borne = min(timeout, 0.1 + GRACE)
    assert held.at(borne - 0.01) == 3.0
    assert math.isnan(held.at(borne + 0.01))
    held.miss(borne + 1.0)
    assert math.isnan(held.at(borne + 1.1))


def test_a_new_beginning_of_time_takes_nothing_from_it() -> None:
    """The measuring device restarts 0.3 s after the value came: 0.2 s are left."""
    held = HeldValue(0.5)
    held.take(3.0, 100.0)
    assert held.at(100.3) == 3.0
    assert held.at(0.0) == 3.0
    assert held.at(0.19) == 3.0
    assert math.isnan(held.at(0.21))
