"""Laws by table: a static regression on random moments, whose candidates are terms."""

import numpy as np
import pytest

from observer_rt.identification.discovery.search.curves import CURVES, Curve, free_curves
from observer_rt.identification.discovery.search.tables import LEAST_KNOTS, MOST_KNOTS, MOST_TURNS, tables
from observer_rt.model.term_effect import TermLaw
from observer_rt.model.terms.law import LawTable
from observer_rt.model.terms.term import TermEquation
from tests.identification.discovery.search.test_curves import COUNT, SIGMA, VALUES, measured, scoring

FLOW = "min(max(line_flow/60, -0.3), 1)"  # within its axis
SPEED = "min(max(lift_rate, -0.5), 0.5)"


def all_tables(law: str) -> list[TermLaw]:
    score = scoring(measured(law))
    every = [Curve(equation, *one) for equation, curves in CURVES.items() for one in curves]
    return [one.apply for one in tables(free_curves(every, score), score) if isinstance(one.apply, TermLaw)]


def best_table(law: str) -> TermLaw:
    return all_tables(law)[0]


@pytest.mark.parametrize(
    ("law", "variable", "form"),
    [
        (f"2 * sin(6 * {FLOW} + 1)", "line_flow", "table(line_flow/60, "),
        (f"2 * sin(6 * {FLOW})", "line_flow", "table(line_flow/60, "),  # odd, and too long as such
        (f"2 * cos(8 * {SPEED})", "lift_rate", "table(abs(lift_rate), "),
        (f"2 * sin(8 * {SPEED})", "lift_rate", "(table(max(lift_rate, 0), 0, 0, "),
    ],
)
def test_a_curve_without_a_name_becomes_a_table_with_its_symmetry(law: str, variable: str, form: str) -> None:
    y = measured(law)
    result = best_table(law)
    values = result.law.at(VALUES, 1.0)
    size = float(values @ y / (values @ values))
    assert {one.word for one in result.law.variables} == {variable}
    assert result.form.startswith(form)
    assert np.std(y - size * values) < 2.0 * SIGMA


def knots_of(law: TermLaw) -> int:
    return len(law.numbers) + 1  # the largest value is the coefficient


def test_a_table_has_no_more_knots_than_the_recordings_ask_for() -> None:
    few, many = (best_table(f"{size} * sin(6 * {FLOW} + 1)") for size in (0.05, 2.0))
    assert LEAST_KNOTS <= knots_of(few) < knots_of(many) <= MOST_KNOTS
    assert COUNT > MOST_KNOTS


def test_no_table_goes_up_and_down_from_knot_to_knot() -> None:
    """It would join operating points, and say nothing between them; no table is made where none else is near."""
    laws = [one.law for turns in (20, 25, 40) for one in all_tables(f"2 * sin({turns} * {FLOW})")]
    parts = [part for law in laws for part in law.all_parts if isinstance(part, LawTable)]
    for part in parts:
        steps = np.sign(np.diff([value.reckoned for value in part.values]))
        assert np.count_nonzero(np.diff(steps[steps != 0.0])) <= MOST_TURNS * len(part.values)
    assert parts


def test_no_table_is_over_time() -> None:
    result = best_table("2 * sin(6 * time_since_opening)")
    assert "time_since_opening" not in result.form
    assert result.equation in TermEquation
