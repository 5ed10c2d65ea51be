"""A rail pressure that is not measured: the set value, or what a device sends when its sensor is dead.

It is the same from sample to sample, so that no sample shows it for a channel that repeats its values anyway. But no
rail keeps its pressure through whole injections, and through the noise that the line pressure shows.
"""

from dataclasses import dataclass

import numpy as np

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.stream.standstill import FLOOR, Standstill

ENOUGH = 2  # events in a row with one value


@dataclass(frozen=True)
class HeldRail:
    """The one rail pressure [p_0] that the last so many events had; None: it moved in the last one."""

    value: float | None = None
    events: int = 0

    @property
    def is_held(self) -> bool:
        """Whether enough events in a row had one."""
        return self.events >= ENOUGH

    def after(self, window: Window, standstill: Standstill, rail_every: float) -> "HeldRail":
        """Adds an event.

        rail_every: samples to one of the rail pressure; a slow one may have the same value in an event. A recording
        without noise is computed, and so may its rail pressure be.
        """
        rail = window.inputs[:, 0]
        is_noisy = standstill.noise is not None and standstill.noise.line_pressure > FLOOR.line_pressure
        value = float(rail[0])
        if rail_every > 1.0 or not is_noisy or np.ptp(rail) > 0.0:
            return HeldRail()
        return HeldRail(value, self.events + 1 if value == self.value else 1)
