"""What would tell effects apart."""

from itertools import combinations

import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.results import Proposal
from observer_rt.identification.discovery.search.verdict import decide_between, decide_by
from observer_rt.model.effect import Effect
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.term import TermEquation

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


def proposal(*effects: Effect) -> Proposal:
    result = Candidate(Hypothesis(effects), (0.1,) * len(effects), 0.0)
    return Proposal(result, 0.0, Phase.OPEN, True, None, (0.0, 0.0))


@pytest.mark.parametrize(
    ("term_equation", "other", "word"),
    [
        (TermEquation.NEEDLE_LIFT, TermEquation.LINE_PRESSURE, "mass"),
        (TermEquation.NOZZLE_FLOW, TermEquation.CHAMBER_PRESSURE, "another chamber pressure"),
        (TermEquation.RAIL_PRESSURE, TermEquation.LINE_PRESSURE_SENSOR, "gauge"),
        (TermEquation.LINE_FLOW, TermEquation.STIFFNESS, "rail pressures"),
    ],
)
def test_proposals_have_a_measurement_that_decides(
    term_equation: TermEquation, other: TermEquation, word: str
) -> None:
    both = VOCABULARY["orifice_area"]
    (decisive,) = decide_between(
        [proposal(term_effect(term_equation, "1"), both), proposal(both, term_effect(other, "1"))]
    )
    assert decisive.separates == ("proposal 1", "proposal 2")
    assert word in decisive.measurement
