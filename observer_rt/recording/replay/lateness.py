"""How late frames were sent: any number of them in little memory."""

import math
from collections import Counter
from dataclasses import dataclass

from observer_rt.foundation.units import MILLISECOND

LATE = 1 * MILLISECOND  # beyond which a frame counts as late
_SIGNIFICANT_BITS = 7  # a bin is at most 1/64 of its value wide
_NANOSECOND = 1e-9  # s


@dataclass(frozen=True)
class ReplayLateness:
    """Median, 99th percentile and maximum [s], and the share of frames later than `LATE`; nan without frames."""

    median: float
    p99: float
    maximum: float
    late_share: float


class LatenessCounter:
    """Counts delays in bins that widen with the delay, so that a replay may go on for ever."""

    def __init__(self) -> None:
        self._bins: Counter[int] = Counter()
        self._frames = 0
        self._late = 0
        self._maximum = 0

    def add(self, nanoseconds: int) -> None:
        """Count one frame, `nanoseconds` >= 0 late."""
        shift = max(0, nanoseconds.bit_length() - _SIGNIFICANT_BITS)
        self._bins[nanoseconds >> shift << shift] += 1
        self._frames += 1
        self._late += nanoseconds > LATE / _NANOSECOND
        self._maximum = max(self._maximum, nanoseconds)

    def result(self) -> ReplayLateness:
        """The figures of all frames counted; median and percentile to within 1.6 %."""
        if not self._frames:
            return ReplayLateness(math.nan, math.nan, math.nan, math.nan)
        return ReplayLateness(
            self._quantile(0.5), self._quantile(0.99), self._maximum * _NANOSECOND, self._late / self._frames
        )

    def _quantile(self, share: float) -> float:
        wanted = math.ceil(share * self._frames)
        seen = 0
        for bin_start in sorted(self._bins):
            seen += self._bins[bin_start]
            if seen >= wanted:
                return bin_start * _NANOSECOND
        raise AssertionError("the bins hold all frames")
