"""The vocabulary: complete, consistent in itself, and doing nothing when off."""

import math
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.model.effect import Effect, Likeness, SizedEffect
from observer_rt.model.effective import TRUE_INPUTS, EffectiveModel, SensorTerms, coefficients
from observer_rt.model.effects import VOCABULARY, effective_model, sized

NOMINAL = load_injector()
NAMED = {  # ids and parameters: injector files of users name them
    "orifice_area": ("v_H",),
    "seat_area": ("v_S",),
    "guide_leakage": ("c",),
    "control_flow": ("c", "d_on", "d_off"),
    "line_friction": ("k",),
    "seat_outflow": (),
    "bulk_modulus": ("r",),
    "line_volume": ("r",),
    "pressure_dependent_bulk_modulus": ("n",),
    "entrained_air": ("g",),
    "fuel_density": ("r",),
    "orifice_cavitation": ("n_crit_excess",),
    "lift_dependent_seat_coefficient": ("a", "x_c"),
    "chamber_pressure_rise": ("dp", "s"),
    "needle_lift_sensor_lag": ("tau",),
    "rail_pressure_skew": ("d",),
    "lift_offset": ("x_0",),
    "lift_gain": ("g",),
    "rail_pressure_sensor_gain": ("g",),
    "rail_pressure_sensor_offset": ("o",),
    "line_pressure_sensor_lag": ("tau",),
    "line_pressure_sensor_offset": ("o",),
    "channel_skew": ("d",),
    **dict.fromkeys(("opening_delay", "closing_delay"), ("d",)),
    **dict.fromkeys(("opening_speed", "closing_speed"), ("r",)),
    "needle_bounce": ("b", "l"),
}
effects = pytest.mark.parametrize("effect", VOCABULARY.values(), ids=VOCABULARY)


def at(effect: Effect, share: float) -> SizedEffect:
    return SizedEffect(effect, tuple(p.lowest + share * (p.highest - p.lowest) for p in effect.parameters))


def numbers(model: EffectiveModel) -> list[float]:
    c = model.coefficients
    return [
        *c.line,
        *c.seat,
        *c.nozzle,
        *c.sac,
        *c.valve,
        *c[5:],
        *model.inputs,
        *model.sensor,
        *model.injector.needle_law,
    ]


def test_no_id_or_parameter_gets_lost() -> None:
    assert {n: tuple(p.name for p in effect.parameters) for n, effect in VOCABULARY.items()} == NAMED
    assert all(name == effect.id for name, effect in VOCABULARY.items())


@effects
def test_parameters_are_consistent(effect: Effect) -> None:
    for parameter in effect.parameters:
        assert parameter.lowest <= parameter.off <= parameter.highest
        assert parameter.lowest < parameter.highest
        assert all(parameter.lowest <= start <= parameter.highest for start in parameter.starts)
        assert parameter.starts
        assert 0.0 <= parameter.dead_zone < 0.1 * (parameter.highest - parameter.lowest)
        assert parameter.si > 0.0
    assert all(parameter.dead_zone > 0.0 for parameter in effect.parameters[:1])  # its size; others shape it
    needle = effective_model(NOMINAL, [at(effect, 0.0)]).injector.needle_law
    assert min(needle.opening_speed, needle.closing_speed, needle.bounce_length) > 0.0


@effects
def test_texts_for_the_report(effect: Effect) -> None:
    for text in (effect.sentence, effect.signature):
        assert text[0].isupper()
        assert text.endswith(".")


def test_relations_name_effects_once_and_hold_both_ways() -> None:
    stated = [(e.id, other) for e in VOCABULARY.values() for r in e.relations for other in r.others]
    assert len({frozenset(pair) for pair in stated}) == len(stated)
    for effect, other in stated:
        relation = VOCABULARY[effect].relation_to(VOCABULARY[other])
        assert relation is not None
        assert relation is VOCABULARY[other].relation_to(VOCABULARY[effect])
        assert relation.decided_by
    assert VOCABULARY["bulk_modulus"].is_like(VOCABULARY["line_volume"], Likeness.SAME)


