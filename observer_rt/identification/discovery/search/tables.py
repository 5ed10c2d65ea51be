"""Laws by table: curves over one variable, with as few knots as explain the recordings; products of two forms."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from observer_rt.foundation.units import Floats
from observer_rt.identification.discovery.search import curves
from observer_rt.identification.discovery.search.candidates import PRICE
from observer_rt.identification.discovery.search.scores import Scores
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.parser import LETTERS, FormNumber
from observer_rt.model.terms.term import TermEquation

MOST_TABLES = 2  # made at once
LEAST_KNOTS, MOST_KNOTS = 5, 12
LEAST_PARTS = 4  # of the data, from which on one can be left out
RIDGE_SHARE = 1e-3  # of its information, that holds a knot that little depends on
MOST_TURNS = 0.7  # of the inner knots: a curve with more turns only joins the operating points
LARGEST_RATIO = 2.0  # times its first largest value, that a table may have elsewhere
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
class Symmetry:
    """A symmetry of curves."""

    form: str  # table of u
    sign: float  # of the curve at -u
    first: float  # u from which on knots are its own
    most: int = MOST_KNOTS  # knots


NO_SYMMETRY = Symmetry("table({u}, {pairs})", 0.0, -np.inf)
EVEN_SYMMETRY = Symmetry("table(abs({u}), {pairs})", 1.0, 0.0)
ODD_SYMMETRY = Symmetry(  # Its knots stand twice in the law, which may not be longer.
    "(table(max({u}, 0), 0, 0, {pairs}) - table(max(-({u}), 0), 0, 0, {pairs}))", -1.0, 1e-9, MOST_KNOTS // 2
)


def tables(free: Sequence[curves.FreeCurve], score: curves.Score) -> list[Effect]:
    """Tables near the curves that would gain most, but none over time, which could imitate any law."""
    usable = (one for one in free if one.curve.axis is not curves.SINCE)
    coarse = sorted(usable, key=_gain, reverse=True)[:MOST_TABLES]
    finer = [one.curve._replace(axis=_with_midpoints(one.curve.axis)) for one in coarse]
    return [one for one in map(_simplest, curves.free_curves(finer, score)) if one is not None]


def _with_midpoints(axis: curves.Axis) -> curves.Axis:
    knots = np.array(axis.knots)
    middles = 0.5 * (knots[1:] + knots[:-1])
    return replace(axis, knots=tuple(np.sort(np.concatenate((knots, middles))).tolist()))


def _gain(curve: curves.FreeCurve) -> float:
    """Gain of a curve (-2 log L), its values within the bounds of its equation."""
    information, gradient = curve.scores.information, curve.scores.gradient
    values = np.clip(_values(information, gradient), *curve.curve.equation.bounds)
    return float(2.0 * values @ gradient - values @ information @ values)


def _values(information: Floats, gradient: Floats) -> Floats:
    held = information + RIDGE_SHARE * np.diag(np.diag(information))
    return np.asarray(np.linalg.lstsq(held, gradient, rcond=1e-12)[0])


def _simplest(curve: curves.FreeCurve) -> Effect | None:
    """The table that explains held-out residuals best, each knot at a price; None if all turn at too many knots."""
    knots = curve.knots
    # the larger the residuals of the whole curve, the more a knot must gain
    price = PRICE * max(1.0, (curve.scores.left - _gain(curve)) / len(curve.scores.slopes))
    choices: list[tuple[float, Symmetry, list[int]]] = []
    for symmetry in (NO_SYMMETRY, EVEN_SYMMETRY, ODD_SYMMETRY) if (knots < 0.0).any() else (NO_SYMMETRY,):
        kept = [number for number, knot in enumerate(knots.tolist()) if knot >= symmetry.first]
        while len(kept) >= min(LEAST_KNOTS, knots.size):
            if len(kept) <= symmetry.most and _is_smooth(_best_values(curve, symmetry, kept)):
                choices.append((validated(curve, symmetry, kept) - price * len(kept), symmetry, list(kept)))
            smaller = [[one for one in kept if one != left] for left in kept]
            if len(kept) < 2:
                break
            kept = max(smaller, key=lambda some: _explained(curve, symmetry, some))
    if not choices:
        return None
    _, symmetry, kept = max(choices, key=lambda item: item[0])
    return _table(curve, symmetry, kept)


def _is_smooth(values: Floats) -> bool:
    steps = np.diff(values)
    return bool(np.count_nonzero(steps[1:] * steps[:-1] < 0.0) <= MOST_TURNS * max(values.size - 2, 1))


def _best_values(curve: curves.FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> Floats:
    shapes = _shapes(curve.knots, symmetry, kept)
    return _values(shapes.T @ curve.scores.information @ shapes, shapes.T @ curve.scores.gradient)


def _shapes(knots: Floats, symmetry: Symmetry, kept: Sequence[int]) -> Floats:
    """Values (k, m) at all knots of the curves that are 1 at one of the kept knots and 0 at the others."""
    places, values = knots[list(kept)], np.eye(len(kept))
    if symmetry is ODD_SYMMETRY:
        places, values = np.append(0.0, places), np.vstack((np.zeros(len(kept)), values))
    if symmetry is not NO_SYMMETRY:
        places = np.concatenate((-places[::-1], places + 1e-12))
        values = np.vstack((symmetry.sign * values[::-1], values))
    return np.column_stack([np.interp(knots, places, one) for one in values.T])


def _explained(curve: curves.FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> float:
    shapes = _shapes(curve.knots, symmetry, kept)
    information, gradient = shapes.T @ curve.scores.information @ shapes, shapes.T @ curve.scores.gradient
    return float(gradient @ _values(information, gradient))


def validated(curve: curves.FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> float:
    """Gain of every part of the data by the values that the other parts give; of all data if the parts are few."""
    shapes = _shapes(curve.knots, symmetry, kept)
    information = np.einsum("ik,rij,jl->rkl", shapes, curve.scores.information_of, shapes)
    gradient = curve.scores.gradient_of @ shapes
    if len(gradient) < LEAST_PARTS:
        return _explained(curve, symmetry, kept)
    gain = 0.0
    for own, slope in zip(information, gradient, strict=True):
        values = _values(information.sum(axis=0) - own, gradient.sum(axis=0) - slope)
        gain += float(2.0 * values @ slope - values @ own @ values)
    return gain


def _table(curve: curves.FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> Effect:
    """A curve as a term: its largest value is the coefficient, the others are numbers of its law."""
    values = _best_values(curve, symmetry, kept)
    largest = int(np.argmax(np.abs(values)))
    letters = iter(LETTERS)
    numbers, pairs = [], []
    for number, knot in enumerate(curve.knots[list(kept)]):
        if number == largest:
            pairs.append(f"{knot:g}, 1")
            continue
        numbers.append(FormNumber(round(float(values[number] / values[largest]), 4), -LARGEST_RATIO, LARGEST_RATIO))
        pairs.append(f"{knot:g}, {next(letters)}")
    equation, axis, factor = curve.curve
    return term_effect(equation, factor + symmetry.form.format(u=axis.over, pairs=", ".join(pairs)), tuple(numbers))


@dataclass(frozen=True)
class _Factor:
    """A simple form of an axis with its numbers, and its values at the knots (k,)."""

    form: curves.Form
    numbers: tuple[FormNumber, ...]
    values: Floats


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
    """All forms of an axis that are no constant, with the numbers that are tried."""
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
