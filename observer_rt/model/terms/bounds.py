"""Bounds of terms: refusal of those that would make the model unstable, or a flow run backwards, in an injector.

At run time a term is held within its equation's bounds; a term that may be far beyond them somewhere, or undefined,
is refused: that it is not is shown over boxes of its variables, which are halved where they do not show it yet.
Feedback of a term on itself is limited. With the line of the nominal injector each limit lets an undamped
disturbance grow by a factor of e in 11 ms, and at 100 mm3/ms in 1.9 ms, as long as an injection.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from observer_rt.model.terms.enclosure import Enclosure, size_of
from observer_rt.model.terms.law import Boxes, Lag, Law, Resonance
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable

FAR = 5.0  # times the equation's bounds
LEAST_LOSS_SLOPE = -0.005  # of the pressure lost by line_flow, the line's own included, MPa/(mm3/ms)
FLOWING_SLOPE = -2.4e-4  # change of LEAST_LOSS_SLOPE with each mm3/ms of line_flow, for an injection is short
LEAST_OUTFLOW_SLOPE = -0.1  # of the outflow by line_pressure, mm3/ms/MPa
LARGEST_REST = 0.01  # mm, by which a term may hold open a needle whose measured lift is 0
_FEEDBACK = {
    TermEquation.LINE_FLOW: (Variable.LINE_FLOW, LEAST_LOSS_SLOPE),
    TermEquation.LINE_PRESSURE: (Variable.LINE_PRESSURE, LEAST_OUTFLOW_SLOPE),
}
RUNG = 0.1  # share of a change that a resonance is taken to add, for no input jumps
MOST_BOXES = 100_000  # looked at, until a law counts as not shown to be sound
_FEW = 1024  # boxes of which corners are looked at
_ROUNDED = 1e-6  # rounding error of a slope
_MOST = 1e300  # in place of infinity, so that one of two halves is less than both

_RANGES = dict.fromkeys((Variable.RAIL_PRESSURE, Variable.LINE_PRESSURE), (0.0, 250.0))
_RANGES |= dict.fromkeys((Variable.LINE_FLOW, Variable.SEAT_FLOW, Variable.NOZZLE_FLOW), (-100.0, 150.0))
_RANGES |= {
    Variable.CHAMBER_PRESSURE: (0.0, 30.0),
    Variable.SAC_PRESSURE: (0.0, 1.0),  # share of the way from chamber up to line pressure
    Variable.RAIL_PRESSURE_RATE: (-200.0, 200.0),
    Variable.LINE_PRESSURE_RATE: (-500.0, 500.0),
    Variable.TIME_SINCE_OPENING: (0.0, 2.0),  # of an injection; it grows on until the next
    Variable.TIME: (0.0, 0.0),  # at its start, for it has no bounds, as the next
    Variable.INJECTION_NUMBER: (1.0, 1.0),
}
_OF_SAC = {Variable.LINE_PRESSURE, Variable.CHAMBER_PRESSURE}
_SHUT = dict.fromkeys((Variable.NEEDLE_LIFT, Variable.LIFT_RATE, Variable.SEAT_FLOW, Variable.OPEN), (0.0, 0.0))
_OPEN = dict.fromkeys((Variable.CLOSED, Variable.OPENING, Variable.CLOSING), (0.0, 0.0)) | {Variable.OPEN: (1.0, 1.0)}
_STATES = (  # of the needle: shut, at rest, rising, falling
    _OPEN | _SHUT | {Variable.CLOSED: (1.0, 1.0)},
    _OPEN | {Variable.LIFT_RATE: (0.0, 0.0)},
    _OPEN | {Variable.LIFT_RATE: (0.0, 3.0), Variable.OPENING: (1.0, 1.0)},
    _OPEN | {Variable.LIFT_RATE: (-3.0, 0.0), Variable.CLOSING: (1.0, 1.0)},
)


@dataclass(frozen=True)
class TermDomain:
    """Values of variables over which terms are examined, and what the line itself does."""

    max_lift: float  # mm
    friction: float = 0.0  # slope of the line's own loss over the line_flow, divided by abs(line_flow)
    in_cells: bool = False  # the line has cells: a resonance of the sensor would make the observer unstable

    def boxes(self, variables: Iterable[Variable]) -> Floats:
        """Ends (variable, 2, n) of all variables, for each state of the needle in which some of these differ."""
        ranges = _RANGES | {Variable.NEEDLE_LIFT: (0.0, self.max_lift), Variable.MAX_LIFT: (self.max_lift,) * 2}
        states, chosen = [ranges | state for state in _STATES], [*variables]
        different = {tuple(each[one] for one in chosen): [each[one] for one in Variable] for each in states}
        return np.moveaxis(np.array([*different.values()]), 0, -1)


def by_variable(boxes: Floats) -> Floats:
    """Boxes with ends of the sac pressure in place of its share; it rises with all three."""
    ends, chamber = boxes.copy(), boxes[Variable.CHAMBER_PRESSURE]
    ends[Variable.SAC_PRESSURE] *= np.maximum(boxes[Variable.LINE_PRESSURE] - chamber, 0.0)
    ends[Variable.SAC_PRESSURE] += chamber
    return ends


def _places(boxes: Floats, rows: list[Variable]) -> Floats:
    """Corners and centres, or 0, as boxes of one point; of many boxes the centres alone."""
    low, high = boxes[rows].swapaxes(0, 1)
    levels = np.array([np.where(low * high < 0.0, 0.0, 0.5 * (low + high)), low, high])
    chosen = [*product(range(3 if 3 ** len(rows) * low.shape[1] <= _FEW else 1), repeat=len(rows))]
    places = np.tile(boxes, len(chosen))
    places[rows] = np.concatenate([levels[list(each), range(len(rows))] for each in chosen], axis=-1)[:, None]
    return places


def _halved(boxes: Floats, row: Variable) -> Floats:
    lower, upper, (low, high) = boxes.copy(), boxes.copy(), boxes[row]
    lower[row, 1] = np.minimum(0.5 * (low + high), np.nextafter(high, low))
    upper[row, 0] = np.minimum(np.nextafter(lower[row, 1], np.inf), high)
    return np.concatenate([lower, upper], axis=-1)


class _Demand(NamedTuple):
    """A law's demand in a domain: excess (n,) by its enclosure in boxes, and the problem at a point."""

    term: Term
    law: Law
    domain: TermDomain
    excess: Callable[[Floats, Enclosure], Floats]
    problem: Callable[[Floats, Enclosure], str]
    remedy: str = "hold it where it grows by min(), max() or tanh(), or have each variable in it once"
    by: Variable | None = None
    states: int = len(_STATES)

    def check(self) -> None:
        """Raise `UserError` at a point where the law does not do it, or unless boxes show that it always does."""
        variables, halvings, looked = self.law.variables, Counter[Variable](), 0
        rows = sorted(variables | _OF_SAC if Variable.SAC_PRESSURE in variables else variables)
        left = self.domain.boxes(rows)[..., : self.states]
        beyond = self._beyond(left)
        while (beyond > 0.0).any():
            left, beyond = left[..., beyond > 0.0], beyond[beyond > 0.0]
            off = self._beyond(places := _places(left, rows))
            if off.max() > 0.0:
                point = places[..., [int(np.argmax(off))]]
                raise self._refusal(point, self.problem(point, self._over(point, self.law)))
            looked += 2 * len(rows) * beyond.size
            if looked > MOST_BOXES:
                box = left[..., [int(np.argmax(beyond))]]
                parts = reversed([*self.law.all_parts])
                wide = next((part for part in parts if not np.isfinite(self._over(box, part).values).all()), self.law)
                raise self._refusal(box, f"cannot be shown to be sound, for '{wide}' may have too many values")
            halves = [(row, each, self._beyond(each)) for row in rows for each in (_halved(left, row),)]
            row, left, beyond = min(halves, key=lambda each: (np.maximum(each[2], 0.0).sum(), halvings[each[0]]))
            halvings[row] += 1

    def _over(self, boxes: Floats, law: Law) -> Enclosure:
        return law.enclosed(Boxes(by_variable(boxes), self.term.coefficient, self.by, self._history))

    def _history(self, law: Lag | Resonance, _: Floats) -> Floats:
        """Ends (2, 1) after any history."""
        low, high = self._over(self.domain.boxes(Variable), law.argument).values
        ends = np.array([[low.min()], [high.max()]])
        return ends if isinstance(law, Lag) else RUNG * (ends - ends[::-1])

    def _beyond(self, boxes: Floats) -> Floats:
        beyond = self.excess(boxes, self._over(boxes, self.law)) + np.zeros(boxes.shape[2])
        return np.nan_to_num(beyond, nan=_MOST, posinf=_MOST, neginf=-_MOST)

    def _refusal(self, box: Floats, problem: str) -> UserError:
        law, ends = self.term.law, by_variable(box)[:, :, 0]
        texts = ((one.word, dict.fromkeys(map("{:.4g}".format, ends[one]))) for one in sorted(law.variables))
        words = ", ".join(f"{word} = {' to '.join(values)}" for word, values in texts)
        size = f", c = {self.term.coefficient:g}" if law.has_coefficient else ""
        problem = f"{problem} at {words}" if words else problem.removesuffix(",")
        return UserError(f"{self.term.equation} = {law}{size}", problem, self.remedy)