@pytest.mark.parametrize("effect", [e for e in VOCABULARY.values() if e.parameters], ids=lambda e: e.id)
def test_off_changes_nothing(effect: Effect) -> None:
    worn = [sized("orifice_area", v_H=0.2), sized("rail_pressure_sensor_offset", o=1e6)]
    for others in ([], worn):
        without = numbers(effective_model(NOMINAL, others))
        assert numbers(effective_model(NOMINAL, [*others, sized(effect.id)])) == without


@effects
@pytest.mark.parametrize("share", [0.1, 0.9])
def test_every_effect_does_something(effect: Effect, share: float) -> None:
    assert numbers(effective_model(NOMINAL, [at(effect, share)])) != numbers(effective_model(NOMINAL))


def test_nominal_model_is_that_of_the_paper() -> None:
    model = effective_model(NOMINAL)
    assert model.coefficients == coefficients(NOMINAL)
    assert (model.inputs, model.sensor) == (TRUE_INPUTS, SensorTerms(0.0, 0.0, 0.0))


@given(st.sampled_from(list(combinations(VOCABULARY.values(), 2))), st.floats(0.05, 0.95), st.floats(0.05, 0.95))
def test_order_does_not_matter(pair: tuple[Effect, Effect], share: float, other_share: float) -> None:
    first, second = at(pair[0], share), at(pair[1], other_share)
    turned = numbers(effective_model(NOMINAL, [second, first]))
    assert numbers(effective_model(NOMINAL, [first, second])) == pytest.approx(turned, rel=1e-12)


@given(st.floats(-0.33, 1.0))
def test_stiffness_and_volume_of_the_line_cannot_be_told_apart(r: float) -> None:
    stiffer = effective_model(NOMINAL, [sized("bulk_modulus", r=r)]).coefficients
    smaller = effective_model(NOMINAL, [sized("line_volume", r=1 / (1 + r) - 1)]).coefficients
    # compression only counts what learned air means, in units of K_L
    assert (stiffer.line, stiffer[1:-1]) == (pytest.approx(smaller.line, rel=1e-12), smaller[1:-1])


def test_of_fuel_that_stiffens_the_stiffness_without_pressure_changes_as_with_the_temperature() -> None:
    fluid = NOMINAL.fluid.model_copy(update={"bulk_modulus_by_pressure": 10.5})
    softer = effective_model(NOMINAL.model_copy(update={"fluid": fluid}), [sized("bulk_modulus", r=-0.1)])
    stiffness = softer.injector.fluid.in_line.stiffness(150e6) + softer.departures.stiffness_slope * 50e6
    assert stiffness == pytest.approx(0.9 * fluid.bulk_modulus_line + 10.5 * 150e6, rel=1e-12)


def test_what_is_added_is_relative_to_what_is_in_force() -> None:
    twice = effective_model(NOMINAL, [sized("orifice_area", v_H=0.2), sized("orifice_area", v_H=0.1)])
    assert twice.coefficients.sac.a6 == pytest.approx(1.2 * 1.1 * coefficients(NOMINAL).sac.a6)
    twice = effective_model(
        NOMINAL, [sized("line_pressure_sensor_lag", tau=10e-6), sized("line_pressure_sensor_lag", tau=5e-6)]
    )
    assert twice.sensor.lag == pytest.approx(15e-6)


def test_misspelt_names_are_refused() -> None:
    with pytest.raises(KeyError):
        sized("orifice_aria")
    with pytest.raises(KeyError, match="v_S"):
        sized("orifice_area", v_S=0.1)


def test_leak_grows_with_the_line_s_stiffness() -> None:
    """p_L' gets -K_L/V_L c (p_L - p_C): 3e-14 m3/(s Pa) at 100 MPa are 3 mm3/ms, 53.3 1/s of x_1."""
    leak = sized("guide_leakage", c=3e-14)
    assert effective_model(NOMINAL, [leak]).coefficients.line.leak == pytest.approx(1.6e9 / 0.9e-6 * 3e-14)
    stiffer = effective_model(NOMINAL, [leak, sized("bulk_modulus", r=0.5)]).coefficients
    assert stiffer.line.leak == pytest.approx(1.5 * 1.6e9 / 0.9e-6 * 3e-14)
    assert math.isclose(stiffer.line.a1, 1.5 * coefficients(NOMINAL).line.a1)
