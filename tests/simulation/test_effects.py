"""The `--effect` texts."""

import pytest

from observer_rt.foundation.errors import UserError
from observer_rt.model.effect import Effect
from observer_rt.model.effects import VOCABULARY
from observer_rt.simulation.simulate import parse_effects


def values(texts: list[str]) -> dict[str, tuple[float, ...]]:
    """What was parsed, SI, by id."""
    return {item.effect.id: item.values for item in parse_effects(texts)}


def test_no_effect_is_a_healthy_injector() -> None:
    assert parse_effects([]) == ()


def test_parameter_may_be_left_out() -> None:
    assert parse_effects(["orifice_area=0.3"]) == parse_effects(["orifice_area:v_H=0.3"])


def test_several_effects_in_si_units() -> None:
    texts = [
        "orifice_area:v_H=0.3",
        "seat_area=-0.2",
        "line_pressure_sensor_offset:o=0.8",
        "rail_pressure_sensor_offset=-3",
        "lift_offset=20",
        "channel_skew:d=-12.5",
        "guide_leakage=3e-14",
        "seat_outflow",
    ]
    expected = {
        "orifice_area": 0.3,
        "seat_area": -0.2,
        "line_pressure_sensor_offset": 0.8e6,
        "rail_pressure_sensor_offset": -3e6,
        "lift_offset": 20e-6,
        "channel_skew": -12.5e-6,
        "guide_leakage": 3e-14,
    }
    found = values(texts)
    assert found.pop("seat_outflow") == ()
    assert {name: value for name, (value,) in found.items()} == pytest.approx(expected)


def test_an_effect_with_two_parameters() -> None:
    texts = ["lift_dependent_seat_coefficient:a=0.2", "lift_dependent_seat_coefficient:x_c=80"]
    assert values(texts)["lift_dependent_seat_coefficient"] == pytest.approx((0.2, 80e-6))


@pytest.mark.parametrize("effect", VOCABULARY.values(), ids=VOCABULARY)
def test_the_whole_vocabulary_to_its_bounds(effect: Effect) -> None:
    for name in ("lowest", "highest"):
        limits = tuple(getattr(parameter, name) for parameter in effect.parameters)
        texts = [f"{effect.id}:{p.name}={getattr(p, name) / p.si!r}" for p in effect.parameters]
        assert values(texts or [effect.id])[effect.id] == pytest.approx(limits)


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
        "seat_outflow=1",
        "guide_leakage=-1e-14",
        "lift_offset=2e-5e",
        "lift_offset=80",
        "seat_area=30",
        "line_pressure_sensor_offset=1e6",
    ],
)
def test_bad_effects(text: str) -> None:
    with pytest.raises(UserError, match="--effect: "):
        parse_effects([text])


def test_an_effect_given_twice() -> None:
    with pytest.raises(UserError, match="'seat_area:v_S' is given twice"):
        parse_effects(["seat_area=0.1", "seat_area:v_S=0.2"])
