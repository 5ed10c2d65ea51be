"""Terms: their units and that of `c`, what they may do to the model."""

import pickle
import re

import pytest

from observer_rt.foundation.errors import UserError
from observer_rt.model.terms.bounds import TermDomain, refuse_unbounded
from observer_rt.model.terms.in_force import coefficient_unit
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation

CELLS = TermDomain(0.24, in_cells=True)
DOMAIN = TermDomain(0.24, friction=3e-4)
SPIKE = "1000 * exp(-((line_pressure - 100.0371) / 0.0005)^2)"


def term(equation: str, law: str, c: float = 1.0) -> Term:
    return Term(TermEquation(equation), parse(law), c)


@pytest.mark.parametrize(
    ("equation", "law", "unit"),
    [
        ("line_pressure", "c * sqrt(line_pressure - chamber_pressure) * closed", "mm3/ms/MPa^0.5"),
        ("line_flow", "c * line_flow * abs(line_flow)", "ms^2*MPa/mm^6"),
        ("nozzle_flow", "c * (line_pressure / 100[MPa] - 1)", "-"),
        ("nozzle_flow", "exp(c * line_pressure) - 1", "1/MPa"),
        ("nozzle_flow", "0.1 * tanh(line_pressure / c)", "MPa"),
        ("needle_lift", "min(c, needle_lift)", "mm"),
        ("needle_lift", "lagged(c * lift_rate, 0.1)", "ms"),
        ("seat_flow", "(needle_lift > c) * 0.1", "mm"),
        ("line_pressure_sensor", "c * time", "MPa/s"),
        ("chamber_pressure", "c^2", "MPa^0.5"),
        ("line_pressure", "table(c * line_pressure, 0, 1, 2, 3[mm3/ms])", "None"),
        ("line_pressure", "c * table(line_pressure, 0, 1[mm], 2[bar], 3[mm])", "mm2/ms"),
        ("line_pressure_sensor", "2 * c * time", "None"),
    ],
)
def test_unit_of_the_coefficient(equation: str, law: str, unit: str) -> None:
    assert str(coefficient_unit(TermEquation(equation), parse(law))) == unit


@pytest.mark.parametrize(
    ("equation", "law", "said"),
    [
        ("nozzle_flow", "line_pressure + line_flow", "'line_pressure' is in MPa, 'line_flow' is in mm3/ms"),
        ("nozzle_flow", "exp(line_pressure)", "what exp() takes is in -"),
        ("nozzle_flow", "line_pressure", "what nozzle_flow adds is in -"),
        ("line_flow", "line_pressure / 3[MPa]", "what line_flow adds is in MPa"),
        ("nozzle_flow", "needle_lift > 3[MPa]", "'3[MPa]' is in MPa"),
        ("nozzle_flow", "c * line_pressure + c * line_flow", "'c * line_flow'"),
        ("nozzle_flow", "exp(c * line_pressure) + c * line_flow", "'c * line_flow'"),
        ("nozzle_flow", "(time - time_since_opening) * 1[Hz]", "'time' is in s, 'time_since_opening' is in ms"),
        ("nozzle_flow", "table(line_pressure, 0, 1, 2[mm], 3)", "the point 2[mm] is in mm"),
        ("nozzle_flow", "table(open, 0, 1[mm], 1, 3[MPa])", "3[MPa] is in MPa"),
        ("nozzle_flow", "max(open, lift_rate)", "'lift_rate' is in mm/ms"),
    ],
)
def test_units_that_do_not_fit(equation: str, law: str, said: str) -> None:
    with pytest.raises(UserError, match=f"{re.escape(said)}(?s:.*)\n  remedy: ."):
        coefficient_unit(TermEquation(equation), parse(law))


@pytest.mark.parametrize(
    ("equation", "law", "c"),
    [
        ("line_flow", "c * line_flow * abs(line_flow)", 1e-3),
        ("line_flow", "c * line_flow * abs(line_flow)", -1e-4),  # two thirds of the line's own
        ("line_flow", "c * line_flow", -0.004),
        ("line_flow", "c * (line_flow - lagged(line_flow, 0.2))", 0.05),
        ("seat_flow", "-0.3 * exp(-needle_lift / 0.05)", 1.0),
        ("nozzle_flow", "c / sqrt((sac_pressure - chamber_pressure) / 100 + 0.2)", 0.2),
        ("stiffness", "c * (line_pressure / 100 - 1)", 0.2),
        ("chamber_pressure", "5 * min(1, needle_lift / 0.08)", 1.0),
        ("line_pressure_sensor", "c * line_pressure_rate", -0.02),
        ("needle_lift", "c * closed", 0.003),
        ("needle_lift", "-0.06 * (needle_lift / max_lift - lagged(needle_lift / max_lift, 0.1))", 1.0),
        ("needle_lift", "0.05 * open", 1.0),
        ("rail_pressure", "50 * (line_flow > 9.0371) - 50 * (line_flow > 9.0371) + 5", 1.0),
    ],
)
def test_sound_terms(equation: str, law: str, c: float) -> None:
    sound_term = term(equation, law, c)
    refuse_unbounded(sound_term, DOMAIN)
    assert pickle.loads(pickle.dumps(sound_term)) == sound_term


