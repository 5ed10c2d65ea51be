"""Verdicts on recordings of a simulated injector with effects hidden in it, and measurements that would decide."""

from collections.abc import Callable
from itertools import combinations

import pytest

from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.results import Discovery, Verdict, decide_between, decide_by
from observer_rt.identification.discovery.search.verdict import name_effects
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import VOCABULARY, effective_model, sized
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.term import TermEquation
from tests.identification.discovery.hidden import MODEL, NOMINAL, proposal_of, recordings

NEAR_TIES = {
    ("line_pressure_sensor_lag", "channel_skew"): "one signal",
    ("seat_area", "lift_offset"): "lift sensor",
    ("line_pressure_sensor_offset", "rail_pressure_sensor_offset"): "against a gauge",
    ("fuel_density", "orifice_area"): "mass",
    ("orifice_area", "orifice_cavitation"): "rail pressures",
}


def _discover(
    *effects: SizedEffect,
    measured_rate: bool = False,
    parameters: InjectorParameters = NOMINAL,
    workers: int = 2,
    progress: Callable[[float], None] = lambda _: None,
) -> Discovery:
    return name_effects(MODEL, measurements(recordings(effects, measured_rate, parameters)), workers, progress)


def _holds(discovery: Discovery, effect: SizedEffect) -> bool:
    """Whether the named effect is this one, its interval holding the truth within twice its width."""
    (named,) = discovery.effects
    for parameter, true in zip(effect.effect.parameters, effect.values, strict=True):
        low, high = named.parameters[parameter.name].ci95
        if not low - 0.5 * (high - low) <= true / parameter.si <= high + 0.5 * (high - low):
            return False
    return named.id == effect.effect.id


@pytest.mark.parametrize("measured_rate", [False, True])
def test_nothing_is_named_on_a_healthy_injector(measured_rate: bool) -> None:
    result = _discover(measured_rate=measured_rate)
    assert result.verdict is Verdict.NONE
    assert result.effects == ()
    assert result.confidence > 0.9
    signals = {cell.signal for cell in result.before}
    assert (Signal.INJECTION_RATE in signals) == measured_rate
    assert max(cell.excess for cell in result.before) < 5.0


@pytest.mark.decisive(3)
@pytest.mark.parametrize(
    ("hidden", "measured_rate"),
    [
        (sized("orifice_area", v_H=-0.04), False),
        (sized("channel_skew", d=-17e-6), True),
        (sized("chamber_pressure_rise", dp=4e6, s=1.0), False),
        (sized("guide_leakage", c=6e-14), False),
        (sized("line_pressure_sensor_lag", tau=25e-6), False),
        (sized("lift_offset", x_0=12e-6), False),
        (sized("seat_outflow"), False),
        (sized("orifice_cavitation", n_crit_excess=0.12), True),
        (sized("lift_dependent_seat_coefficient", a=0.4, x_c=40e-6), True),
        (sized("needle_lift_sensor_lag", tau=16e-6), False),
    ],
    ids=lambda value: str(value.effect.id) if isinstance(value, SizedEffect) else "",
)
def test_a_single_effect_is_named(hidden: SizedEffect, measured_rate: bool) -> None:
    result = _discover(hidden, measured_rate=measured_rate)
    assert result.verdict is Verdict.NAMED
    assert _holds(result, hidden)
    assert result.detection.gain > result.detection.threshold
    assert result.confidence > 0.9
    assert result.ranking[0].ids == (hidden.effect.id,)
    assert max(cell.excess for cell in result.before) > 5.0
    assert max(cell.excess for cell in result.after) < 5.0


@pytest.mark.slow
def test_an_effect_too_small_to_matter_is_not_taken_for_another() -> None:
    points = ((60e6, 1.9e-3), (60e6, 0.6e-3), (140e6, 1.9e-3), (140e6, 0.6e-3), (140e6, 1.2e-3))
    discovery = name_effects(
        MODEL, measurements(recordings((sized("channel_skew", d=1.2e-6),), points=points)), workers=2
    )
    nominal = next(one for one in discovery.ranking if not one.ids)
    assert nominal.statistic > discovery.ranking[0].statistic + discovery.detection.threshold  # it shows
    assert discovery.verdict is Verdict.NONE


def test_the_members_of_an_exact_class_count_as_one() -> None:
    result = _discover(sized("line_volume", r=0.1))
    assert result.verdict is Verdict.NAMED
    assert {result.effects[0].id, *result.effects[0].indistinguishable_from} == {"bulk_modulus", "line_volume"}


