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
        there = values[~np.isnan(values)]
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


@dataclass
class Survey:
    """Of all signals by their names in a `Recording`."""

    signals: dict[str, SignalSurvey] = field(default_factory=dict)

    def take(self, name: str, values: NDArray[np.float64]) -> None:
        """Go on with further samples (n,) of a signal."""
        self.signals.setdefault(name, SignalSurvey()).take(values)
