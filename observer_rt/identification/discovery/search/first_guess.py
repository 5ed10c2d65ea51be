"""The search's first guess: the law of nozzle or seat that stands out of what the network learned.

It says which law is refitted first, and no more: it comes of the same recordings, and as prior odds would count them
twice.
"""

from collections.abc import Iterable

from observer_rt.engine.estimation.scalars import NOZZLE, SEAT
from observer_rt.engine.learning.learned_curves import LearnedCurve
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import TermLaw
from observer_rt.model.terms.term import TermEquation
from observer_rt.model.terms.variable import Variable

EQUATIONS = {NOZZLE: TermEquation.NOZZLE_FLOW, SEAT: TermEquation.SEAT_FLOW}
VARIABLES = {
    "pressure_drop_MPa": Variable.SAC_PRESSURE,
    "seat_area_mm2": Variable.NEEDLE_LIFT,
    "time_since_opening_ms": Variable.TIME_SINCE_OPENING,
    "rail_pressure_MPa": Variable.RAIL_PRESSURE,
}


Guess = LearnedCurve | None


def first_guess(curves: Iterable[LearnedCurve]) -> Guess:
    """The curve furthest from level, in units of its interval; None where all may be level."""
    return max((one for one in curves if one.bend > 1.0), key=lambda one: one.bend, default=None)


def is_guessed(effect: Effect, guess: Guess) -> bool:
    """Whether an effect is a law of the guessed flow over the guessed input."""
    law = effect.apply
    if guess is None or not isinstance(law, TermLaw) or law.equation is not EQUATIONS[guess.flow]:
        return False
    return VARIABLES[guess.variable] in law.law.variables


def guess_words(curves: Iterable[LearnedCurve]) -> str:
    """Names the law that the search began with."""
    guess = first_guess(curves)
    if guess is None:
        return "None is further from level than its interval."
    return f"The search began with {EQUATIONS[guess.flow].words} over {VARIABLES[guess.variable].word}."
