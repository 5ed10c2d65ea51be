"""What is noted of signals while a file is looked through: ranges and the like, enough to tell a wrong unit."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled


@dataclass
class SignalSurvey:
    """Of one signal (SI); missing: samples that are NaN."""

    lowest: float = math.inf
    highest: float = -math.inf
    total: float = 0.0
    count: int = 0
    missing: int = 0
    change: float = 0.0
    """Sum of the changes from sample to sample, without their signs."""

    def take(self, values: NDArray[np.float64]) -> None:
        """Go on with further samples (n,)."""
        lowest, highest, total, change, count = _summed(np.ascontiguousarray(values))
        self.lowest = min(self.lowest, lowest)
        self.highest = max(self.highest, highest)
        self.total += total
        self.change += change
        self.count += count
        self.missing += values.size - count

    @property
    def mean(self) -> float:
        """NaN of nothing."""
        return self.total / self.count if self.count else math.nan

    @property
    def mean_change(self) -> float:
        """From sample to sample; NaN of nothing."""
        return self.change / self.count if self.count else math.nan


class Openings:
    """How often a lift rises: at least as often as the observer finds the needle opening.

    Its dead band follows the noise, with a hysteresis of a factor of two, and is 2 um at least: so an opening rises
    through one of the levels, wherever the dead band is.
    """

    _LEVELS = 2e-6 * 2.0 ** np.arange(11)  # m

    def __init__(self) -> None:
        self._counts = np.zeros(self._LEVELS.size, np.int64)
        self._last = 0.0

    def take(self, lift: NDArray[np.float64]) -> None:
        """Go on with further samples (n,) [m]; those that are NaN are passed over."""
        self._last = _count_rises(np.ascontiguousarray(lift), self._last, self._LEVELS, self._counts)

    @property
    def most(self) -> int:
        """That there can be."""
        return int(self._counts.max())


@dataclass
class Survey:
    """Of all signals by their names in a `Recording`."""

    signals: dict[str, SignalSurvey] = field(default_factory=dict)
    openings: Openings = field(default_factory=Openings)

    def take(self, name: str, values: NDArray[np.float64]) -> None:
        """Go on with further samples (n,) of a signal."""
        self.signals.setdefault(name, SignalSurvey()).take(values)
        if name == "needle_lift":
            self.openings.take(values)


@compiled
def _summed(values: NDArray[np.float64]) -> tuple[float, float, float, float, int]:
    """Lowest, highest and sum of what is not NaN, the sum of its changes without their signs, and how many."""
    lowest, highest, total, change = math.inf, -math.inf, 0.0, 0.0
    count = 0
    last = math.nan
    for value in values:
        if math.isnan(value):
            continue
        lowest, highest = min(lowest, value), max(highest, value)
        total += value
        if count:
            change += abs(value - last)
        last = value
        count += 1
    return lowest, highest, total, change, count


@compiled
def _count_rises(
    lift: NDArray[np.float64], last: float, levels: NDArray[np.float64], counts: NDArray[np.int64]
) -> float:
    """Add to `counts` how often a lift rises through each of the rising levels; its last value, before it `last`."""
    for value in lift:
        if math.isnan(value):
            continue
        if value > last and value > levels[0]:
            for number in range(levels.size):
                counts[number] += last <= levels[number] < value
        last = value
    return last
