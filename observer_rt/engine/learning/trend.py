"""Trends that recent events contradict together: each by little, and all the same way."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.scalars import Parameter

WEAR = (int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS))
REMEMBERED = 0.8  # weight of the scores before this event
SIGNIFICANT = 3.0  # standard deviations; a false alarm only widens the interval for a while
LASTING = 10  # events for which a trend, once seen, is taken to go on
QUICKER = 8.0  # times the usual drift


@dataclass(frozen=True, eq=False)
class RecentScores:
    """Sums of scores (k,), each standard normal unless something is contradicted, older events counting less."""

    sums: NDArray[np.float64]
    variance: float = 0.0

    def after(self, scores: NDArray[np.float64], remembered: float) -> "RecentScores":
        """Adds an event's scores (k,); remembered: weight of those before."""
        return RecentScores(remembered * self.sums + scores, remembered**2 * self.variance + 1.0)

    def beyond(self, sigmas: float) -> NDArray[np.bool_]:
        """Marks sums (k,) that are further from 0 than this many of their standard deviations."""
        return np.asarray(np.abs(self.sums) > sigmas * math.sqrt(self.variance))


@dataclass(frozen=True, eq=False)
class Trend:
    """Wear that moves on faster than its usual drift, from the standard scores of recent events."""

    scores: RecentScores = field(default_factory=lambda: RecentScores(np.zeros(len(WEAR))))
    left: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(WEAR), np.int64))

    def after(self, scores: NDArray[np.float64]) -> "Trend":
        """Adds an event's standard scores (m,)."""
        recent = self.scores.after(scores[list(WEAR)], REMEMBERED)
        moving = recent.beyond(SIGNIFICANT)
        return Trend(recent, np.where(moving, LASTING, np.maximum(self.left - 1, 0)))

    def extra(self, drift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviations (m,) by which the belief is to be widened beside the usual drift (m,)."""
        extra = np.zeros_like(drift)
        for place, column in enumerate(WEAR):
            if self.left[place] > 0:
                extra[column] = QUICKER * drift[column]
        return extra
