"""Standard scores of recent events together: small contradictions of the same sign add up, chance ones do not."""

import math

import numpy as np
from numpy.typing import NDArray


class RecentScores:
    """Sums of scores (k,), each standard normal unless something is contradicted, older events counting less."""

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
