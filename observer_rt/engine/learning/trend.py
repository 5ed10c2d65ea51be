"""What recent events contradict together: each by little, and all the same way."""

import math

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.learning.memory import Tracker

WEAR = (int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS))
REMEMBERED = 0.8  # weight of the scores before this event
SIGNIFICANT = 3.0  # standard deviations; a false alarm only widens the interval for a while
LASTING = 10  # events for which a trend, once seen, is taken to go on
QUICKER = 8.0  # times the usual drift


class RecentScores(Tracker):
    """Sums of scores (k,), each standard normal unless something is contradicted, older events counting less."""

    _sums: NDArray[np.float64]
    _variance: float

    def __init__(self, remembered: float, count: int) -> None:
        """remembered: weight of the scores before an event; count: k."""
        self._remembered = remembered
        self._sums = np.zeros(count)
        self._variance = 0.0

    def add(self, scores: NDArray[np.float64]) -> None:
        """Take in an event's scores (k,)."""
        self._sums = self._remembered * self._sums + scores
        self._variance = self._remembered**2 * self._variance + 1.0

    def forget(self) -> None:
        """Begin anew."""
        self._sums = np.zeros_like(self._sums)
        self._variance = 0.0

    def beyond(self, sigmas: float) -> NDArray[np.bool_]:
        """Which sums (k,) are further from 0 than this many of their standard deviations."""
        return np.asarray(np.abs(self._sums) > sigmas * math.sqrt(self._variance))


class Trend(Tracker):
    """Which wear moves on faster than its usual drift, from the standard scores of recent events."""

    _scores: RecentScores
    _left: NDArray[np.int64]

    def __init__(self) -> None:
        self._scores = RecentScores(REMEMBERED, len(WEAR))
        self._left = np.zeros(len(WEAR), np.int64)

    def extra_after(self, scores: NDArray[np.float64], drift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take in an event's standard scores (m,); what to widen the belief by (m,) beside the usual drift (m,)."""
        self._scores.add(scores[list(WEAR)])
        moving = self._scores.beyond(SIGNIFICANT)
        self._left = np.where(moving, LASTING, np.maximum(self._left - 1, 0))
        extra = np.zeros_like(drift)
        for place, column in enumerate(WEAR):
            if self._left[place] > 0:
                extra[column] = QUICKER * drift[column]
        return extra