@pytest.mark.parametrize(
    ("equation", "law", "c", "said"),
    [
        ("nozzle_flow", "c * (line_pressure / 100 - 1)", -1.0, "1 + term is not above 0, at line_pressure = 2"),
        ("seat_flow", "-1.2 * opening", 1.0, "is -1.2, so that 1 + term is not above 0, at opening = 1"),
        ("inertance", "-1.01 * closed", 1.0, "not above 0"),
        ("inertance", "c * open", 21.0, "times its bound 4"),
        ("stiffness", "0.1 / line_pressure", 1.0, "no finite value at line_pressure = 0"),
        ("stiffness", "exp(line_pressure * 3)", 1.0, "no finite value"),
        ("line_pressure_sensor", "log(line_flow)", 1.0, "no finite value"),
        ("needle_lift", "c * needle_lift", 3.0, "mm, more than 5 times its bound 0.1, at needle_lift = 0.24"),
        ("needle_lift", "0.05", 1.0, "holds a shut needle open by 0.05 mm, more than 0.01"),
        ("rail_pressure", "c * rail_pressure", -0.5, "is -125 MPa"),
        ("line_flow", "-0.006 * line_flow", 1.0, "falls by 0.006 MPa per mm3/ms of line_flow"),
        ("line_flow", "-4e-4 * line_flow * abs(line_flow)", 1.0, "at line_flow = 150"),
        ("line_flow", "-0.006 * lagged(line_flow, 5)", 1.0, "feeds back"),
        ("line_pressure", "-0.11 * line_pressure", 1.0, "falls by 0.11 mm3/ms per MPa of line_pressure"),
        ("line_pressure", "c * sqrt(line_pressure - chamber_pressure)", -0.4, "feeds back"),
        ("line_flow", "line_flow - lagged(line_flow, 0.2) * 2", 1.0, "more than"),
        ("line_pressure_sensor", SPIKE, 1.0, "more than 5 times its bound 10, at line_pressure = 100"),
        ("rail_pressure", "500 * (time < 1) * (abs(line_flow - 9.0371) < 1e-6)", 1.0, "is 500 MPa"),
        (
            "rail_pressure",
            "tanh(1 / (line_flow - rail_pressure + 1e-300))",
            1.0,
            "for '1 / (line_flow - rail_pressure",
        ),
    ],
)
def test_unsound_terms(equation: str, law: str, c: float, said: str) -> None:
    with pytest.raises(UserError, match=f"^{equation}(?s:.*){re.escape(said)}(?s:.*)\n  remedy: ."):
        refuse_unbounded(term(equation, law, c), DOMAIN)


def test_words() -> None:
    leak = Term(TermEquation.LINE_PRESSURE, parse("c*sqrt(line_pressure)"), 0.4, (0.3, 0.5))
    assert str(leak) == (
        "line_pressure: outflow from the line's closed end [mm3/ms] = c * sqrt(line_pressure), c = 0.4 (0.3 to 0.5)"
    )
    assert str(term("nozzle_flow", "0.1*open")).endswith("through the nozzle = 0.1 * open")
    assert str(Term(TermEquation.NOZZLE_FLOW, parse("c*open"))).endswith("c * open, c = 1")
    assert [equation.number for equation in TermEquation] == list(range(10))


def test_what_rings_needs_a_line_that_is_one_lump() -> None:
    ringing = term("line_pressure_sensor", "ringing(line_pressure, 7, 0.15)")
    refuse_unbounded(ringing, DOMAIN)
    with pytest.raises(UserError, match="rings"):
        refuse_unbounded(ringing, CELLS)
    with pytest.raises(UserError, match="times its bound"):
        refuse_unbounded(term("line_pressure_sensor", "5 * ringing(line_pressure, 7, 0.15)"), DOMAIN)
