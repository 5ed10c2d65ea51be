"""Percentiles of latencies."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MICROSECOND


@dataclass(frozen=True)
class Latency:
    """Microseconds."""

    p50: float
    p99: float
    p999: float
    longest: float
    count: int

    def __str__(self) -> str:
        return f"{self.p50:.0f} / {self.p99:.0f} / {self.p999:.0f} us ({self.count})"


def latency_of(seconds: NDArray[np.float64]) -> Latency:
    """Percentiles; nan of none."""
    if not seconds.size:
        nan = float("nan")
        return Latency(nan, nan, nan, nan, 0)
    p50, p99, p999, longest = (np.percentile(seconds, [50, 99, 99.9, 100]) / MICROSECOND).tolist()
    return Latency(p50, p99, p999, longest, seconds.size)
