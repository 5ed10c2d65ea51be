"""The `--effect` texts."""

import pytest

from observer_rt.errors import UserError
from observer_rt.simulation.effects import PlantEffects, parse_effects


def test_no_effect_is_a_healthy_injector() -> None:
    assert parse_effects([]) == PlantEffects(0.0, 0.0, 0.0, 0.0)


def test_parameter_may_be_left_out() -> None:
    assert parse_effects(["orifice_area=0.3"]) == parse_effects(["orifice_area:v_H=0.3"])


def test_several_effects_in_si_units() -> None:
    texts = [
        "orifice_area:v_H=0.3",
        "seat_area=-0.2",
        "line_pressure_sensor_offset:o=0.8",
        "rail_pressure_sensor_offset=-3",
    ]
    effects = parse_effects(texts)
    assert (effects.orifice_area, effects.seat_area) == (0.3, -0.2)
    assert effects.line_pressure_sensor_offset == pytest.approx(0.8e6)
    assert effects.rail_pressure_sensor_offset == pytest.approx(-3e6)


def test_unknown_id_names_the_nearest_and_the_known() -> None:
    with pytest.raises(UserError) as raised:
        parse_effects(["orifice_aria=0.3"])
    assert "the nearest is 'orifice_area'" in str(raised.value)
    assert "seat_area:v_S" in raised.value.remedy


@pytest.mark.parametrize(
    "text",
    [
        "orifice_area",
        "orifice_area:v_H",
        "=0.3",
        "orifice_area:v_S=0.3",
        "orifice_area:=0.3",
        "orifice_area=thirty",
        "orifice_area=",
        "orifice_area=nan",
        "orifice_area=-1",
        "seat_area=30",
        "line_pressure_sensor_offset=1e6",
    ],
)
def test_bad_effects(text: str) -> None:
    with pytest.raises(UserError, match="--effect: "):
        parse_effects([text])


def test_an_effect_given_twice() -> None:
    with pytest.raises(UserError, match="'seat_area' is given twice"):
        parse_effects(["seat_area=0.1", "seat_area:v_S=0.2"])
