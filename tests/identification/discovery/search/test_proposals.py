"""Laws are judged where recordings saw their inputs; one that leaves something may be taken in part."""

from dataclasses import replace

import pytest

from observer_rt.config.effects import term_domain
from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.identification.discovery.search.proposals import LEAST_CLOSED, seen_in, unsound, with_parts
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.open_loop import Consequence, consequence
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.bounds import refuse_unbounded
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable
from tests.identification.discovery.conftest import WORN_POINTS
from tests.identification.discovery.hidden import MODEL, NOMINAL, effect_of, recordings

SEEN = seen_in(measurements(recordings()), MODEL)
NOZZLE = term_effect(TermEquation.NOZZLE_FLOW, "open")
GAP = 1.0e6  # Pa, held out before
LOST = 1e-6  # kg


@pytest.mark.parametrize(
    ("equation", "law"),
    [
        ("seat_flow", "-0.4*lift_rate"),  # of the whole flow at 2.5 mm/ms, which no needle here reaches
        ("stiffness", "-0.3*((line_pressure - 100)/50)^2"),
        ("line_flow", "-0.6*line_flow/60*abs(line_flow/60)*((line_pressure - 100)/50)"),
    ],
)
def test_a_law_is_sound_that_is_not_where_no_recording_was(equation: str, law: str) -> None:
    term = Term(TermEquation(equation), parse(law))
    with pytest.raises(UserError):
        refuse_unbounded(term, term_domain(NOMINAL))
    assert unsound([term], MODEL, SEEN) is None


def test_a_law_that_is_unsound_where_it_was_seen_is_refused() -> None:
    refusal = unsound([Term(TermEquation.SEAT_FLOW, parse("-2*lift_rate"))], MODEL, SEEN)
    assert refusal is not None
    assert "1 + term is not above 0" in refusal.reason


def test_the_range_is_that_of_the_recordings() -> None:
    low, high = SEEN[Variable.RAIL_PRESSURE]
    assert low < 60.0 < 140.0 < high < 160.0
    low, high = SEEN[Variable.LIFT_RATE]
    assert -3.0 < low < -0.5
    assert 0.5 < high < 3.0


@pytest.fixture(scope="module")
def measured() -> tuple[Measurement, ...]:
    """Four operating points of a nozzle that loses flow while it is open."""
    hidden = SizedEffect(effect_of(Term(TermEquation.NOZZLE_FLOW, parse("-0.2*open"))), ())
    return measurements(recordings((hidden,), points=WORN_POINTS))


def _proposal(left: float = 0.25 * GAP, mass: float = -LOST) -> Proposal:
    """A nozzle that loses flow; left: of the gap [Pa]."""
    candidate = Candidate(Hypothesis((NOZZLE,)), (-0.2,), 0.0, half=(0.002,))
    return Proposal(replace(candidate, moves=Consequence(1e6, mass)), 1e4, Phase.OPEN, False, None, (GAP, left))


def test_what_closes_most_of_the_gap_may_enter_in_part(measured: tuple[Measurement, ...]) -> None:
    """The interval is that of a nozzle that leaves as much."""
    (proposal,) = with_parts([_proposal()], measured, MODEL)
    assert proposal.part is not None
    assert proposal.part.refusal is None
    assert proposal.may_enter
    assert LEAST_CLOSED < proposal.part.closed < 1.0
    moved = consequence(measured, MODEL, MODEL.with_term(Term(TermEquation.NOZZLE_FLOW, parse("0.05"))))
    share = proposal.part.mass_half * moved.line_pressure / proposal.part.left
    assert share == pytest.approx(0.05, rel=0.2)  # of a mass, by a nozzle of 5 % more


@pytest.mark.parametrize(
    ("proposals", "said"),
    [
        ([_proposal(left=0.364 * GAP)], "it closes 66.4% of the gap held out, less than 66.7%"),
        ([_proposal(), _proposal(mass=-12.0 * LOST)], "would inject -11 mg"),
    ],
)
def test_what_closes_too_little_or_has_a_rival_with_another_mass_is_refused(
    measured: tuple[Measurement, ...], proposals: list[Proposal], said: str
) -> None:
    judged, *_ = with_parts(proposals, measured, MODEL)
    assert judged.part is not None
    assert judged.part.refusal is not None
    assert said in judged.part.refusal.reason


@pytest.mark.parametrize("changes", [{"adequate": True}, {"held_out": (float("nan"), float("nan"))}])
def test_nothing_is_accepted_in_part_that_explains_all_or_was_not_held_out(
    measured: tuple[Measurement, ...], changes: dict[str, object]
) -> None:
    (proposal,) = with_parts([replace(_proposal(), **changes)], measured, MODEL)  # type: ignore[arg-type]
    assert proposal.part is None


def test_laws_that_are_alike_are_no_fit_beside_an_effect_of_two_sizes_or_of_none() -> None:
    fitter = Fitter(joint_likelihood(measurements(recordings()), MODEL), MODEL)
    laws = [term_effect(TermEquation.NOZZLE_FLOW, law) for law in ("open*0.5", "open*0.8")]
    for effect in (VOCABULARY["chamber_pressure_rise"], VOCABULARY["seat_outflow"]):
        single, alike = Hypothesis((effect, laws[0])), Hypothesis((effect, *laws))
        assert [one.ids for one in fitter.laws([(single, single.off), (alike, alike.off)])] == [single.ids]
