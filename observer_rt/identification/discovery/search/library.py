"""The library of terms that `discover` tries where the vocabulary does not explain recordings.

Laws are of order 1 where an injector works, so pressures are centred; coefficients have their equations' units.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from observer_rt.identification.likelihood.likelihood import JointLikelihood
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.effect import Effect
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.term_effect import LAWS_OF_EFFECTS, term_effect
from observer_rt.model.terms.parser import FormNumber
from observer_rt.model.terms.term import TermEquation

NUMBER_RANGE = 4.0  # times what it is scored with, that a number within a law may become
MEAN_TIME = 1e-3  # s, over which the rail pressure is averaged
MOVED_SIGMAS = 8.0  # standard deviations, by which such means differ in an event where the rail moves
MOST_BREAKS = 5  # injections after each of which something may be new

_SHORT = {  # T and N: time and injection number, from 0 to 1 over the recordings
    "Q": "(line_flow/60)",
    "P": "((line_pressure - 100)/50)",
    "R": "((rail_pressure - 100)/50)",
    "X": "(needle_lift/max_lift)",
    "V": "lift_rate",
    "U": "(time_since_opening/1)",
    "H": "((sac_pressure - chamber_pressure)/100)",
    "S": "((line_pressure - sac_pressure)/10)",
    "D": "((line_pressure - chamber_pressure)/100)",
}
LAW_NUMBERS: Mapping[str, tuple[float, ...]] = {
    "ringing(line_pressure/1, A, W)": (5.0, 6.2, 7.6, 9.4),
    "X - lagged(X, A)": (0.02, 0.05, 0.1, 0.2),
    "lagged(X, A)*closed": (0.2, 0.6),
    "Q - lagged(Q, A)": (0.02, 0.05, 0.1, 0.3),
    "P - lagged(P, A)": (0.05, 0.2, 0.5),
    "R - lagged(R, A)": (0.05, 0.2, 0.8),
    "lagged(Q, A)": (0.1, 0.3, 1.0),
    "lagged(nozzle_flow/60, A)": (0.1, 0.5),
    "max(line_pressure/50 - A, 0)": (1.4, 1.8, 2.4),
    "max(A - line_pressure/50, 0)": (1.4, 1.8, 2.4),
    "abs(line_pressure/50 - A)": (1.4, 1.8, 2.4),
    "max(rail_pressure/50 - A, 0)": (1.4, 1.8, 2.4),
    "max(A - rail_pressure/50, 0)": (1.4, 1.8, 2.4),
    "abs(rail_pressure/50 - A)": (1.4, 1.8, 2.4),
    "line_pressure_rate/50 - lagged(line_pressure_rate/50, A)": (0.02,),
    "exp(-X/A)": (0.1, 0.3),
    "max(X - A, 0)": (0.5, 0.8),
    "exp(-U/A)": (0.3, 1.0),
    "sqrt(A/(H + A))": (0.01, 0.1),
    "R^2 - A": (0.5,),
    "P^2 - A": (0.5,),
    "Q*exp(-U/A)": (1.0,),
    "Q*abs(Q)*exp(-U/A)": (1.0,),
}
"""Laws with a number A of their own, fitted, too, where they lead, and what it is where it is scored."""
DAMPING = FormNumber(0.15, 0.02, 0.6)  # the number W of a law that rings
_OF_SEAT = (
    "X", "X^2", "exp(-X/A)", "max(X - A, 0)", "X > 0.93",
    "V", "abs(V)", "opening", "closing", "U", "exp(-U/A)", "T", "N", "B", "R", "X - lagged(X, A)",
)  # fmt: skip
LIBRARY: Mapping[TermEquation, tuple[str, ...]] = {
    TermEquation.LINE_FLOW: (
        "Q", "sqrt(Q)", "Q^3", "Q^2", "line_pressure_rate/50", "V", "X", "Q*(Q < 0)", "Q*abs(Q)*(Q < 0)",
        "Q*T", "Q*N", "Q*P", "Q*exp(-U/A)", "Q*abs(Q)*T", "Q*abs(Q)*N", "Q*abs(Q)*P", "Q*abs(Q)*exp(-U/A)",
        "Q - lagged(Q, A)", "lagged(Q, A)",
    ),
    TermEquation.INERTANCE: ("1", "abs(Q)", "Q", "Q^2", "P", "P^2", "T", "N", "X", "U", "exp(-U/A)"),
    TermEquation.STIFFNESS: (
        "abs(Q)", "Q", "Q^2", "P", "P^2", "P - lagged(P, A)", "100/(line_pressure + 20)", "T", "N", "X", "U",
        "exp(-U/A)", "line_pressure_rate > 0",
    ),
    TermEquation.RAIL_PRESSURE: (
        "R^2", "R^2 - A", "R^3", "T", "N", "X", "open", "abs(Q)", "rail_pressure_rate",
        "R - lagged(R, A)", "lagged(Q, A)", "max(rail_pressure/50 - A, 0)", "max(A - rail_pressure/50, 0)",
        "abs(rail_pressure/50 - A)",
    ),
    TermEquation.LINE_PRESSURE: (
        "1", "sqrt(D)", "D^2", "D^3", "D*closed", "sqrt(D)*closed", "open", "D*open", "sqrt(D)*open", "X", "V",
        "abs(V)", "T", "N", "D*T", "D*N", "D*B", "X - lagged(X, A)", "P - lagged(P, A)", "lagged(X, A)*closed",
    ),
    TermEquation.SEAT_FLOW: (*_OF_SEAT, "tanh(S)", "sqrt(tanh(S))"),
    TermEquation.NOZZLE_FLOW: (
        *_OF_SEAT, "H", "sqrt(H)", "H^2", "sqrt(A/(H + A))", "P", "abs(Q)",
    ),
    TermEquation.CHAMBER_PRESSURE: (
        "min(X/0.33, 1)", "X", "U", "exp(-U/A)", "nozzle_flow/60", "lagged(nozzle_flow/60, A)",
        "T", "N", "H",
    ),
    TermEquation.NEEDLE_LIFT: (
        "X^2", "X^3", "V", "open*T", "open*N", "open*B", "open*R", "X - lagged(X, A)", "closed",
    ),
    TermEquation.LINE_PRESSURE_SENSOR: (
        "P^2", "P^2 - A", "P^3", "abs(line_pressure_rate)/50", "line_pressure_rate/50", "T", "N", "X", "V", "R", "Q",
        "P - lagged(P, A)", "line_pressure_rate/50 - lagged(line_pressure_rate/50, A)",
        "ringing(line_pressure/1, A, W)", "max(line_pressure/50 - A, 0)", "max(A - line_pressure/50, 0)",
        "abs(line_pressure/50 - A)",
    ),
}  # fmt: skip
"""Laws by equation."""


@dataclass(frozen=True)
class RecordingSpan:
    """Largest time [s], first and last number of the injections judged, whether the rail pressure moves in one."""

    time: float
    first: int
    injections: int
    rail_moves: bool = True


def library(span: RecordingSpan) -> Iterator[Effect]:
    """The terms of the library as effects with one size, their coefficient."""
    unnamed = [law for name, law in LAWS_OF_EFFECTS.items() if name not in VOCABULARY]
    for equation, laws in LIBRARY.items():
        for law in (*laws, *(one for other, one in unnamed if other is equation)):
            if "N" in law and law.replace("N", "B") in laws and span.injections <= span.first + 1:
                continue  # of two injections both are the same
            if not span.rail_moves and any(change in law for change in ("lagged(R", "rail_pressure_rate")):
                continue  # of a rail at rest they would filter its noise, and so explain it
            if not set(law) & {"N", "B"} or span.injections > span.first:
                yield from (term_effect(equation, *one) for one in product(spelled(law, span), numbers_of(law)))


def numbers_of(law: str) -> list[tuple[FormNumber, ...]]:
    """The numbers within a law of the library, where it is scored."""
    further = (DAMPING,) if "W" in law else ()
    shaped = (FormNumber(value, value / NUMBER_RANGE, value * NUMBER_RANGE) for value in LAW_NUMBERS.get(law, ()))
    return [(value, *further) for value in shaped] or [()]


def spelled(law: str, span: RecordingSpan) -> Iterator[str]:
    """A law of the library in the words of laws: with B, one for every injection after which something may be new."""
    breaks = range(span.first, min(span.injections, span.first + MOST_BREAKS))  # else a law were a constant
    for number in breaks if "B" in law else (0,):
        letters = _SHORT | {
            "T": f"(time/{span.time:.3g})",
            "N": f"((injection_number - 1)/{max(span.injections - 1, 1):.3g})",
            "B": f"(injection_number > {number})",
        }
        yield "".join(letters.get(letter, letter) for letter in law)


def span_of(likelihood: JointLikelihood) -> RecordingSpan:
    """Range of time and injection number in recordings."""
    events = [event for recorded in likelihood.recordings for event in recorded.measurement.events]
    numbers = [round(event.clock.injections) for event in events]
    last = max(number + len(event.openings) for number, event in zip(numbers, events, strict=True))
    moves = any(_rail_moves(recorded.measurement) for recorded in likelihood.recordings)
    return RecordingSpan(max(event.clock.time for event in events), min(numbers) + 1, last, moves)


def _rail_moves(measurement: Measurement) -> bool:
    """Whether means of the rail pressure differ within an injection by more than its noise lets them."""
    block = max(1, round(MEAN_TIME / measurement.interval))
    limit = MOVED_SIGMAS * measurement.noise.rail_pressure / math.sqrt(block)
    for event in measurement.events:
        values = measurement.recording.rail_pressure[event.start : event.end]
        means = values[: values.size - values.size % block].reshape(-1, block).mean(axis=1)
        if np.ptp(means) > limit:
            return True
    return False
