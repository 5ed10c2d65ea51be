"""Names and laws in one search: what each is worth beside the others."""

import numpy as np
import pytest

from observer_rt.config.effects import term_domain
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.discovery.search.library import RecordingSpan, library, span_of
from observer_rt.identification.discovery.search.results import HIGHEST_PROBABILITY, Discovery, Verdict, probabilities
from observer_rt.identification.discovery.search.verdict import name_effects
from observer_rt.identification.likelihood.likelihood import JudgedModel, joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.terms.bounds import refuse_unbounded
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.hidden import MODEL, NOMINAL, effect_of, recordings

POINTS = tuple((pressure, opened) for pressure in (60e6, 100e6, 140e6) for opened in (0.6e-3, 1.9e-3))


def _discovered(equation: TermEquation, law: str) -> Discovery:
    hidden = SizedEffect(effect_of(Term(equation, parse(law))), ())
    return name_effects(MODEL, measurements(recordings((hidden,), points=POINTS)), workers=2)


@pytest.mark.slow
def test_what_leaves_the_line_while_the_needle_is_open_is_one_law_and_no_two_names() -> None:
    """A seat and an orifice together explain nearly as much, and inject another mass."""
    result = _discovered(TermEquation.LINE_PRESSURE, "2.5[mm3/ms]*open")
    assert result.verdict is Verdict.UNKNOWN
    first = result.proposals[0]
    (term,) = first.terms
    low, high = term.interval or (0.0, 0.0)
    assert (term.equation, low < 2.5 < high) == (TermEquation.LINE_PRESSURE, True)
    assert first.may_enter
    assert result.confidence == pytest.approx(sum(one.probability for one in result.proposals))


@pytest.mark.slow
def test_a_law_may_enter_that_is_unsound_only_where_no_recording_was() -> None:
    result = _discovered(TermEquation.STIFFNESS, "-0.08*((line_pressure - 100)/50)^2")
    first = result.proposals[0]
    (term,) = first.terms
    low, high = first.seen_of_terms["line_pressure"]
    with pytest.raises(UserError, match="not above 0"):
        refuse_unbounded(Term(term.equation, term.law, -0.3), term_domain(NOMINAL))
    assert (term.equation, first.may_enter) == (TermEquation.STIFFNESS, True)
    assert 0.0 < low < 60.0
    assert 140.0 < high < 200.0


@pytest.mark.slow
def test_a_seat_that_is_narrow_at_some_lift_may_be_a_lift_that_reads_too_much_there() -> None:
    """Line pressure tells the two hardly apart: both stand in the answer, each with its mass."""
    result = _discovered(TermEquation.SEAT_FLOW, "-0.35*exp(-((needle_lift/max_lift - 0.466)/0.13)^2)")
    by_equation = {one.terms[0].equation: one for one in result.proposals}
    assert {TermEquation.SEAT_FLOW, TermEquation.NEEDLE_LIFT} <= set(by_equation)
    assert sum(one.probability for one in result.proposals) <= HIGHEST_PROBABILITY


@pytest.mark.slow
def test_a_step_of_stiffness_is_no_name_that_is_a_line_through_its_ends() -> None:
    result = _discovered(TermEquation.STIFFNESS, "0.027*tanh((line_pressure - 100)/15)")
    assert result.verdict is Verdict.UNKNOWN
    assert [term.equation for term in result.proposals[0].terms] == [TermEquation.STIFFNESS]


@pytest.mark.parametrize(("first", "last"), [(2, 2), (1, 3), (2, 4)])
def test_no_law_of_the_injection_number_is_a_constant(first: int, last: int) -> None:
    for effect in library(RecordingSpan(1.0, first, last)):
        law = parse(effect.id.partition(": ")[2])
        if {variable.word for variable in law.variables} == {"injection_number"}:
            values = {law.at({"injection_number": float(n)}).item() for n in range(first, last + 1)}
            assert len(values) > 1, effect.id


def test_no_law_filters_the_noise_of_a_rail_at_rest() -> None:
    at_rest, moving = (list(library(RecordingSpan(1.0, 1, 3, moves))) for moves in (False, True))
    changes = {effect.id for effect in moving} - {effect.id for effect in at_rest}
    assert changes
    assert all("lagged((rail_pressure" in one or "rail_pressure_rate" in one for one in changes)
    span = span_of(joint_likelihood(measurements(recordings()), MODEL))
    assert (span.first, span.injections, span.rail_moves) == (1, 2, False)


def test_what_is_twelve_behind_has_odds_of_one_to_twenty() -> None:
    first, second = probabilities([0.0, 12.0])
    assert first == pytest.approx(0.95 * HIGHEST_PROBABILITY, abs=0.005)
    assert first + second == pytest.approx(HIGHEST_PROBABILITY)


def test_nothing_is_judged_twice_at_the_same_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    likelihood, models = joint_likelihood(measurements(recordings()), MODEL), list[EffectiveModel]()
    judge = likelihood.judge

    def noted(model: EffectiveModel) -> list[JudgedModel] | None:
        models.append(model)
        return judge(model)

    monkeypatch.setattr(likelihood, "judge", noted)
    fitter = Fitter(likelihood, MODEL)
    effects = [VOCABULARY[name] for name in ("orifice_area", "guide_leakage")]
    first = fitter.scores(fitter.nothing(), effects)
    count = len(models)
    assert count > len(effects)
    np.testing.assert_array_equal(fitter.scores(fitter.nothing(), effects).gains, first.gains)
    assert len(models) == count
