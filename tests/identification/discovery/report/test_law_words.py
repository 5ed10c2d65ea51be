"""Terms in the words of an engineer."""

import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.report.text import as_if, standing_words
from observer_rt.identification.discovery.search.hypothesis import Hypothesis
from observer_rt.identification.discovery.search.results import Candidate, Consequence, Proposal, Refusal
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import FormNumber, term_effect
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation


@pytest.mark.parametrize(
    ("equation", "law", "c", "words"),
    [
        (
            "nozzle_flow",
            "c*((1 + tanh((time_since_opening/1 - 0.605)/0.008))/2)",
            -0.2126,
            "the nozzle lost 21.3 % of its flow from 0.605 ms after the opening on",
        ),
        (
            "stiffness",
            "c*exp(-(((line_pressure - 100)/50 - -0.1)/0.3)^2)",
            0.075,
            "the fuel in the line were stiffer by 7.5 % round a line pressure of 95 MPa",
        ),
        (
            "chamber_pressure",
            "c*(exp(-(time_since_opening/1)/0.53)*sin(6.283185307*1.5*(time_since_opening/1) + (-0.1)))",
            5.7,
            "in the chamber were 5.7 MPa higher at most, ringing at 1.5 kHz after every opening for 0.53 ms",
        ),
        (
            "rail_pressure",
            "c*sin(6.283185307*2791.05[Hz]*time + 0.06)",
            -0.4,
            "the rail pressure were 0.4 MPa lower than measured and back, a wave of 2791.05 Hz",
        ),
        (
            "line_pressure_sensor",
            "c*ringing(line_pressure/1, 7.39, 0.1476)",
            1.011,
            "a tube before the line-pressure sensor rang at 7.39 kHz with a damping of 0.148",
        ),
        (
            "line_pressure",
            "c*closed",
            1.5,
            "1.5 mm³/ms left the line beside the nozzle while the needle is shut",
        ),
        ("line_flow", "c*(line_flow/60)", 0.445, "lost 0.445 MPa more at a flow of 60 mm³/ms, in proportion"),
        (
            "line_pressure",
            "c*(sqrt((line_pressure - chamber_pressure)/100)*closed)",
            0.907,
            "0.907 mm³/ms left the line beside the nozzle at 100 MPa while the needle is shut, as the root",
        ),
        (
            "needle_lift",
            "c*closed",
            0.0007,
            "the needle stood 0.7 µm higher than measured while the needle is",
        ),
        (
            "needle_lift",
            "c*(needle_lift/max_lift - lagged(needle_lift/max_lift, 0.2))",
            -0.081,
            "stood 81 µm lower than measured right after it rose by the whole lift, fading in 0.2 ms",
        ),
        ("seat_flow", "c*exp(-(time_since_opening/1)/0.3)", 0.2, "at every opening, fading in 0.3 ms"),
        ("line_pressure_sensor", "c*(time/0.187)", 2.0, "read 2 MPa more after 0.187 s, growing steadily"),
    ],
)
def test_simple_laws_are_told_in_words(equation: str, law: str, c: float, words: str) -> None:
    told = as_if(Term(TermEquation(equation), parse(law), c), "the law")
    assert words in told
    assert told.endswith(f": {equation} = the law")


def test_any_other_law_stands_as_it_is() -> None:
    term = Term(TermEquation.LINE_FLOW, parse("c*(line_flow/60)*abs(lift_rate)"), 0.3)
    assert as_if(term, "this law") == "the line lost more pressure, by this law"


FREE = term_effect(TermEquation.SEAT_FLOW, "exp(-time_since_opening/A)", (FormNumber(0.3, 0.1, 1.0),))
LEAK = term_effect(TermEquation.LINE_PRESSURE, "closed")
FALLS = Refusal("line_pressure = closed feeds back", "correct the law")


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
    found = Candidate(Hypothesis(effects), (0.1,) * len(effects), 0.0, (0.01,) * len(effects))
    one = Proposal(found, 0.0, Phase.OPEN, adequate, unsound, (0.0, 0.0), Consequence(0.0, 0.0))
    told = standing_words(one)
    assert words in told
    assert one.may_enter == ("no model may have it" not in told)
