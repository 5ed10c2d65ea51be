"""A rail pressure that is not measured: the set value, or what a device sends when its sensor is dead.

It is the same from sample to sample, so that no sample shows it for a channel that repeats its values anyway. But no
rail keeps its pressure through whole injections, and through the noise that the line pressure shows.
"""

import numpy as np

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.memory import Tracker
from observer_rt.engine.stream.standstill import FLOOR, Standstill

ENOUGH = 2  # events in a row with one value


class HeldRail(Tracker):
    """Follows whether the rail pressure moves in events."""

    _value: float | None
    _events: int

    def __init__(self) -> None:
        self._value = None
        self._events = 0

    def is_held_after(self, window: Window, standstill: Standstill, rail_every: float) -> bool:
        """Take in an event; whether it and those before it had one rail pressure.

        rail_every: samples to one of the rail pressure; a slow one may have the same value in an event. A recording
        without noise is computed, and so may its rail pressure be.
        """
        rail = window.inputs[:, 0]
        is_noisy = standstill.noise is not None and standstill.noise.line_pressure > FLOOR.line_pressure
        value = float(rail[0])
        if rail_every > 1.0 or not is_noisy or np.ptp(rail) > 0.0:
            self._value, self._events = None, 0
            return False
        self._events = self._events + 1 if value == self._value else 1
        self._value = value
        return self._events >= ENOUGH
