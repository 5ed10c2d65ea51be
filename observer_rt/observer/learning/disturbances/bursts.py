"""Stretches in which the line pressure is far noisier than at rest: a neighbour that is switched, a loose contact."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled
from observer_rt.observer.learning.disturbances.held import HeldStretch

DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # what the level of the noise is measured by at rest
LENGTH = 48  # samples over which a loudness is told
LOUD = 3.0  # times the variance at rest: that of white noise stays below 2 in 1e4 events
MOST_OF_ONE = 9.0  # times that variance, that a sample counts for: a spike is no burst
MOST = 0.35  # share of an event, beyond which its noise is just not known


def bursts_of(y: NDArray[np.float64], noise: float) -> list[HeldStretch]:
    """Stretches of y (n,) louder than its noise (standard deviation); fourth differences hide what is slow."""
    loud = np.empty(y.size, np.bool_)
    count = _find_loud(y, noise, loud)
    if count == 0 or count > MOST * y.size:
        return []
    changes = np.flatnonzero(np.diff(loud, prepend=False, append=False))
    spans = zip(changes[::2], changes[1::2], strict=True)
    return [HeldStretch(int(start), int(end), float(np.mean(y[start:end])), False) for start, end in spans]


@compiled
def _find_loud(y: NDArray[np.float64], noise: float, loud: NDArray[np.bool_]) -> int:
    """Which samples (n,) have a loud mean square round them, and how many."""
    n, before = y.shape[0], LENGTH // 2
    level = 0.0
    for weight in DIFFERENCE:
        level += weight * weight * noise * noise
    sums = np.zeros(n + 1)
    for k in range(n):
        square = 1.0
        if 2 <= k < n - 2:
            difference = y[k - 2] - 4.0 * y[k - 1] + 6.0 * y[k] - 4.0 * y[k + 1] + y[k + 2]
            square = min(difference * difference / level, MOST_OF_ONE)
        sums[k + 1] = sums[k] + square
    count = 0
    for k in range(n):
        first, end = max(k - before, 0), min(k - before + LENGTH, n)
        loud[k] = sums[end] - sums[first] > LOUD * (end - first)
        count += loud[k]
    return count
