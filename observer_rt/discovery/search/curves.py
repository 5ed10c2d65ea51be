"""Laws made to measure: a free curve over one variable, and the simple form that comes nearest to it.

A curve is a sum of hats, each a term of its own: what they do to the innovations, linearised, says what any law over
that variable would gain.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from observer_rt.discovery.search.term_search import Each, Scores, TermFit, TermProblem, scores_of
from observer_rt.evidence.bounded_fit import Residuals
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import FormNumber, term_effect
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import TermEquation

MOST_LAWS = 4  # made at once
MOST_OF_CURVE = 2  # over one variable

KNOTS: Mapping[str, tuple[float, ...]] = {
    "line_flow/60": (-0.3, -0.1, 0.0, 0.1, 0.25, 0.5, 0.75, 1.0),
    "(line_pressure - 100)/50": (-1.0, -0.7, -0.4, -0.15, 0.0, 0.15, 0.4, 0.7),
    "needle_lift/max_lift": (0.0, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0),
    "time_since_opening/1": (0.0, 0.15, 0.3, 0.5, 0.75, 1.05, 1.45, 2.0),
    "(sac_pressure - chamber_pressure)/100": (0.0, 0.1, 0.25, 0.4, 0.6, 0.8, 1.0, 1.3),
    "(line_pressure - sac_pressure)/10": (0.0, 0.3, 0.7, 1.2, 2.0, 3.5, 6.0, 10.0),
    "lift_rate": (-0.5, -0.35, -0.2, -0.1, 0.1, 0.2, 0.35, 0.5),
    "line_pressure_rate/50": (-1.5, -0.8, -0.3, -0.1, 0.1, 0.3, 0.8, 1.5),
}
"""Variables of curves, of order 1, and where their hats are."""
FLOW, PRESSURE, LIFT, SINCE, OVER_NOZZLE, OVER_SEAT, SPEED, RATE = KNOTS
CURVES: Mapping[TermEquation, tuple[tuple[str, str], ...]] = {
    TermEquation.LINE_FLOW: ((FLOW, ""), (PRESSURE, "line_flow/60*"), (SINCE, "")),
    TermEquation.INERTANCE: ((FLOW, ""), (PRESSURE, "")),
    TermEquation.STIFFNESS: ((PRESSURE, ""), (FLOW, ""), (LIFT, "")),
    TermEquation.LINE_PRESSURE: ((PRESSURE, ""), (LIFT, ""), (SPEED, "")),
    TermEquation.SEAT_FLOW: (
        (LIFT, ""),
        (LIFT, "closing*"),
        (LIFT, "opening*"),
        (SINCE, ""),
        (OVER_SEAT, ""),
    ),
    TermEquation.NOZZLE_FLOW: ((SINCE, ""), (LIFT, ""), (OVER_NOZZLE, ""), (PRESSURE, "")),
    TermEquation.CHAMBER_PRESSURE: ((SINCE, ""), (LIFT, ""), (OVER_NOZZLE, "")),
    TermEquation.NEEDLE_LIFT: ((LIFT, ""), (SPEED, ""), (SINCE, "")),
    TermEquation.LINE_PRESSURE_SENSOR: ((PRESSURE, ""), (RATE, ""), (FLOW, ""), (SINCE, "")),
}
"""Curves of an equation: over what, and a factor before it."""


@dataclass(frozen=True)
class Form:
    """A law of a variable u with numbers of its own, as shares of the range of u: A from its start, W of it."""

    law: str
    grid_a: tuple[float, ...] = ()
    grid_w: tuple[float, ...] = ()

    def tried(self, knots: Sequence[float]) -> Iterator[tuple[FormNumber, ...]]:
        """Its numbers over a range, each between what it may become."""
        start, span = knots[0], knots[-1] - knots[0]
        places = [FormNumber(start + share * span, start, knots[-1]) for share in self.grid_a]
        widths = [FormNumber(share * span, 0.2 * share * span, 4.0 * share * span) for share in self.grid_w]
        yield from product(*(each for each in (places, widths) if each))


_PLACES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
FORMS = (
    Form("max(u - A, 0)", _PLACES),
    Form("max(A - u, 0)", _PLACES),
    Form("(1 + tanh((u - A)/W))/2", _PLACES, (0.02, 0.08, 0.2)),
    Form("tanh((u - A)/W)", (0.0, *_PLACES), (0.08, 0.2)),
    Form("exp(-((u - A)/W)^2)", (0.0, *_PLACES, 1.0), (0.1, 0.2, 0.35)),
    Form("1"), Form("u"), Form("u*abs(u)"), Form("u^3"),
)  # fmt: skip


def made_to_measure(
    equations: Sequence[TermEquation],
    about_here: Callable[[Sequence[Effect]], TermProblem],
    here: Residuals,
    each: Each,
) -> list[Effect]:
    """Terms of these equations that would gain most, one linearisation for each hat.

    about_here: terms as a problem of their own, beside nothing but the model at hand; here: its residuals.
    """
    curves = [(equation, *one) for equation in equations for one in CURVES.get(equation, ())]
    hats = [
        term_effect(equation, f"{factor}{_hat(over, place)}")
        for equation, over, factor in curves
        for place in range(len(KNOTS[over]))
    ]
    nothing = TermFit((), np.zeros(0), np.zeros(0), here)
    scores = scores_of(about_here(hats), nothing, each)
    promising: list[tuple[float, Effect]] = []
    first = 0
    for equation, over, factor in curves:
        last = first + len(KNOTS[over])
        promising += _laws(scores, range(first, last), equation, over, factor)
        first = last
    promising.sort(key=lambda item: -item[0])
    return [effect for _, effect in promising[:MOST_LAWS]]


def _hat(over: str, place: int) -> str:
    """1 at a knot, 0 at the next ones; the first and last stay 1 beyond."""
    knots = KNOTS[over]
    shown = slice(max(0, place - 1), place + 2)
    pairs = (f"{knot:g}, {float(number == place):g}" for number, knot in list(enumerate(knots))[shown])
    return f"table({over}, {', '.join(pairs)})"


def _laws(
    scores: Scores, numbers: range, equation: TermEquation, over: str, factor: str
) -> list[tuple[float, Effect]]:
    """The best forms of a curve, and what each would gain."""
    rows = np.flatnonzero(np.isin(scores.numbers, numbers))
    knots = np.array(KNOTS[over])
    seen = scores.numbers[rows] - numbers.start
    information, gradient = scores.information[np.ix_(rows, rows)], scores.gradient[rows]
    found: list[tuple[float, Effect]] = []
    for form in FORMS:
        best: tuple[float, Effect] | None = None
        for form_numbers in form.tried(KNOTS[over]):
            values = _values(form, form_numbers, knots)[seen]
            weight = float(values @ information @ values)
            size = float(values @ gradient) / weight if weight > 0.0 else 0.0
            size = float(np.clip(size, -equation.bounds[1], equation.bounds[1]))
            gain = 2.0 * size * float(values @ gradient) - size**2 * weight
            if best is None or gain > best[0]:
                best = (
                    gain,
                    term_effect(equation, f"{factor}{form.law.replace('u', f'({over})')}", form_numbers),
                )
        assert best is not None
        found.append(best)
    return sorted(found, key=lambda item: -item[0])[:MOST_OF_CURVE]


def _values(form: Form, numbers: Sequence[FormNumber], knots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of a form at the knots."""
    text = form.law
    for letter, number in zip("AW" if form.grid_a else "W", numbers, strict=False):
        text = text.replace(letter, f"({number.value!r})")
    return np.broadcast_to(parse(text.replace("u", "time")).at({"time": knots}), knots.shape)
