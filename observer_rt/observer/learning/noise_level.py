"""Noise that becomes louder or quieter: its level since it changed, where that contradicts the level so far."""

import math

import numpy as np
from numpy.typing import NDArray

REMEMBERED = 0.85  # weight of the events before an event
SIGNIFICANT = 5.0  # standard deviations of the logarithm of a level, which is no other below
_VARIANCE = 1.3  # of the logarithm of a level of n differences, times n: neighbours are alike
_ORDER = 4  # differences, as the standstill's
_GAIN = 70.0  # sum of squares of 1 4 6 4 1
_SPIKE = 36.0  # times the mean square: six sigma
_CUTS = 4  # one spike hides in the mean that it makes


class RecentLevel:
    """Level of one signal's white noise: that of the whole standstill, unless recent events contradict it."""

    def __init__(self) -> None:
        self._squares, self._count = 0.0, 0.0

    def after(self, stretches: list[NDArray[np.float64]], settled: float) -> float:
        """Standard deviation after an event; settled: so far; stretches: of the event, with the needle long shut."""
        squares = np.concatenate(
            [np.empty(0), *(np.diff(values, _ORDER) ** 2 / _GAIN for values in stretches)]
        )
        if squares.size > 0:
            self._take(_without_spikes(squares), squares.size)
        if self._count > 0.0 and _differ(self._squares, self._count, settled**2, math.inf):
            return math.sqrt(self._squares)
        return settled

    def _take(self, square: float, count: int) -> None:
        """Take in an event's mean square; one that contradicts those before begins anew."""
        kept = REMEMBERED * self._count
        if kept > 0.0 and _differ(square, count, self._squares, kept):
            kept = 0.0
        self._count = kept + count
        self._squares = (kept * self._squares + count * square) / self._count


def _without_spikes(squares: NDArray[np.float64]) -> float:
    """Mean of squares, those beyond six sigma cut."""
    mean = float(squares.mean())
    for _ in range(_CUTS):
        mean = float(np.minimum(squares, _SPIKE * mean).mean())
    return mean


def _differ(square: float, count: float, other: float, other_count: float) -> bool:
    if not square > 0.0 or not other > 0.0:
        return False
    spread = math.sqrt(_VARIANCE * (1.0 / count + 1.0 / other_count))
    return abs(0.5 * math.log(square / other)) > SIGNIFICANT * spread
