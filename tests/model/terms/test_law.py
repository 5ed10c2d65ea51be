"""Laws: read and printed, evaluated, refused."""

import pickle

import numpy as np
import pytest
from hypothesis import given

from observer_rt.foundation.errors import UserError
from observer_rt.model.terms.law import Law
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import VARIABLES, Variable, unit_named
from tests.model.terms.laws import laws, sampled


@given(laws())
def test_what_is_printed_is_read_back(law: Law) -> None:
    text = str(law)
    if len(text) <= 300:
        assert parse(text) == law
        assert str(parse(text)) == text
        assert pickle.loads(pickle.dumps(law)) == law
        assert hash(parse(text)) == hash(law)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-0.21 * (injection_number - 1)", -0.42),
        ("2 - 3 - 4", -5.0),
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
    assert lagged[0] == 0.0
    assert lagged[200] == pytest.approx(1.0 - np.exp(-1.0))
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
    ("text", "column", "said"),
    [
        ("0.2 * line_presure", 7, "did you mean 'line_pressure'?"),
        ("0.2 * squrt(open)", 7, "did you mean 'sqrt'?"),
        ("", 1, "the law ends, expected a number, a name or '('"),
        ("2 * ", 5, "the law ends, expected a number"),
        ("2 * (open + 1", 14, "expected ')'"),
        ("open closed", 6, "found 'closed', expected an operator"),
        ("2 ** open", 4, "found '*'"),
        ("open ^ open", 8, "expected a number as exponent"),
        ("open ^ 2 ^ 2", 10, "second exponent"),
        ("1 < 2 < 3", 7, "second comparison"),
        ("min(open)", 9, "expected ','"),
        ("sqrt open", 6, "expected '('"),
        ("lagged(open, open)", 14, "time of the lag"),
        ("lagged(open, 0)", 1, "above 0"),
        ("lagged(open, 3[s])", 1, "in ms"),
        ("ringing(open, 7[ms], 0.1)", 1, "in kHz"),
        ("ringing(open, 7)", 16, "expected ','"),
        ("ringing(open, 7, 1)", 1, "below 1"),
        ("100[MPA]", 1, "did you mean 'MPa'?"),
        ("1e999", 1, "smaller number"),
        ("table(open, 0, 1)", 17, "two times or more"),
        ("table(open, 0, 1, 2)", 20, "two times or more"),
        ("table(open, 0, 1, 0, 2)", 23, "do not rise"),
        ("table(open, 0, open, 1, 2)", 16, "a point or a value"),
        ("open & 1", 6, "found '&'"),
        ("__import__('os')", 1, "unknown name '__import__'"),
        ("(" * 40 + "1" + ")" * 40, 31, "nested"),
        ("1+" * 200 + "1", 300, "longer than 300"),
    ],
)
def test_what_cannot_be_read_is_told_with_its_column(text: str, column: int, said: str) -> None:
    with pytest.raises(UserError) as refused:
        parse(text)
    assert refused.value.location == f"column {column}"
    assert said in f"{refused.value.problem} {refused.value.remedy}"


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
