"""What is noted of signals while a file is looked through: ranges and the like, enough to tell a wrong unit."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


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
        missing = np.isnan(values)
        there = values[~missing] if missing.any() else values
        self.missing += values.size - there.size
        if there.size:
            self.lowest = min(self.lowest, float(there.min()))
            self.highest = max(self.highest, float(there.max()))
            self.total += float(there.sum())
            self.change += float(np.abs(np.diff(there)).sum())
            self.count += there.size

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
        self._last = np.zeros(1)

    def take(self, lift: NDArray[np.float64]) -> None:
        """Go on with further samples (n,) [m], none of them NaN."""
        lifts = np.concatenate((self._last, lift))
        high = np.flatnonzero(lift > self._LEVELS[0])  # few of them
        before, after = lifts[high, None], lifts[high + 1, None]
        self._counts += np.count_nonzero((after > self._LEVELS) & (before <= self._LEVELS), axis=0)
        self._last = lifts[-1:]

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
            self.openings.take(values[~np.isnan(values)])
