"""Combinations of effects as parameter vectors, and what they say of themselves."""

import pytest

from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.search import indistinguishable, representatives
from observer_rt.model.effect import Effect
from observer_rt.model.effects import VOCABULARY, seen_in
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.term import TermEquation

BOTH = Hypothesis((VOCABULARY["lift_dependent_seat_coefficient"], VOCABULARY["line_friction"]))
RISE = VOCABULARY["chamber_pressure_rise"]  # of two sizes
LAW = term_effect(TermEquation.NOZZLE_FLOW, "needle_lift/max_lift")


@pytest.mark.parametrize(("friction", "plausible"), [(0.1, True), (1e-6, False), (10.0, False)])
def test_a_size_that_matters_and_no_bound_holds_back_is_plausible(friction: float, plausible: bool) -> None:
    assert Candidate(BOTH, (0.3, 200e-6, friction), 0.0).plausible == plausible


@pytest.mark.parametrize("has_lift", [True, False])
def test_every_class_has_one_representative(has_lift: bool) -> None:
    chosen = {effect.id for effect in representatives(has_lift)}
    for effect in seen_in(has_lift):
        assert len(chosen & {effect.id, *indistinguishable(effect)}) == 1
    assert representatives(has_lift, stiffens=True) == seen_in(has_lift)


@pytest.mark.parametrize(
    ("effects", "sizes", "half"),
    [((RISE, LAW), (8e6, 0.5, -0.2), (1e5, 0.1, 0.05)), ((LAW, RISE), (-0.2, 8e6, 0.5), (0.05, 1e5, 0.1))],
)
def test_a_law_has_its_own_size_beside_an_effect_of_two(
    effects: tuple[Effect, ...], sizes: tuple[float, ...], half: tuple[float, ...]
) -> None:
    (term,) = Candidate(Hypothesis(effects), sizes, 0.0, half=half).terms
    assert (term.equation, term.coefficient) == (TermEquation.NOZZLE_FLOW, -0.2)
    assert term.interval == pytest.approx((-0.25, -0.15))
    (term,) = Candidate(Hypothesis(effects), sizes, 0.0, half=(float("inf"),) * 3).terms
    assert term.interval == TermEquation.NOZZLE_FLOW.bounds
    (term,) = Candidate(Hypothesis(effects), sizes, 0.0).terms
    assert term.interval is None
