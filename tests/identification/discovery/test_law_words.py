"""Laws in the words of an engineer."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.identification.discovery.law_words import as_if, law_text
from observer_rt.identification.discovery.report.text import standing_words
from observer_rt.identification.discovery.search.proposal import Part, Refusal
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.parser import FormNumber, parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.hidden import proposal_of

LARGEST_LIFT = 0.3e-3  # m
GOLDEN = (Path(__file__).parent / "laws.txt").read_text("utf-8")
CASES = re.findall(r"^(\w+); (.+); (\S+)\n  (.+)$", GOLDEN, re.MULTILINE)


@pytest.mark.parametrize(("equation", "law", "c", "words"), CASES)
def test_simple_laws_are_told_in_words(equation: str, law: str, c: str, words: str) -> None:
    term = Term(TermEquation(equation), parse(law), float(c))
    assert as_if(term, LARGEST_LIFT) == words


def test_an_amount_has_the_digits_that_its_interval_supports() -> None:
    law = Term(TermEquation.NOZZLE_FLOW, parse("c*open"), -0.15034)
    words = as_if(replace(law, interval=(-0.1523, -0.1483)))
    assert words == "the nozzle lost 15.0 % of its flow while the needle is open"
    assert "lost 15 %" in as_if(replace(law, interval=(-0.18, -0.12)))


def test_a_lift_is_a_share_where_the_largest_is_not_known() -> None:
    law = parse("c*max(needle_lift/max_lift - 0.466, 0)")
    words = as_if(Term(TermEquation.SEAT_FLOW, law, -0.3))
    assert "needle lift over the largest above 0.466" in words


def test_a_law_as_a_file_has_it_states_its_interval() -> None:
    term = Term(TermEquation.LINE_PRESSURE, parse("c*closed"), 1.5, (1.4, 1.6))
    assert law_text(term) == "line_pressure = c * closed, c = 1.50 mm³/ms (95 %: 1.40 to 1.60)"


FREE = term_effect(TermEquation.SEAT_FLOW, "exp(-time_since_opening/A)", (FormNumber(0.3, 0.1, 1.0),))
LEAK = term_effect(TermEquation.LINE_PRESSURE, "closed")
FALLS = Refusal("line_pressure = closed feeds back", "correct the law")
MOST = Part(0.9, 0.2e6, 0.013)


@pytest.mark.parametrize(
    ("effects", "adequate", "unsound", "words"),
    [
        ((LEAK,), True, None, "explains all"),
        ((LEAK,), False, None, "it leaves something unexplained: record more rail pressures"),
        ((LEAK, LEAK, LEAK), True, None, "so many laws together would fit anything: record more"),
        ((LEAK, FREE), True, None, "laws with numbers of their own in several equations"),
        ((LEAK,), True, FALLS, "for line_pressure = closed feeds back: correct the law"),
    ],
)
def test_a_refused_proposal_says_why_and_what_to_do(
    effects: tuple[Effect, ...], adequate: bool, unsound: Refusal | None, words: str
) -> None:
    proposal = proposal_of(*effects, adequate=adequate, unsound=unsound)
    sentence = standing_words(proposal)
    assert words in sentence
    assert proposal.may_enter == ("no model may have it" not in sentence)


def test_a_proposal_that_leaves_something_says_what_it_may_be_accepted_for() -> None:
    proposal = replace(proposal_of(LEAK, adequate=False), part=MOST)
    assert "closes 90% of the gap: a model may have it in part, masses ±1.3%" in standing_words(proposal)
    refused = replace(proposal, part=replace(MOST, refusal=Refusal("it closes 40%", "record more")))
    assert "no model may have it, for it closes 40%: record more" in standing_words(refused)
