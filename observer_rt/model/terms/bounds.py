"""Bounds of terms: refusal of those that would make the model unstable, or a flow run backwards, in an injector.

At run time a term is held within its equation's bounds; a term that is far beyond them somewhere, or undefined, is
refused. Feedback of a term on itself is limited. With the line of the nominal injector each limit lets an undamped
disturbance grow by a factor of e in 11 ms, and at 100 mm3/ms in 1.9 ms, as long as an injection.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from observer_rt.model.terms.law import Lag, Law, Resonance
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
_STEP, _ROUNDED = 1e-6, 1e-6  # of a variable, for slopes; rounding error of these
_POINTS = 20_000  # half of them corners, edges and centres

_RANGES = dict.fromkeys((Variable.RAIL_PRESSURE, Variable.LINE_PRESSURE), (0.0, 250.0))
_RANGES |= dict.fromkeys((Variable.LINE_FLOW, Variable.SEAT_FLOW, Variable.NOZZLE_FLOW), (-100.0, 150.0))
_RANGES |= {
    Variable.CHAMBER_PRESSURE: (0.0, 30.0),
    Variable.SAC_PRESSURE: (0.0, 1.0),  # share of the way from chamber up to line pressure
    Variable.LIFT_RATE: (-3.0, 3.0),
    Variable.RAIL_PRESSURE_RATE: (-200.0, 200.0),
    Variable.LINE_PRESSURE_RATE: (-500.0, 500.0),
    Variable.TIME_SINCE_OPENING: (0.0, 2.0),  # of an injection; it grows on until the next
}


@dataclass(frozen=True)
class TermDomain:
    """Domain in which a term must be sound, in the units of `variable`."""

    max_lift: float
    friction: float = 0.0  # slope of the line's own loss over the line_flow, divided by abs(line_flow)
    in_cells: bool = False  # the line has cells: a resonance of the sensor would make the observer unstable

    @cached_property
    def points(self) -> dict[str, Floats]:
        """Values (n,) of every variable; time and injection number, which have no bounds, are at their start."""
        random = np.random.default_rng(1)
        ranges = _RANGES | {Variable.NEEDLE_LIFT: (0.0, self.max_lift)}
        values = {}
        for variable, (low, high) in ranges.items():
            levels = np.array([low, 0.0 if low < 0.0 < high else 0.5 * (low + high), high])
            corners = random.choice(levels, _POINTS // 2)
            values[variable] = np.append(corners, random.uniform(low, high, _POINTS // 2))
        line, chamber = values[Variable.LINE_PRESSURE], values[Variable.CHAMBER_PRESSURE]
        values[Variable.SAC_PRESSURE] = chamber + values[Variable.SAC_PRESSURE] * np.maximum(line - chamber, 0.0)
        is_open = values[Variable.NEEDLE_LIFT] > 0.0
        values[Variable.LIFT_RATE][~is_open] = 0.0
        values[Variable.SEAT_FLOW][~is_open] = 0.0
        values |= {
            Variable.MAX_LIFT: np.full(_POINTS, self.max_lift),
            Variable.TIME: np.zeros(_POINTS),
            Variable.INJECTION_NUMBER: np.ones(_POINTS),
            Variable.OPEN: is_open.astype(np.float64),
            Variable.CLOSED: (~is_open).astype(np.float64),
            Variable.OPENING: (values[Variable.LIFT_RATE] > 0.0).astype(np.float64),
            Variable.CLOSING: (values[Variable.LIFT_RATE] < 0.0).astype(np.float64),
        }
        return {variable.word: array for variable, array in values.items()}


def refuse_unbounded(term: Term, domain: TermDomain) -> None:
    """Raise `UserError` for a term that is unsound somewhere in the domain, after any history or settled.

    The error names the term, the point and the value.
    """
    rings = any(isinstance(part, Resonance) for part in term.law.all_parts)
    if rings and domain.in_cells and term.equation is TermEquation.LINE_PRESSURE_SENSOR:
        raise UserError(
            f"{term.equation} = {term.law}",
            "rings, and the observer of a line of cells would feed it",
            "state it with a line that is one lump, or filter line pressure before it is recorded",
        )
    for law in dict.fromkeys((term.law, term.law.settled())):
        _refuse_values(term, _over(law, term, domain), domain)
    if term.equation is TermEquation.NEEDLE_LIFT:
        held = np.where(domain.points[Variable.CLOSED.word] > 0.0, _over(term.law.settled(), term, domain), 0.0)
        at = int(np.argmax(held))
        if held[at] > LARGEST_REST:
            problem = f"holds a shut needle open by {held[at]:.3g} mm, more than {LARGEST_REST:g},"
            raise _unsound(term, domain, at, problem, "multiply by open what holds while it is open only")
    if term.equation in _FEEDBACK:
        variable, lowest = _FEEDBACK[term.equation]
        flow, least = np.abs(domain.points[Variable.LINE_FLOW.word]), np.full(_POINTS, lowest)
        for law in dict.fromkeys((term.law, term.law.settled())):
            slope = _slope(law, variable, term, domain)
            if term.equation is TermEquation.LINE_FLOW:
                slope, least = slope + domain.friction * flow, lowest + FLOWING_SLOPE * flow
            at = int(np.argmin(slope - least))
            if slope[at] < least[at] - _ROUNDED:
                fall = f"{-slope[at]:.3g} {term.equation.unit} per {variable.unit} of {variable.word}"
                problem = f"falls by {fall}, more than {-least[at]:.3g}, so that it feeds back on itself,"
                raise _unsound(term, domain, at, problem)


def _refuse_values(term: Term, value: Floats, domain: TermDomain) -> None:
    if not np.all(np.isfinite(value)):
        raise _unsound(term, domain, int(np.argmin(np.isfinite(value))), "has no finite value")
    unit = "" if term.equation.is_share else f" {term.equation.unit}"
    least, most = int(np.argmin(value)), int(np.argmax(value))
    if term.equation.is_share and value[least] <= -1.0:
        raise _unsound(term, domain, least, f"is {value[least]:.3g}, so that 1 + term is not above 0,")
    for at, bound in zip((least, most), term.equation.bounds, strict=True):
        if value[at] / bound > FAR:
            problem = f"is {value[at]:.3g}{unit}, more than {FAR:g} times its bound {bound:g},"
            raise _unsound(term, domain, at, problem)


def _over(law: Law, term: Term, domain: TermDomain) -> Floats:
    """A law's values (n,), with the values at other points of the domain as history."""
    return np.broadcast_to(law.at(domain.points, term.coefficient, _elsewhere), (_POINTS,))


