"""Laws of two equations that line pressure cannot tell apart are one answer with both masses."""

import re
from dataclasses import replace

import numpy as np
import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.pairs import exchanged, with_alternatives
from observer_rt.identification.discovery.report.page import report
from observer_rt.identification.discovery.report.text import as_text
from observer_rt.identification.discovery.search.hypothesis import Hypothesis, Sizing
from observer_rt.identification.discovery.search.results import Candidate, Proposal, Unexplained, Verdict
from observer_rt.identification.discovery.search.verdict import consequence
from observer_rt.identification.discovery.words.sentences import alternative_words
from observer_rt.identification.likelihood.bounded_fit import fit
from observer_rt.identification.likelihood.likelihood import Signal, joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import Equation, SizedEffect
from observer_rt.model.effects import effective_model
from observer_rt.model.term_effect import FormNumber, term_effect
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.conftest import WORN_POINTS, Worn
from tests.identification.discovery.hidden import NOMINAL, recordings
from tests.identification.discovery.terms import effect_of

MODEL = effective_model(NOMINAL)
DIP = "exp(-((needle_lift/max_lift - A)/W)^2)"
NUMBERS = (FormNumber(0.466, 0.2, 0.8), FormNumber(0.13, 0.05, 0.4))


def _answered(hidden: Term, equation: TermEquation, form: str, numbers: tuple[FormNumber, ...]) -> Proposal:
    """A proposal of the right law, and what is said beside it."""
    made = recordings((SizedEffect(effect_of(hidden), ()),), points=WORN_POINTS)
    likelihood = joint_likelihood(measurements(made), MODEL)
    hypothesis = Hypothesis((term_effect(equation, form, numbers),))
    sizing = Sizing(likelihood, MODEL, hypothesis)
    found, nothing = fit(sizing, np.array([0.0]), hypothesis.ranges()), sizing.residuals(np.zeros(1))
    assert found is not None
    assert nothing is not None
    statistic = found.statistic
    candidate = Candidate(hypothesis, tuple(found.theta), statistic, (0.01,))
    measured = [recorded.measurement for recorded in likelihood.recordings]
    candidate = replace(candidate, moves=consequence(measured, MODEL, candidate.model(MODEL)))
    proposal = Proposal(candidate, nothing.statistic - statistic, Phase.OPEN, True, None, (1e6, 2e5))
    (judged,) = with_alternatives([proposal], likelihood, MODEL)
    return judged


def test_a_seat_that_is_narrow_at_some_lift_may_be_a_lift_that_reads_too_much_there() -> None:
    law = parse("-0.35*exp(-((needle_lift/max_lift - 0.466)/0.13)^2)")
    one = _answered(Term(TermEquation.SEAT_FLOW, law), TermEquation.SEAT_FLOW, DIP, NUMBERS)
    by_equation = {other.terms[0].equation: other for other in one.alternatives}
    assert TermEquation.NEEDLE_LIFT in by_equation
    other = by_equation[TermEquation.NEEDLE_LIFT]
    assert other.moves.mass == pytest.approx(one.found.moves.mass, rel=0.3)
    words = alternative_words(other, NOMINAL.seat.max_lift)
    assert "the needle stood" in words
    assert "mg: line pressure cannot tell the two apart" in words


def test_both_stand_in_the_answer(worn: Worn) -> None:
    law = parse("-0.35*exp(-((needle_lift/max_lift - 0.466)/0.13)^2)")
    one = _answered(Term(TermEquation.SEAT_FLOW, law), TermEquation.SEAT_FLOW, DIP, NUMBERS)
    place = Unexplained(Equation.SAC_PRESSURE, Phase.OPEN, Signal.LINE_PRESSURE, (), "more than modelled")
    findings = replace(
        worn.findings,
        verdict=Verdict.UNKNOWN,
        effects=(),
        unexplained=place,
        proposals=(one,),
        amended_model=None,
    )
    for told in (as_text(findings).splitlines()[0], report(findings)):
        assert re.search(r"as if the seat let .* less through .*, or as if the needle stood", told)


def test_who_knows_better_takes_the_other_one() -> None:
    law = parse("-0.35*exp(-((needle_lift/max_lift - 0.466)/0.13)^2)")
    one = _answered(Term(TermEquation.SEAT_FLOW, law), TermEquation.SEAT_FLOW, DIP, NUMBERS)
    other = exchanged(one, 1, "needle_lift", MODEL)
    assert [term.equation for term in other.terms] == [TermEquation.NEEDLE_LIFT]
    assert other.gain == pytest.approx(one.gain, abs=100.0)
    assert {each.terms[0].equation for each in other.alternatives} >= {TermEquation.SEAT_FLOW}
    back = exchanged(other, 1, "seat_flow", MODEL)
    assert back.found == one.found
    with pytest.raises(UserError, match=r"there are laws of .*needle_lift"):
        exchanged(one, 1, "stiffness", MODEL)


def test_what_line_pressure_tells_apart_is_no_alternative() -> None:
    """A nozzle that changes with time is no chamber that does: its masses are others, and so are the pressures."""
    hidden = Term(TermEquation.NOZZLE_FLOW, parse("-0.2*(injection_number > 1)"))
    one = _answered(hidden, TermEquation.NOZZLE_FLOW, "injection_number > 1", ())
    assert one.alternatives == ()
