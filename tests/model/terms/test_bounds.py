"""Bounds of laws, and refusals by them, against values at many points."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from observer_rt.core.model.model import Operation
from observer_rt.foundation.errors import UserError
from observer_rt.model.terms.bounds import FAR, TermDomain, refuse_unbounded
from observer_rt.model.terms.law import Boxes, Call, Law, LawTable
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable
from tests.model.terms.laws import laws, moments

BY, C = Variable.LINE_FLOW, 0.7
JUMPS = (Operation.GREATER, Operation.LESS)


@settings(max_examples=60)
@given(laws(lagged=False), st.integers(0, 1000))
def test_nothing_lies_outside(law: Law, seed: int) -> None:
    """Values between two moments; and the mean slope by one variable between them, where nothing jumps."""
    assume(not any(isinstance(part, LawTable) for part in law.all_parts))  # which the core has as a sum, rounded so
    values, random, parts = moments(seed, 2), np.random.default_rng(seed), [*law.all_parts]
    boxes = {one: np.sort(values[one.word])[:, None] for one in Variable}
    with np.errstate(all="ignore"):
        sizes = [np.abs(part.enclosed(Boxes(boxes, C)).values) for part in parts]
        low, high = law.enclosed(Boxes(boxes, C)).values[:, 0]
        inside = law.at({one.word: random.uniform(ends[0, 0], ends[1, 0], 50) for one, ends in boxes.items()}, C)
        line = {one: ends if one is BY else ends[:1].repeat(2, axis=0) for one, ends in boxes.items()}
        along, away = law.enclosed(Boxes(line, C, BY)), float(np.ptp(boxes[BY]))
        first, last = np.broadcast_to(law.at({one.word: ends[:, 0] for one, ends in line.items()}, C), 2)
    rounding = 1e-9 * max(float(size[np.isfinite(size)].max(initial=0.0)) for size in sizes)
    assert np.isnan(low + high) or np.all((inside >= low - rounding) & (inside <= high + rounding))
    if (
        away > 0.1
        and np.isfinite(along).all()
        and not any(isinstance(one, Call) and one.operation in JUMPS for one in parts)
    ):
        (least, most), slope = along.slopes[:, 0].tolist(), (last - first) / away
        margin = rounding / away + 1e-9 * (abs(least) + abs(most))
        assert least - margin <= slope <= most + margin


@settings(max_examples=60)
@given(laws(lagged=False), st.sampled_from(TermEquation), st.integers(0, 1000), st.sampled_from([1e-6, 1e-3, 0.1]))
def test_no_law_far_beyond_its_bounds_is_accepted(law: Law, equation: TermEquation, seed: int, size: float) -> None:
    term = Term(equation, Call(Operation.MULTIPLY, (parse("c"), law)), size)
    try:
        refuse_unbounded(term, TermDomain(0.24))
    except UserError:
        return
    values = moments(seed, 2000) | {"time": np.zeros(2000), "injection_number": np.ones(2000)}
    values_there = term.law.at(values, size)
    low, high = (FAR * bound * (1.0 + 1e-9) for bound in equation.bounds)
    assert np.all((values_there >= low) & (values_there <= high))
    assert not equation.is_share or np.all(values_there > -1.0 - 1e-12)