def _elsewhere(law: Lag | Resonance, values: Floats) -> Floats:
    before = np.roll(values, 1) if np.ndim(values) else values
    return before if isinstance(law, Lag) else RUNG * (before - values)


def _slope(law: Law, by: Variable, term: Term, domain: TermDomain) -> Floats:
    """A law's slopes (n,) by a variable with the same history; 0 at a jump, and where undefined."""
    before: dict[Law, Floats] = {}

    def values(step: float) -> Floats:
        points = domain.points | {by.word: domain.points[by.word] + step}
        return law.at(points, term.coefficient, lambda one, now: before.setdefault(one, _elsewhere(one, now)))

    here = values(0.0)
    ahead, behind = ((values(step) - here) / step for step in (_STEP, -_STEP))
    slope = np.where(np.abs(ahead) < np.abs(behind), ahead, behind)
    return np.broadcast_to(np.nan_to_num(slope, nan=0.0), (_POINTS,))


def _unsound(
    term: Term,
    domain: TermDomain,
    at: int,
    problem: str,
    remedy: str = "correct the law, or hold it where it grows, by min(), max() or tanh()",
) -> UserError:
    words = [f"{one.word} = {domain.points[one.word][at]:.4g}" for one in Variable if one in term.law.variables]
    size = f", c = {term.coefficient:g}" if term.law.has_coefficient else ""
    where = f" at {', '.join(words)}" if words else ""
    return UserError(f"{term.equation} = {term.law}{size}", (problem + where).removesuffix(","), remedy)
