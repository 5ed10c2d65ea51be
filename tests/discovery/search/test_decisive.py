"""What would tell effects apart."""

from itertools import combinations

import pytest

from observer_rt.discovery.search.verdict import decide_by
from observer_rt.model.effects import VOCABULARY

NEAR_TIES = {
    ("line_pressure_sensor_lag", "channel_skew"): "one signal",
    ("seat_area", "lift_offset"): "lift sensor",
    ("line_pressure_sensor_offset", "rail_pressure_sensor_offset"): "reference gauge",
    ("fuel_density", "orifice_area"): "mass",
    ("orifice_area", "orifice_cavitation"): "rail pressures",
}


@pytest.mark.parametrize(("ids", "word"), NEAR_TIES.items())
def test_near_ties_have_a_measurement_that_decides(ids: tuple[str, str], word: str) -> None:
    (decisive,) = decide_by(ids)
    assert set(decisive.separates) == set(ids)
    assert word in decisive.measurement


def test_every_two_effects_are_separated_by_something() -> None:
    for pair in combinations(VOCABULARY, 2):
        (decisive,) = decide_by(pair)
        assert decisive.measurement


def test_effects_one_measurement_separates_stand_together() -> None:
    decisive = decide_by(("seat_area", "lift_gain", "lift_offset"))
    assert sum("lift sensor" in one.measurement for one in decisive) == len(decisive)
    assert {effect for one in decisive for effect in one.separates} == {
        "seat_area",
        "lift_gain",
        "lift_offset",
    }


def test_one_effect_needs_no_decision() -> None:
    assert decide_by(("seat_area",)) == ()
