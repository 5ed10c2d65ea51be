"""Programs against the laws they were made of, evaluated by numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.core.model.model import totals_of_terms
from observer_rt.model.terms.law import Call, Law, LawTable, Quantity
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation, program_of
from observer_rt.model.terms.variable import Variable
from tests.model.terms.laws import laws, moments, sampled

Values = dict[str, NDArray[np.float64]]
INTERVAL = 0.01  # ms


def run(terms: list[Term], values: Values) -> NDArray[np.float64]:
    program = program_of(terms)
    variables = np.column_stack([values[variable.word] for variable in Variable])
    return np.asarray(totals_of_terms(program, variables, np.full(3 * len(program), np.nan), INTERVAL))


def held(value: NDArray[np.float64], equation: TermEquation) -> NDArray[np.float64]:
    return np.clip(np.where(np.isfinite(value), value, 0.0), *equation.bounds)


def blurred(law: Law, values: Values, c: float, random: np.random.Generator, share: float) -> NDArray[np.float64]:
    """The law, tables as sums of lines, with every operation's result off by about such a share."""
    if isinstance(law, LawTable):
        return blurred(law.spelled, values, c, random, share)
    if not isinstance(law, Call):
        return law.at(values, c)
    names = list(Variable)[: len(law.arguments)]
    parts = {
        name.word: blurred(one, values, c, random, share) for name, one in zip(names, law.arguments, strict=True)
    }
    exact = Call(law.operation, tuple(map(Quantity, names))).at(parts)
    return exact * (1.0 + share * random.normal(size=exact.shape))


@settings(max_examples=150)
@given(laws(lagged=False), st.sampled_from(TermEquation), st.integers(0, 1000))
def test_as_the_law_says(law: Law, equation: TermEquation, seed: int) -> None:
    values, random = moments(seed), np.random.default_rng(seed)
    totals = run([Term(equation, law, 0.7)], values)
    expected = np.broadcast_to(held(law.at(values, 0.7), equation), len(totals))
    is_sure = np.ones(len(totals), np.bool_)  # the others hang on roundings
    with np.errstate(all="ignore"):
        for share in (0.0, 1e-14, 1e-14, 1e-14, 1e-14):
            near = held(blurred(law, values, 0.7, random, share), equation)
            is_sure &= np.abs(near - expected) < 1e-10 * (1.0 + np.abs(expected))
    np.testing.assert_allclose(totals[is_sure, equation.number], expected[is_sure], rtol=1e-8, atol=1e-9)
    assert not np.delete(totals, equation.number, axis=1).any()


@pytest.mark.parametrize(
    "text",
    [
        "lagged(line_flow, 0.2)",
        "line_flow - lagged(line_flow, 0.05)",
        "lagged(lagged(open, 0.1) * 3 + lagged(line_flow, 0.3), 0.02)",
        "ringing(line_flow, 7, 0.15)",
        "lagged(ringing(lagged(line_flow, 0.02), 2, 0.9), 0.1) + ringing(open, 12, 0.3)",
    ],
)
def test_what_was_before_is_remembered(text: str) -> None:
    law, values = parse(text), moments(3)
    for name in ("line_flow", "seat_flow"):
        values[name] = values[name] / 20.0
    totals = run([Term(TermEquation.LINE_FLOW, law)], values)[:, 0]
    expected = held(law.at(values, memory=sampled(INTERVAL)), TermEquation.LINE_FLOW)
    np.testing.assert_allclose(totals, expected, rtol=1e-9)
    assert np.ptp(expected) > 0.1


def test_terms_add_up_within_their_bounds() -> None:
    values = moments(1, 1)
    texts = {"0.5": TermEquation.SEAT_FLOW, "0.2": TermEquation.SEAT_FLOW, "-3": TermEquation.INERTANCE}
    texts |= {"1 / 0": TermEquation.STIFFNESS, "9": TermEquation.RAIL_PRESSURE}
    terms = [Term(equation, parse(text)) for text, equation in texts.items()]
    expected = np.zeros(10)
    for equation, value in {"seat_flow": 0.7, "inertance": -0.6, "rail_pressure": 9.0}.items():
        expected[TermEquation(equation).number] = value
    np.testing.assert_allclose(run(terms, values)[0], expected)
    twice = run([*terms, *terms], values)[0]
    assert (twice[TermEquation.SEAT_FLOW.number], twice[TermEquation.RAIL_PRESSURE.number]) == (0.8, 10.0)
    assert not run([], values).any()


def test_what_stays_as_it_is_becomes_a_number() -> None:
    terms = [Term(TermEquation.SEAT_FLOW, parse("needle_lift / max_lift - max_lift"))]
    values = moments(2) | {"max_lift": np.full(40, 0.24)}
    program = program_of(terms, {Variable.MAX_LIFT: 0.24})
    variables = np.column_stack([values[variable.word] for variable in Variable])
    variables[:, Variable.MAX_LIFT] = np.nan
    totals = totals_of_terms(program, variables, np.full(3 * len(program), np.nan), INTERVAL)
    np.testing.assert_array_equal(totals, run(terms, values))


def test_time_that_stands_still_moves_no_lag() -> None:
    program = program_of([Term(TermEquation.LINE_FLOW, parse("lagged(line_flow, 1)"))])
    memory, variables = np.full(3 * len(program), np.nan), np.zeros((2, len(Variable)))
    variables[1, Variable.LINE_FLOW] = 10.0
    assert not totals_of_terms(program, variables, memory, 0.0).any()
    assert totals_of_terms(program, variables[1:], memory, 1.0)[0, 0] == pytest.approx(10.0 * (1.0 - np.exp(-1.0)))
