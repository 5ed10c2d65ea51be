"""Laws by table: free curves over one variable, with as few knots as explain the recordings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.identification.discovery.search.candidates import PRICE
from observer_rt.identification.discovery.search.curves import SINCE, Axis, Floats, FreeCurve, Score, free_curves
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.form import LETTERS, FormNumber

MOST_TABLES = 2  # made at once
LEAST_KNOTS, MOST_KNOTS = 5, 12
LEAST_PARTS = 4  # of the data, from which on one can be left out
RIDGE_SHARE = 1e-3  # of its information, that holds a knot that little depends on
MOST_TURNS = 0.7  # of the inner knots: a curve with more turns only joins the operating points
LARGEST_RATIO = 2.0  # times its first largest value, that a table may have elsewhere


@dataclass(frozen=True)
class Symmetry:
    """A symmetry of curves."""

    form: str  # table of u
    sign: float  # of the curve at -u
    first: float  # u from which on knots are its own
    most: int = MOST_KNOTS  # knots


NO_SYMMETRY = Symmetry("table({u}, {pairs})", 0.0, -np.inf)
EVEN_SYMMETRY = Symmetry("table(abs({u}), {pairs})", 1.0, 0.0)
# Its knots stand twice in the law, which may not be longer.
ODD_SYMMETRY = Symmetry(
    "(table(max({u}, 0), 0, 0, {pairs}) - table(max(-({u}), 0), 0, 0, {pairs}))", -1.0, 1e-9, MOST_KNOTS // 2
)


def tables(curves: Sequence[FreeCurve], score: Score) -> list[Effect]:
    """Tables near the curves that would gain most, but none over time, which could imitate any law."""
    usable = (one for one in curves if one.curve.axis is not SINCE)
    coarse = sorted(usable, key=_gain, reverse=True)[:MOST_TABLES]
    finer = [one.curve._replace(axis=_with_midpoints(one.curve.axis)) for one in coarse]
    made = map(_simplest, free_curves(finer, score))
    return [one for one in made if one is not None]


def _with_midpoints(axis: Axis) -> Axis:
    knots = np.array(axis.knots)
    middles = 0.5 * (knots[1:] + knots[:-1])
    return replace(axis, knots=tuple(np.sort(np.concatenate((knots, middles))).tolist()))


def _gain(curve: FreeCurve) -> float:
    """Gain of a curve (-2 log L), its values within the bounds of its equation."""
    information, gradient = curve.scores.information, curve.scores.gradient
    values = np.clip(_values(information, gradient), *curve.curve.equation.bounds)
    return float(2.0 * values @ gradient - values @ information @ values)


def _values(information: Floats, gradient: Floats) -> Floats:
    held = information + RIDGE_SHARE * np.diag(np.diag(information))
    return np.asarray(np.linalg.lstsq(held, gradient, rcond=1e-12)[0])


def _simplest(curve: FreeCurve) -> Effect | None:
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
    """Whether a curve turns at few of its knots."""
    steps = np.diff(values)
    return bool(np.count_nonzero(steps[1:] * steps[:-1] < 0.0) <= MOST_TURNS * max(values.size - 2, 1))


def _best_values(curve: FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> Floats:
    """Best values at the knots kept."""
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


def _explained(curve: FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> float:
    shapes = _shapes(curve.knots, symmetry, kept)
    information, gradient = shapes.T @ curve.scores.information @ shapes, shapes.T @ curve.scores.gradient
    return float(gradient @ _values(information, gradient))


def validated(curve: FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> float:
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


def _table(curve: FreeCurve, symmetry: Symmetry, kept: Sequence[int]) -> Effect:
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
    law = symmetry.form.format(u=axis.over, pairs=", ".join(pairs))
    return term_effect(equation, factor + law, tuple(numbers))
