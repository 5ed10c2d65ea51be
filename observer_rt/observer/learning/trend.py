"""Wear that moves on faster than its usual drift: every event contradicts by little, and all the same way."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.observer.learning.recent_scores import RecentScores

WEAR = (int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS))
REMEMBERED = 0.8  # weight of the scores before this event
SIGNIFICANT = 3.0  # standard deviations; a false alarm only widens the interval for a while
LASTING = 10  # events for which a trend, once seen, is taken to go on
QUICKER = 8.0  # times the usual drift


class Trend:
    """Which wear parameters are on the move, from the standard scores of recent events."""

    def __init__(self) -> None:
        self._scores = RecentScores(REMEMBERED, len(WEAR))
        self._left = np.zeros(len(WEAR), np.int64)

    def extra_after(self, scores: NDArray[np.float64], drift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take in an event's standard scores (m,); what to widen the belief by (m,) beside the usual drift (m,)."""
        self._scores.add(scores[list(WEAR)])
        moving = self._scores.beyond(SIGNIFICANT)
        self._left = np.where(moving, LASTING, np.maximum(self._left - 1, 0))
        extra = np.zeros(PARAMETERS)
        for place, column in enumerate(WEAR):
            if self._left[place] > 0:
                extra[column] = QUICKER * drift[column]
        return extra
