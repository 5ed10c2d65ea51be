"""A law over its variable beside what recordings say of it: a free curve about the model with the law in force."""

import numpy as np

from observer_rt.identification.discovery.search.curves import AXES, Axis, Score
from observer_rt.identification.discovery.search.results import LawCurve
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.model.terms.law import Law, Values
from observer_rt.model.terms.term import Term
from observer_rt.model.terms.variable import Variable

GATES = (Variable.OPEN, Variable.CLOSED, Variable.OPENING, Variable.CLOSING)
VAGUE = 1.0  # times what the law spans, from which on an uncertain point shows nothing
DRAWN = 201  # points of a line
TIMES = 6  # knots over the time of recordings


def law_curve(term: Term, score: Score, spread: float, reach: tuple[float, float]) -> LawCurve | None:
    """A term with its interval, drawn; None of one that remembers, or depends on several variables.

    score: of effects beside the model that has the term; spread: mean square of what that leaves; reach: time [s] and
    number of injections of the recordings.
    """
    curve_axis = axis_of(term.law, reach)
    if curve_axis is None:
        return None
    axis, gates = curve_axis
    scores = score(axis.hats(term.equation, "".join(f"{gate.word}*" for gate in gates)))
    covariance = np.linalg.pinv(scores.information, rcond=1e-9, hermitian=True)
    off = covariance @ scores.gradient
    sigmas = np.sqrt(np.diag(covariance) * spread)
    knots = np.array(axis.knots)[scores.numbers]
    drawn = np.linspace(axis.knots[0], axis.knots[-1], DRAWN)
    low, high = term.interval or (term.coefficient, term.coefficient)
    lines = [_law_at(term.law, axis, drawn, c) for c in (term.coefficient, low, high)]
    half = NORMAL_975 * sigmas
    clear = half < VAGUE * max(float(np.ptp(lines[0])), float(np.max(np.abs(lines[0]))))
    return LawCurve(
        term,
        axis.words,
        axis.unit,
        axis.offset + axis.scale * drawn,
        (lines[0], np.minimum(*lines[1:]), np.maximum(*lines[1:])),
        (axis.offset + axis.scale * knots)[clear],
        (_law_at(term.law, axis, knots, term.coefficient) + off)[clear],
        half[clear],
    )


def axis_of(law: Law, reach: tuple[float, float]) -> tuple[Axis, list[Variable]] | None:
    """The one variable of a law beside its gates, and these; None of one that remembers, or has several.

    reach: as of `law_curve`.
    """
    time, injections = reach
    gates = [gate for gate in GATES if gate in law.variables]
    counted = tuple(float(number) for number in range(1, round(injections) + 1))
    spread = tuple(np.linspace(0.0, time, TIMES).tolist())
    axes = (
        *AXES,
        Axis("injection_number", counted, "injection", "-", 1.0, {"injection_number": (0.0, 1.0)}),
        Axis("time", spread, "time", "s", 1.0, {"time": (0.0, 1.0)}),
    )
    words = {variable.word for variable in law.variables if variable not in gates}
    fitting = (axis for axis in axes if words and words <= set(axis.of) and len(axis.knots) > 1)
    swings = Variable.TIME in law.variables and "sin(" in str(law)  # by the clock: no curve has enough points
    axis = None if law.remembers or swings else next(fitting, None)
    return None if axis is None else (axis, gates)


def _law_at(law: Law, axis: Axis, u: Values, c: float) -> Values:
    """At values (n,) of its variable, all gates open."""
    moment = {name: at_zero + slope * u for name, (at_zero, slope) in axis.of.items()}
    moment |= {gate.word: np.ones_like(u) for gate in GATES}
    return np.broadcast_to(law.at(moment, c), u.shape)
