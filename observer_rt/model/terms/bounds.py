"""Terms are tried over all an injector may meet, so that none makes the model unstable or a flow run backwards.

At run time a term is held within its equation's bounds. What is far beyond them somewhere, or undefined, is refused.
Of what feeds back positively little is allowed: in a usual line (0.8 m, 2.4 mm) the limits below let a disturbance
grow by a factor of e in 6 ms (loss) and 40 ms (outflow), when nothing else damps it.
"""

from dataclasses import dataclass

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.model.terms.law import Values
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import VARIABLES, Variable

FAR = 5.0  # times the equation's bounds
LEAST_LOSS_SLOPE = -0.05  # of the pressure lost by line_flow, MPa/(mm3/ms)
LEAST_OUTFLOW_SLOPE = -0.1  # of the outflow by line_pressure, mm3/ms/MPa
_FEEDBACK = {
    TermEquation.LINE_FLOW: (Variable.LINE_FLOW, LEAST_LOSS_SLOPE),
    TermEquation.LINE_PRESSURE: (Variable.LINE_PRESSURE, LEAST_OUTFLOW_SLOPE),
}
_POINTS = 20_000  # half of them corners, edges and centres


@dataclass(frozen=True)
class TermDomain:
    """Where a term must be sound; in the units of `variable`."""

    max_lift: float
    chamber_pressure: tuple[float, float] = (0.0, 30.0)
    pressure: tuple[float, float] = (0.0, 250.0)
    flow: tuple[float, float] = (-100.0, 150.0)
    lift_rate: tuple[float, float] = (-3.0, 3.0)
    rail_pressure_rate: tuple[float, float] = (-200.0, 200.0)
    line_pressure_rate: tuple[float, float] = (-500.0, 500.0)
    time_since_opening: tuple[float, float] = (0.0, 20.0)

    def points(self) -> dict[str, Values]:
        """Values (n,) of every variable; what grows without bounds, time and injection number, is at its start."""
        random = np.random.default_rng(1)
        ranges = {
            Variable.RAIL_PRESSURE: self.pressure,
            Variable.LINE_PRESSURE: self.pressure,
            Variable.SAC_PRESSURE: self.pressure,
            Variable.CHAMBER_PRESSURE: self.chamber_pressure,
            Variable.LINE_FLOW: self.flow,
            Variable.SEAT_FLOW: self.flow,
            Variable.NOZZLE_FLOW: self.flow,
            Variable.NEEDLE_LIFT: (0.0, self.max_lift),
            Variable.LIFT_RATE: self.lift_rate,
            Variable.RAIL_PRESSURE_RATE: self.rail_pressure_rate,
            Variable.LINE_PRESSURE_RATE: self.line_pressure_rate,
            Variable.TIME_SINCE_OPENING: self.time_since_opening,
        }
        values = {}
        for variable, (low, high) in ranges.items():
            levels = np.array([low, 0.0 if low < 0.0 < high else 0.5 * (low + high), high])
            corners = random.choice(levels, _POINTS // 2)
            values[variable] = np.append(corners, random.uniform(low, high, _POINTS // 2))
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
    """Refuse a term that is unsound somewhere in the domain.

    Raises `UserError` naming the term, the point and the value.
    """
    points, (lowest, highest) = domain.points(), term.equation.bounds
    unit = "" if term.equation.is_share else f" {term.equation.unit}"
    for law in {term.law, term.law.settled()}:
        value = law.at(points, term.coefficient, _anything)
        value = np.broadcast_to(value, (_POINTS,))
        if not np.all(np.isfinite(value)):
            _refuse(term, points, int(np.argmin(np.isfinite(value))), "has no finite value")
        if term.equation.is_share and np.min(value) <= -1.0:
            at = int(np.argmin(value))
            _refuse(term, points, at, f"is {value[at]:.3g}: a factor 1 + term below 0")
        for at, limit in ((int(np.argmin(value)), lowest), (int(np.argmax(value)), highest)):
            if value[at] / limit > FAR:
                _refuse(
                    term, points, at, f"is {value[at]:.3g}{unit}, more than {FAR:g} times its bound {limit:g}"
                )
    if term.equation not in _FEEDBACK:
        return
    variable, least = _FEEDBACK[term.equation]
    for law in {term.law, term.law.settled()}:
        slope = law.slope(variable.word).at(points, term.coefficient, _anything)
        slope = np.broadcast_to(np.nan_to_num(slope, nan=0.0), (_POINTS,))
        at = int(np.argmin(slope))
        if slope[at] < least:
            by = f"{term.equation.unit} per {variable.unit} of {variable.word}"
            _refuse(
                term,
                points,
                at,
                f"falls by {-slope[at]:.3g} {by}, more than {-least:g}: it feeds back on itself",
            )


def _anything(values: Values, milliseconds: float) -> Values:
    """What a lag may hold is any value its argument may have had before."""
    return np.roll(values, 1) if np.ndim(values) else values


def _refuse(term: Term, points: dict[str, Values], at: int, problem: str) -> None:
    words = [
        f"{name} = {points[name][at]:.4g}"
        for name, variable in VARIABLES.items()
        if variable in term.law.variables
    ]
    where = f" at {', '.join(words)}" if words else ""
    raise UserError(
        f"{term.equation} = {term.law}" + (f", c = {term.coefficient:g}" if term.law.has_coefficient else ""),
        problem + where,
        "correct the law, or hold it where it grows, by min(), max() or tanh()",
    )
