"""Terms in the words of an engineer."""

from dataclasses import replace

import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.report.text import standing_words
from observer_rt.identification.discovery.search.hypothesis import Hypothesis
from observer_rt.identification.discovery.search.results import (
    Candidate,
    Consequence,
    Part,
    Proposal,
    Refusal,
)
from observer_rt.identification.discovery.words.law_words import as_if
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import FormNumber, term_effect
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation

LARGEST_LIFT = 0.3e-3  # m


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
            "the fuel in the line were stiffer by 7.5 % round a line pressure of 95 MPa, within 15 MPa",
        ),
        (
            "chamber_pressure",
            "c*(exp(-(time_since_opening/1)/0.53)*sin(6.283185307*1.5*(time_since_opening/1) + (-0.1)))",
            5.7,
            "the pressure in the chamber were 5.7 MPa higher at most, ringing at 1.5 kHz after every opening "
            "for 0.53 ms",
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
        (
            "line_flow",
            "c*max(line_flow/60 - 0.4217, 0)",
            8.34,
            "the line lost 0.139 MPa more per mm³/ms of flow through the line above 25.3 mm³/ms",
        ),
        (
            "line_flow",
            "c*(max(line_flow/60 - 0.4217, 0) - max(-(line_flow/60) - 0.4217, 0))",
            8.34,
            "the line lost 0.139 MPa more per mm³/ms of flow through the line above 25.3 mm³/ms, either way",
        ),
        (
            "rail_pressure",
            "c*max(0.3 - (line_pressure - 100)/50, 0)",
            1.0,
            "the rail pressure were 0.02 MPa higher than measured per MPa of line pressure below 115 MPa",
        ),
        (
            "line_flow",
            "c*(line_flow/60*abs(line_flow/60))",
            0.5,
            "the line lost 0.5 MPa more at a flow through the line of 60 mm³/ms, as its square, either way",
        ),
        (
            "line_pressure",
            "c*(sqrt((line_pressure - chamber_pressure)/100)*closed)",
            0.907,
            "0.907 mm³/ms left the line beside the nozzle at a pressure above the chamber's of 100 MPa, as its "
            "root while the needle is shut",
        ),
        (
            "needle_lift",
            "c*closed",
            0.0007,
            "the needle stood 0.7 µm higher than measured while the needle is shut",
        ),
        (
            "needle_lift",
            "c*(needle_lift/max_lift - lagged(needle_lift/max_lift, 0.2))",
            -0.081,
            "the needle stood 81 µm lower than measured right after it rose by the whole lift, fading in 0.2 ms, "
            "and the other way after it fell",
        ),
        (
            "seat_flow",
            "c*exp(-((needle_lift/max_lift - 0.466)/0.138)^2)",
            -0.334,
            "the seat let 33.4 % less through round a needle lift of 0.14 mm, within 0.041 mm",
        ),
        (
            "seat_flow",
            "c*exp(-(time_since_opening/1)/0.3)",
            0.2,
            "the seat let 20 % more through at every opening, fading in 0.3 ms",
        ),
        (
            "nozzle_flow",
            "c*exp(-(needle_lift/max_lift)/0.176)",
            -0.6,
            "the nozzle lost 60 % of its flow at a needle lift of 0 mm, fading over 0.053 mm above",
        ),
        (
            "nozzle_flow",
            "c*(injection_number > 12)",
            -0.15,
            "the nozzle lost 15 % of its flow from the injection after number 12 on",
        ),
        (
            "nozzle_flow",
            "c*((injection_number - 1)/23)",
            -0.23,
            "the nozzle lost 1 % of its flow per injection beyond number 1",
        ),
        (
            "line_flow",
            "c*(line_flow/60*abs(line_flow/60)*exp(-(time_since_opening/1)/0.7))",
            0.5,
            "the line lost 0.5 MPa more at a flow through the line of 60 mm³/ms, as its square, either way, at "
            "every opening, fading in 0.7 ms",
        ),
        (
            "line_flow",
            "c*(line_flow/60*(line_flow/60 < 0))",
            0.6,
            "the line lost 0.01 MPa more per mm³/ms of flow through the line, below a flow through the line of "
            "0 mm³/ms",
        ),
        (
            "seat_flow",
            "c*tanh((0.15 - needle_lift)/0.02)",
            0.1,
            "the seat let 10 % less through far above a needle lift of 0.15 mm, and the other way far below",
        ),
        (
            "nozzle_flow",
            "c*(0.6 - time_since_opening > 0)*open",
            0.1,
            "the nozzle let 10 % more through below 0.6 ms after the opening while the needle is open",
        ),
        ("nozzle_flow", "c*1", 0.1, "the nozzle let 10 % more through all the time"),
        (
            "line_pressure_sensor",
            "c*table((line_pressure - 100)/50, -1, 0.5, -0.2, 0)",
            -2.0,
            "the line-pressure sensor read more, by [MPa] -1 at 50, 0 at 90 of line pressure [MPa], straight "
            "between",
        ),
    ],
)
def test_simple_laws_are_told_in_words(equation: str, law: str, c: float, words: str) -> None:
    assert as_if(Term(TermEquation(equation), parse(law), c), LARGEST_LIFT) == words


def test_an_amount_has_the_digits_that_its_interval_supports() -> None:
    law = Term(TermEquation.NOZZLE_FLOW, parse("c*open"), -0.15034)
    told = as_if(replace(law, interval=(-0.1523, -0.1483)))
    assert told == "the nozzle lost 15.0 % of its flow while the needle is open"
    assert "lost 15 %" in as_if(replace(law, interval=(-0.18, -0.12)))


def test_a_lift_is_a_share_where_the_largest_is_not_known() -> None:
    law = parse("c*max(needle_lift/max_lift - 0.466, 0)")
    told = as_if(Term(TermEquation.SEAT_FLOW, law, -0.3))
    assert "needle lift over the largest above 0.466" in told


def test_any_other_law_stands_as_it_is() -> None:
    law = parse("c*(line_flow/60)*abs(lift_rate)")
    told = as_if(Term(TermEquation.LINE_FLOW, law, 0.3))
    assert told == f"the line lost more pressure, by {law} with c = 0.3 MPa"


FREE = term_effect(TermEquation.SEAT_FLOW, "exp(-time_since_opening/A)", (FormNumber(0.3, 0.1, 1.0),))
LEAK = term_effect(TermEquation.LINE_PRESSURE, "closed")
FALLS = Refusal("line_pressure = closed feeds back", "correct the law")
MOST = Part(0.9, 0.2e6, 0.013)


def _proposal(*effects: Effect, adequate: bool = True, unsound: Refusal | None = None) -> Proposal:
    found = Candidate(Hypothesis(effects), (0.1,) * len(effects), 0.0, (0.01,) * len(effects))
    return Proposal(found, 0.0, Phase.OPEN, adequate, unsound, (0.0, 0.0), Consequence(0.0, 0.0))


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
    one = _proposal(*effects, adequate=adequate, unsound=unsound)
    told = standing_words(one)
    assert words in told
    assert one.may_enter == ("no model may have it" not in told)


def test_a_proposal_that_leaves_something_says_what_it_may_be_accepted_for() -> None:
    one = replace(_proposal(LEAK, adequate=False), part=MOST)
    assert "closes 90% of the gap: a model may have it in part, masses ±1.3%" in standing_words(one)
    refused = replace(one, part=replace(MOST, refusal=Refusal("it closes 40%", "record more")))
    assert "no model may have it, for it closes 40%: record more" in standing_words(refused)