def refuse_unbounded(term: Term, domain: TermDomain) -> None:
    """Raise `UserError`, naming a point or part, for a term that may be unsound somewhere, after any history."""
    rings = any(isinstance(part, Resonance) for part in term.law.all_parts)
    if rings and domain.in_cells and term.equation is TermEquation.LINE_PRESSURE_SENSOR:
        remedy = "state it with a line that is one lump, or filter line pressure before it is recorded"
        problem = "rings, and the observer of a line of cells would feed it"
        raise UserError(f"{term.equation} = {term.law}", problem, remedy)
    (lowest, highest), settled = term.equation.bounds, term.law.settled()
    least = np.nextafter(-1.0, 0.0) if term.equation.is_share else FAR * lowest
    by, slope = _FEEDBACK.get(term.equation, (None, 0.0))

    def beyond(_: Floats, law: Enclosure) -> Floats:
        return np.asarray(np.maximum(least - law.values[0], law.values[1] - FAR * highest))

    def too_large(_: Floats, law: Enclosure) -> str:
        low, high = law.values[:, 0].tolist()
        unit = "" if term.equation.is_share else f" {term.equation.unit}"
        if not np.isfinite(high - low):
            return "has no finite value"
        if term.equation.is_share and low <= -1.0:
            return f"is {low:.3g}, so that 1 + term is not above 0,"
        value, bound = (low, lowest) if low < FAR * lowest else (high, highest)
        return f"is {value:.3g}{unit}, more than {FAR:g} times its bound {bound:g},"

    def above_rest(_: Floats, law: Enclosure) -> Floats:
        return np.asarray(law.values[1] - LARGEST_REST)

    def holds(_: Floats, law: Enclosure) -> str:
        return f"holds a shut needle open by {law.values[1, 0]:.3g} mm, more than {LARGEST_REST:g},"

    def least_flow(boxes: Floats) -> Floats:
        return np.asarray(size_of(boxes[Variable.LINE_FLOW])[0] * (by is Variable.LINE_FLOW))

    def steeper(boxes: Floats, law: Enclosure) -> Floats:
        line = (FLOWING_SLOPE - domain.friction) * least_flow(boxes)  # by its own loss
        return np.asarray(slope + line - law.slopes[0] - _ROUNDED)

    def falls(boxes: Floats, law: Enclosure) -> str:
        flow, unit = least_flow(boxes).item(), f"{term.equation.unit} per {by.unit} of {by.word}" if by else ""
        fall, most = -law.slopes[0].item() - domain.friction * flow, -slope - FLOWING_SLOPE * flow
        return f"falls by {fall:.3g} {unit}, more than {most:.3g}, so that it feeds back on itself,"

    with np.errstate(all="ignore"):
        for law in dict.fromkeys((term.law, settled)):
            _Demand(term, law, domain, beyond, too_large).check()
            if by in law.variables:
                _Demand(term, law, domain, steeper, falls, by=by).check()
        if term.equation is TermEquation.NEEDLE_LIFT:
            remedy = "multiply by open what holds while it is open only"
            _Demand(term, settled, domain, above_rest, holds, remedy, states=1).check()
