"""Laws: read and printed, evaluated, refused."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.foundation.errors import UserError
from observer_rt.model.terms.law import Law
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.variable import VARIABLES, Variable, unit_named
from tests.model.terms.laws import laws, sampled


@given(laws())
def test_what_is_printed_is_read_back(law: Law) -> None:
    text = str(law)
    if len(text) <= 300:
        assert parse(text) == law
        assert (str(parse(text)), pickle.loads(pickle.dumps(law))) == (text, law)
        assert hash(parse(text)) == hash(law)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-0.21 * (injection_number - 1)", -0.42),
        ("2 / 4 / 2", 0.25),
        ("-2^2 + --1", -3.0),
        ("(-2)^2 * 2^-1", 2.0),
        ("2 * -rail_pressure", -200.0),
        ("rail_pressure > 50", 1.0),
        ("(rail_pressure < 50) + 1", 1.0),
        ("sqrt(-9)", -3.0),
        ("min(rail_pressure, 10[bar]) + max(1, 2) + abs(-3)", 6.0),
        ("500[us] + 1[ms]", 1.5),
        ("exp(0) + log(1) + sin(0) + cos(0) + tanh(0)", 2.0),
        (".5e1*c", 20.0),
        ("table(rail_pressure, 0, -3, 900[bar], 4, 110, 6)", 5.0),
        ("table(rail_pressure, 0, 3, 90, 4)", 4.0),
    ],
)
def test_values(text: str, value: float) -> None:
    assert parse(text).at({"rail_pressure": 100.0, "injection_number": 3.0}, 4.0) == pytest.approx(value)


def test_a_lag_follows_by_its_time() -> None:
    law, step = parse("lagged(line_flow, 2)"), np.append([0.0], np.ones(1000))
    lagged = law.at({"line_flow": step}, memory=sampled(0.01))
    assert (lagged[0], lagged[200]) == (0.0, pytest.approx(1.0 - np.exp(-1.0)))
    with pytest.raises(ValueError, match="remembers"):
        law.at({"line_flow": step})


def test_variables_and_coefficient() -> None:
    law = parse("c * sqrt(line_pressure - chamber_pressure) * closed")
    assert {one.word for one in law.variables} == {"line_pressure", "chamber_pressure", "closed"}
    assert law.has_coefficient
    assert not parse("lagged(time, 1)").has_coefficient
    assert parse("1 + lagged(time, 1)").remembers
    assert parse("open - lagged(open, 1)").settled() == parse("open - open")
    assert parse("ringing(lagged(open, 1), 7, 0.1)").settled() == parse("0")


@pytest.mark.parametrize(
    ("text", "part", "said"),
    [
        ("0.2 * line_presure", "'line_presure'", "did you mean 'line_pressure'?"),
        ("0.2 * squrt(open)", "'squrt(open)'", "did you mean 'sqrt'?"),
        ("", "'()'", "is in no law"),
        ("2 * (open + 1", "column", "never closed"),
        ("open^2 + closed closed", "column", "invalid syntax"),
        ("open ^ 2 ^ 2", "'2^2'", "is not an exponent"),
        ("open ^ 2[ms]", "'2[ms]'", "an exponent has no unit"),
        ("1 < 2 < 3", "'1 < 2 < 3'", "is in no law"),
        ("1 + open.real", "'open.real'", "is in no law"),
        ("min(open)", "'min(open)'", "has 1 arguments"),
        ("lagged(open, open)", "'open'", "is not the time of a lag"),
        ("lagged(open, 0)", "'0'", "above 0"),
        ("lagged(open, 3[s])", "'3[s]'", "in ms"),
        ("ringing(open, 7[ms], 0.1)", "'7[ms]'", "in kHz"),
        ("ringing(open, 7)", "'ringing(open, 7)'", "has 2 arguments"),
        ("ringing(open, 7, 1)", "'1'", "below 1"),
        ("2 * 100[MPA]", "'100[MPA]'", "did you mean 'MPa'?"),
        ("1e999", "'1e309'", "smaller number"),
        ("table(open, 0, 1)", "'table(open, 0, 1)'", "two times or more"),
        ("table(open, 0, 1, 0, 2)", "'table(open, 0, 1, 0, 2)'", "do not rise"),
        ("table(open, 0, open, 1, 2)", "'open'", "a point or a value"),
        ("open & 1", "column 6", "'&' is in no law"),
        ("__import__(open)", "'__import__(open)'", "unknown name '__import__'"),
        ("(" * 40 + "1" + ")" * 40, "law", "nests"),
        ("(1) + open) * (open", "law", "closes what is not open"),
        ("1+" * 200 + "1", "law", "longer than 300"),
    ],
)
def test_what_cannot_be_read_is_told_with_its_place(text: str, part: str, said: str) -> None:
    with pytest.raises(UserError) as refused:
        parse(text)
    assert refused.value.location.startswith(part)
    assert said in f"{refused.value.problem} {refused.value.remedy}"


@given(st.text(alphabet="()[]+-*/^<>,.019ec #_\n", max_size=40) | st.text(max_size=12))
def test_any_text_is_a_law_or_refused(text: str) -> None:
    try:
        law = parse(text)
    except UserError:
        return
    assert parse(str(law)) == law


@pytest.mark.parametrize(
    ("text", "scale", "printed"),
    [
        ("mm3/ms/MPa^0.5", 1.0, "mm3/ms/MPa^0.5"),
        ("bar*ms", 0.1, "ms*MPa"),
        ("1/kHz", 1.0, "ms"),
        ("-", 1.0, "-"),
        ("mm^3", 1.0, "mm3"),
        ("1/s", 1.0, "1/s"),
        ("um", 1e-3, "mm"),
    ],
)
def test_units(text: str, scale: float, printed: str) -> None:
    factor_and_unit = unit_named(text)
    assert factor_and_unit is not None
    assert factor_and_unit[0] == pytest.approx(scale)
    assert str(factor_and_unit[1]) == printed


@pytest.mark.parametrize("text", ["", "Pascal", "MPa/", "/ms", "MPa^", "MPa mm /"])
def test_what_is_no_unit(text: str) -> None:
    assert unit_named(text) is None


def test_every_variable_has_its_place() -> None:
    assert list(VARIABLES.values()) == list(Variable) == list(range(19))
