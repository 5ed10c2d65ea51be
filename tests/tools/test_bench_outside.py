"""What the benchmark outside the vocabulary makes of answers: its definitions by hand-made cases, and a case run."""

import math
from dataclasses import replace
from typing import Any

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
from tests.plants.laws import TEN_PRODUCTS
from tools.benchmarks.campaign import Row
from tools.benchmarks.discovery.cases import HiddenCase, Query, outside_cases
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.discovery.laws import PRODUCT_KINDS
from tools.benchmarks.discovery.outside import facts_of, score_outside
from tools.benchmarks.discovery.outside_answers import OutsideAnswer, ProposedTerms
from tools.benchmarks.discovery.scoring import Misfit

GOOD = ProposedTerms(("line_pressure",), "a leak", (), True, Misfit(0.1, 0.2))
SEAT = replace(GOOD, equations=("needle_lift",))
ANSWER = OutsideAnswer("unknown", 0.98, (), (), GOOD, Misfit(1.0, 2.0), Misfit(0.0, 0.0), Misfit(1.0, 2.0), 7.0)


def facts(
    best: ProposedTerms | None = None,
    asked: Query = Query.OUTSIDE,
    name: str = "root_leakage",
    with_rate: bool = True,
    **changes: Any,
) -> Row:
    """Facts of a case, by default right, with an answer."""
    parts = () if asked is Query.HEALTHY else ((name, (0.1,)),)
    case = HiddenCase("0", asked, parts, with_rate, None, 1)
    return facts_of(case, replace(ANSWER, best=best, **changes))


@pytest.mark.parametrize(
    ("row", "right", "own"),
    [
        (facts(GOOD), True, True),
        (facts(SEAT), False, False),  # a measured rate tells a leak from a needle that is not shut
        (facts(SEAT, with_rate=False), True, False),
        (facts(replace(GOOD, equations=("line_pressure", "needle_lift"))), False, True),
        (facts(), False, False),
        (facts(replace(GOOD, effects=("guide_leakage",))), True, True),
        (facts(replace(GOOD, effects=("seat_area",))), False, True),
    ],
)
def test_a_proposal_is_right_where_the_true_law_is_or_looks_like_it(row: Row, right: bool, own: bool) -> None:
    assert (row["right_equation"], row["own_equation"]) == (right, own)


@pytest.mark.parametrize(
    ("before", "after", "own_mg", "halved", "worse"),
    [
        ((1.0, 2.0), (0.1, 0.2), 0.0, (True, True), False),
        ((1.0, 0.3), (0.51, 9.0), 0.0, (False, None), True),
        ((1.0, 0.4), (0.5, 0.21), 0.0, (True, False), False),
        ((1.0, 1.4), (0.5, 1.19), 0.0, (True, False), False),
        ((1.0, 1.4), (0.5, 1.19), 1.0, (True, True), False),  # of a line that is 1 mg off by itself
        ((1.0, 0.3), (0.5, 0.39), 0.0, (True, None), False),
        ((1.0, 1.0), (0.5, 1.15), 0.0, (True, False), False),
        ((1.0, 1.0), (0.5, 1.21), 0.0, (True, False), True),
        ((1.0, 1.0), (math.inf, math.inf), 0.0, (False, False), True),
    ],
)
def test_gaps_are_halved_or_not_and_only_where_they_matter(
    before: tuple[float, float],
    after: tuple[float, float],
    own_mg: float,
    halved: tuple[bool, bool | None],
    worse: bool,
) -> None:
    proposal = replace(GOOD, misfit=Misfit(*after))
    row = facts(proposal, before=Misfit(*before), own=Misfit(0.2, own_mg))
    assert (row["pressure_halved"], row["mass_halved"], row["accepted_worse"]) == (*halved, worse)
    assert not facts(replace(proposal, may_enter=False), before=Misfit(*before))["accepted_worse"]


@pytest.mark.parametrize("name", PRODUCT_KINDS)
def test_a_law_of_two_inputs_is_the_networks_and_right_by_both(name: str) -> None:
    (case,) = outside_cases("A", 0, (False,), tuple(Discrepancy), 1, (name,))
    assert PRODUCT_KINDS[name].laws(case.parts[0][1]) == TEN_PRODUCTS[name][0]
    law, inputs = (str(PRODUCT_KINDS[name].equation),), PRODUCT_KINDS[name].inputs
    for by in (inputs, inputs - {min(inputs)}):
        best, stated = replace(GOOD, equations=law, inputs=by), ((0.96, (), law, by),)
        row = facts(best, asked=Query.PRODUCT, name=name, stated=stated)
        assert row["right_inputs"] is (by == inputs) is not row["wrong_and_sure"]


def test_a_law_without_a_name_is_recorded_asked_about_and_judged() -> None:
    (case,) = outside_cases("A", 0, (False,), tuple(Discrepancy), 1, ("stop_loss",))
    row = score_outside(case, NOMINAL_INJECTOR)
    assert row["mass_before"] > 0.3
    assert row["proposed"]
    assert row["core_seconds"] > 0.0
