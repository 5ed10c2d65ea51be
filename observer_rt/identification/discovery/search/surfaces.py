"""Laws of two variables at once: a free surface over both, and the product of two simple forms that comes nearest.

A surface is a sum of products of hats, each a term of its own, as a curve is a sum of hats: what they do to the
innovations, linearised, says what any product of a law over the one and a law over the other variable would gain.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from observer_rt.identification.discovery.search import curves
from observer_rt.identification.discovery.search.scores import Scores
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.form import LETTERS, FormNumber
from observer_rt.model.terms.term import TermEquation

MOST_PRODUCTS = 4  # made at once, each over other variables
RAIL = curves.Axis("(rail_pressure - 100)/50", (-0.9, -0.45, 0.0, 0.45, 0.9), {"rail_pressure"})
_SINCE = replace(curves.SINCE, knots=(0.1, 0.4, 0.7, 1.0, 1.5))
_LIFT = replace(curves.LIFT, knots=(0.1, 0.3, 0.5, 0.75, 1.0))
_OVER_NOZZLE = replace(curves.OVER_NOZZLE, knots=(0.1, 0.35, 0.6, 0.9, 1.2))
_OVER_SEAT = replace(curves.OVER_SEAT, knots=(0.3, 1.0, 2.5, 6.0))
SURFACES: Mapping[TermEquation, tuple[tuple[curves.Axis, curves.Axis], ...]] = {
    TermEquation.NOZZLE_FLOW: (
        (RAIL, _SINCE),
        (RAIL, _LIFT),
        (RAIL, _OVER_NOZZLE),
        (_SINCE, _LIFT),
        (_OVER_NOZZLE, _SINCE),
        (_OVER_NOZZLE, _LIFT),
    ),
    TermEquation.SEAT_FLOW: ((RAIL, _LIFT), (RAIL, _SINCE), (_SINCE, _LIFT), (_OVER_SEAT, _LIFT)),
}
"""Surfaces of an equation: over which two variables."""


@dataclass(frozen=True)
class _Factor:
    """A simple form of an axis with its numbers, and its values at the knots (k,)."""

    form: curves.Form
    numbers: tuple[FormNumber, ...]
    values: curves.Floats


def products(score: curves.Score, is_guessed: Callable[[Effect], bool]) -> list[Effect]:
    """Products of two forms as terms, the best over each two variables: guessed ones, then by what they gain."""
    pairs = [(equation, *axes) for equation, surfaces in SURFACES.items() for axes in surfaces]
    parts = curves.parts_of([_hats(*pair) for pair in pairs], score)
    made = [_nearest(*pair, part) for pair, part in zip(pairs, parts, strict=True) if part.numbers.size]
    made.sort(key=lambda item: (not is_guessed(item[1]), -item[0]))
    return [effect for _, effect in made[:MOST_PRODUCTS]]


def _hats(equation: TermEquation, first: curves.Axis, second: curves.Axis) -> list[Effect]:
    """Terms that are 1 at a knot of both axes, and 0 at all others."""
    return [term_effect(equation, "*".join(laws)) for laws in product(first.hat_laws, second.hat_laws)]


def _factors(axis: curves.Axis) -> list[_Factor]:
    """All forms of an axis that are no constant, with the numbers that are tried, decays among them."""
    knots = np.array(axis.knots)
    decays = [replace(form, law=form.law.removeprefix("1 - ")) for form in axis.forms if form.law.startswith("1 - ")]
    return [
        _Factor(form, numbers, form.values(numbers, knots))
        for form in (*axis.forms, *decays)
        if form.shape not in (curves.Shape.BUMP, curves.Shape.RINGING) and form.law != "1"
        for numbers in product(*form.numbers)
    ]


def _nearest(equation: TermEquation, first: curves.Axis, second: curves.Axis, scores: Scores) -> tuple[float, Effect]:
    """What the product of two forms would gain that comes nearest to a surface, and the product as a term."""
    rows, columns = _factors(first), _factors(second)
    values = np.einsum("ik,jl->ijkl", [row.values for row in rows], [column.values for column in columns])
    values = values.reshape(len(rows) * len(columns), -1)[:, scores.numbers]
    gains = curves.gains_of(values, scores, equation)
    best = int(np.argmax(gains))
    row, column = rows[best // len(columns)], columns[best % len(columns)]
    own, further = len(row.numbers), len(column.numbers)
    letters = str.maketrans(LETTERS[:further], LETTERS[own : own + further])
    law = f"({row.form.over(first)})*({column.form.over(second).translate(letters)})"
    return float(gains[best]), term_effect(equation, law, (*row.numbers, *column.numbers))
