"""Wander of a model from operating point to operating point: how much its masses scatter that it never shows.

A model that is right at every point by itself, with another theta, is wrong at the next one. What the theta that led
before an event makes of its mass, over what the theta does that was learned from it, tells how much.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.learning.account import constants as c
from observer_rt.engine.learning.learned_range import REACH, EventPoint
from observer_rt.foundation.units import Z_95

Vector = NDArray[np.float64]
# Standard deviations, of a mass.
SIZES = np.append(0.0, c.WANDER_LEAST * 2.0 ** (0.5 * np.arange(c.WANDER_STEPS)))
_SHARES = np.append(1.0 - c.WANDER_PRIOR, c.WANDER_PRIOR / SIZES[1:] / np.sum(1.0 / SIZES[1:]))
_LEAST_VARIANCE = 1e-8  # of a ratio of masses
_STEPS, _CLOSE = 30, 1e-12  # of Newton's method: at most, and relative change from which on it is settled


@dataclass(frozen=True, eq=False)
class Wander:
    """Belief (SIZES,) about the standard deviation of masses between distant points; point: of the last event."""

    weights: Vector = field(default_factory=lambda: _SHARES.copy())
    point: EventPoint | None = None

    def after(self, moved: float, variance: float, point: EventPoint) -> "Wander":
        """Adds an event at a point, whose mass is a share larger than the last theta says, with a variance."""
        weights = c.WANDER_KEPT * self.weights + (1.0 - c.WANDER_KEPT) * _SHARES
        spread = max(variance, _LEAST_VARIANCE) + self._apart(point) * SIZES**2
        usual = np.exp(-0.5 * moved**2 / spread) / np.sqrt(spread)
        changed = math.exp(-0.5 * (moved / c.CHANGE_SIZE) ** 2) / c.CHANGE_SIZE
        weights = weights * ((1.0 - c.REALLY_CHANGED) * usual + c.REALLY_CHANGED * changed + 1e-30)
        return Wander(weights / weights.sum(), point)

    def at(self, point: EventPoint) -> "Wander":
        """Moves on over an event without a comparison."""
        return replace(self, point=point)

    def widened(self, variance: float) -> float:
        """Standard deviation of a normal distribution whose 95 % interval is that of a mass with such a variance."""
        spreads = np.sqrt(2.0 * (variance + SIZES**2)).tolist()
        parts, half = list(zip(self.weights.tolist(), spreads, strict=True)), Z_95 * math.sqrt(variance)
        for _ in range(_STEPS):  # from below, where what lies beyond is convex
            beyond = sum(weight * math.erfc(half / spread) for weight, spread in parts) - (1.0 - 0.95)
            slope = sum(weight / spread * math.exp(-((half / spread) ** 2)) for weight, spread in parts)
            step = 0.5 * math.sqrt(math.pi) * beyond / slope
            half += step
            if abs(step) < _CLOSE * half:
                break
        return max(half / Z_95, math.sqrt(variance))

    def _apart(self, point: Sequence[float]) -> float:
        """Variance of the difference between the last point and this one, over that of distant ones, 1: 0 .. 2."""
        if self.point is None:
            return 0.0
        distance = (np.array(point) - np.array(self.point)) / REACH
        return 2.0 * (1.0 - math.exp(-0.5 * float(distance @ distance)))
