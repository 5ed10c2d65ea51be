"""How injections and the pump move the rail. Imports nothing of `observer_rt`."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from tests.plants.arrays import Array
from tests.plants.plant import REFERENCE_PRESSURE

LONGEST = 1.9e-3  # s, of an injection at REFERENCE_PRESSURE that takes `MovingRail.dip`


@dataclass(frozen=True)
class MovingRail:
    """How injections and pump move the rail [Pa, s, Hz]; dip: by the longest injection; ripple: by an opening."""

    dip: float
    recovery: float
    ripple: float
    ripple_frequency: float
    ripple_decay: float
    pump: float
    pump_frequency: float

    def supply(
        self, openings: Sequence[tuple[float, float]], rail_pressure: float, phase: float
    ) -> Callable[[Array], Array]:
        """Pressure added at times, for openings (start, duration) [s] at a rail pressure; phase: the pump's."""

        def added(time: Array) -> Array:
            total = self.pump * np.sin(2.0 * math.pi * (self.pump_frequency * time + phase))
            for start, duration in openings:
                total -= self._taken(np.maximum(time - start, 0.0), duration, rail_pressure)
            return np.asarray(total, np.float64)

        return added

    def _taken(self, since: Array, duration: float, rail_pressure: float) -> Array:
        """Dip and ripple at times since an opening [s]: an outflow while it lasts, and a regulator that makes up."""
        outflow = self.dip / LONGEST * math.sqrt(rail_pressure / REFERENCE_PRESSURE)
        flowing = np.minimum(since, duration)
        dip = outflow * self.recovery * -np.expm1(-flowing / self.recovery)
        dip *= np.exp((flowing - since) / self.recovery)
        swing = np.sin(2.0 * math.pi * self.ripple_frequency * since) * np.exp(-since / self.ripple_decay)
        return np.asarray(dip + self.ripple * swing, np.float64)


def drawn_rail(rng: Generator) -> MovingRail:
    return MovingRail(
        dip=rng.uniform(1.0e6, 1.5e6),
        recovery=rng.uniform(4e-3, 9e-3),
        ripple=rng.uniform(0.2e6, 0.4e6),
        ripple_frequency=rng.uniform(600.0, 1200.0),
        ripple_decay=rng.uniform(2e-3, 5e-3),
        pump=rng.uniform(0.15e6, 0.25e6),
        pump_frequency=rng.uniform(80.0, 300.0),
    )