def test_near_ties_are_ambiguous_with_what_would_decide() -> None:
    result = _discover(sized("seat_area", v_S=0.1))
    assert result.verdict is Verdict.AMBIGUOUS
    listed = {result.effects[0].id, *result.effects[0].indistinguishable_from}
    assert {"seat_area", "lift_gain"} <= listed
    assert result.confidence < 0.8
    (decisive,) = [one for one in result.decide_by if {"seat_area", "lift_gain"} <= set(one.separates)]
    assert "lift sensor" in decisive.measurement


@pytest.mark.slow
def test_two_effects_are_named_together() -> None:
    result = _discover(sized("orifice_area", v_H=0.1), sized("line_friction", k=0.5))
    assert result.verdict is Verdict.NAMED
    sizes = {one.id: size for one in result.effects for size in one.parameters.values()}
    assert sizes.keys() == {"orifice_area", "line_friction"}
    assert sizes["orifice_area"].value == pytest.approx(0.1, abs=0.01)
    assert sizes["line_friction"].value == pytest.approx(0.5, abs=0.03)
    assert all(one.gain > result.detection.threshold for one in result.effects)
    assert 0.9 < sum(one.gap_share for one in result.effects) <= 1.0


@pytest.mark.slow
def test_a_pair_without_the_best_single_is_found() -> None:
    """A nozzle that passes less stands in for both, and explains the recordings well enough alone."""
    points = tuple((pressure, opened) for pressure in (60e6, 100e6, 140e6) for opened in (0.6e-3, 1.9e-3))
    hidden = sized("chamber_pressure_rise", dp=4e6, s=1.0), sized("orifice_cavitation", n_crit_excess=0.1)
    discovery = name_effects(MODEL, measurements(recordings(hidden, points=points)), workers=2)
    singles = [one for one in discovery.ranking if len(one.ids) == 1 and not one.terms]
    assert singles[0].ids == ("orifice_area",)
    assert {effect.id for effect in discovery.effects} == {effect.effect.id for effect in hidden}
    assert discovery.verdict is Verdict.NAMED


@pytest.mark.slow
def test_what_is_not_in_the_vocabulary_is_unknown() -> None:
    larger_sac = NOMINAL.model_copy(
        update={"nozzle": NOMINAL.nozzle.model_copy(update={"sac_volume": 2.5 * NOMINAL.nozzle.sac_volume})}
    )
    result = _discover(measured_rate=True, parameters=larger_sac)
    assert result.verdict is Verdict.UNKNOWN
    assert result.effects == ()
    assert result.unexplained is not None
    assert result.unexplained.term


@pytest.mark.slow
def test_a_search_in_one_thread_ends_as_one_of_two_threads() -> None:
    hidden, shares = sized("entrained_air", g=1e-3), list[float]()
    assert _discover(hidden, workers=1) == _discover(hidden, progress=shares.append)
    assert (shares, shares[-1]) == (sorted(shares), 1.0)


def test_a_sample_rate_too_low_for_the_model_is_refused() -> None:
    stiff = NOMINAL.model_copy(update={"fluid": NOMINAL.fluid.model_copy(update={"bulk_modulus_sac": 1e12})})
    with pytest.raises(UserError, match="integration steps"):
        name_effects(effective_model(stiff), measurements(recordings(points=((100e6, 1e-3),))))


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
    assert {effect for one in decisive for effect in one.separates} == {"seat_area", "lift_gain", "lift_offset"}
    assert decide_by(("seat_area",)) == ()


@pytest.mark.parametrize(
    ("term_equation", "other", "word"),
    [
        (TermEquation.NEEDLE_LIFT, TermEquation.LINE_PRESSURE, "mass"),
        (TermEquation.NOZZLE_FLOW, TermEquation.CHAMBER_PRESSURE, "another chamber pressure"),
        (TermEquation.RAIL_PRESSURE, TermEquation.LINE_PRESSURE_SENSOR, "gauge"),
        (TermEquation.LINE_FLOW, TermEquation.STIFFNESS, "rail pressures"),
    ],
)
def test_proposals_have_a_deciding_measurement(term_equation: TermEquation, other: TermEquation, word: str) -> None:
    both = VOCABULARY["orifice_area"]
    (decisive,) = decide_between(
        [proposal_of(term_effect(term_equation, "1"), both), proposal_of(both, term_effect(other, "1"))]
    )
    assert decisive.separates == ("proposal 1", "proposal 2")
    assert word in decisive.measurement
