"""Proposals that leave something: what a model may have of them, and what it states then."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.search.hypothesis import Hypothesis, Sizing
from observer_rt.identification.discovery.search.in_part import LEAST_CLOSED, with_parts
from observer_rt.identification.discovery.search.results import Candidate, Proposal
from observer_rt.identification.likelihood.bounded_fit import fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood, joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.open_loop import Consequence, consequence
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.conftest import WORN_POINTS
from tests.identification.discovery.hidden import NOMINAL, recordings
from tests.identification.discovery.terms import effect_of

MODEL = effective_model(NOMINAL)
NOZZLE = term_effect(TermEquation.NOZZLE_FLOW, "open")
GAP = 1.0e6  # Pa, held out before
LOST = 1e-6  # kg


def _likelihood(*laws: str) -> JointLikelihood:
    """Four operating points; laws: of the nozzle, of all of them, or one a point."""
    made = []
    for number, point in enumerate(WORN_POINTS):
        law = parse(laws[number % len(laws)])
        hidden = SizedEffect(effect_of(Term(TermEquation.NOZZLE_FLOW, law)), ())
        made += recordings((hidden,), points=(point,), seed=number + 1)
    return joint_likelihood(measurements(made), MODEL)


@pytest.fixture(scope="module")
def likelihood() -> JointLikelihood:
    return _likelihood("-0.2*open")


def _proposal(likelihood: JointLikelihood, left: float = 0.25 * GAP, mass: float = -LOST) -> Proposal:
    """A nozzle that loses flow while it is open, fitted; left: of the gap [Pa]."""
    hypothesis = Hypothesis((NOZZLE,))
    minimum = fit(Sizing(likelihood, MODEL, hypothesis), np.array([-0.1]), hypothesis.ranges())
    assert minimum is not None
    candidate = Candidate(hypothesis, tuple(minimum.theta.tolist()), minimum.statistic, half=(0.002,))
    return Proposal(
        replace(candidate, moves=Consequence(1e6, mass)), 1e4, Phase.OPEN, False, None, (GAP, left)
    )


def test_what_closes_most_of_the_gap_may_enter_in_part(likelihood: JointLikelihood) -> None:
    (proposal,) = with_parts([_proposal(likelihood)], likelihood, MODEL)

    assert proposal.part is not None
    assert proposal.part.refusal is None
    assert proposal.may_enter
    assert LEAST_CLOSED < proposal.part.closed < 1.0


def test_the_interval_is_that_of_a_nozzle_that_leaves_as_much(likelihood: JointLikelihood) -> None:
    (proposal,) = with_parts([_proposal(likelihood)], likelihood, MODEL)
    assert proposal.part is not None
    measured = [recorded.measurement for recorded in likelihood.recordings]
    wider = MODEL.with_term(Term(TermEquation.NOZZLE_FLOW, parse("0.05")))
    moved = consequence(measured, MODEL, wider)
    share = proposal.part.mass_half * moved.line_pressure / proposal.part.left
    assert share == pytest.approx(0.05, rel=0.2)  # of a mass, by a nozzle of 5 % more


def test_what_closes_less_than_two_thirds_is_refused(likelihood: JointLikelihood) -> None:
    (proposal,) = with_parts([_proposal(likelihood, left=0.6 * GAP)], likelihood, MODEL)
    assert proposal.part is not None
    assert proposal.part.refusal is not None
    assert "not two thirds" in proposal.part.refusal.reason


def test_a_rival_with_another_mass_is_a_reason_to_refuse(likelihood: JointLikelihood) -> None:
    first, second = _proposal(likelihood), _proposal(likelihood, mass=-12.0 * LOST)
    judged, _ = with_parts([first, second], likelihood, MODEL)
    assert judged.part is not None
    assert judged.part.refusal is not None
    assert "would inject -11 mg" in judged.part.refusal.reason


@pytest.mark.parametrize("changes", [{"adequate": True}, {"held_out": (float("nan"), float("nan"))}])
def test_nothing_is_accepted_in_part_that_explains_all_or_was_not_held_out(
    likelihood: JointLikelihood, changes: dict[str, object]
) -> None:
    (proposal,) = with_parts([replace(_proposal(likelihood), **changes)], likelihood, MODEL)  # type: ignore[arg-type]
    assert proposal.part is None
