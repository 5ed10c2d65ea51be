"""What was found of the lift sensor, for people: nothing of it changes an estimate."""

import math
from dataclasses import dataclass

from observer_rt.observer.stream.state import Observer

ENOUGH_OPENINGS = 5
TOLERATED = 0.03  # share of the lift at the stop


@dataclass(frozen=True)
class LiftFigures:
    """zero: lift of the shut needle [m]; crosstalk: of the line pressure [m/Pa], 0: none was found.

    at_stop: lift at which long openings stay [m], nan until five did; stop: what it should be [m].
    """

    zero: float = 0.0
    crosstalk: float = 0.0
    at_stop: float = math.nan
    stop: float = math.nan

    @property
    def is_to_scale(self) -> bool:
        """Whether the needle opens as far as it should, as far as is known."""
        return not abs(self.at_stop - self.stop) > TOLERATED * self.stop


def lift_figures(observer: Observer, max_lift: float) -> LiftFigures:
    """Read them out of the observer's memory; max_lift: of the injector file [m]."""
    memory = observer.memory[0]
    inputs = observer.constants.inputs
    is_known = int(memory["stop_openings"]) >= ENOUGH_OPENINGS
    return LiftFigures(
        zero=float(memory["zero"]),
        crosstalk=float(memory["crosstalk"]) / observer.constants.coefficients.pressure_scale,
        at_stop=inputs.lift_factor * float(memory["stop"]) + inputs.lift_shift if is_known else math.nan,
        stop=max_lift,
    )
