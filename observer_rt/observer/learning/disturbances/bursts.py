"""Stretches in which the line pressure is far noisier than at rest: a neighbour that is switched, a loose contact."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.observer.learning.disturbances.held import Stretch

DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # what the level of the noise is measured by at rest
LENGTH = 48  # samples over which a loudness is told
LOUD = 3.0  # times the variance at rest: that of white noise stays below 2 in 1e4 events
MOST_OF_ONE = 9.0  # times that variance, that a sample counts for: a spike is no burst
MOST = 0.35  # share of an event, beyond which its noise is just not known


def bursts_of(y: NDArray[np.float64], noise: float) -> list[Stretch]:
    """Stretches of y (n,) louder than its noise (standard deviation); fourth differences hide what is slow."""
    differences = np.convolve(y, DIFFERENCE, "valid")
    squares = np.ones(y.size)
    squares[2:-2] = np.minimum(differences**2 / (float(DIFFERENCE @ DIFFERENCE) * noise**2), MOST_OF_ONE)
    weights = np.ones(LENGTH)
    loudness = np.convolve(squares, weights, "same") / np.convolve(np.ones(y.size), weights, "same")
    loud = loudness > LOUD
    if loud.mean() > MOST:
        return []
    changes = np.flatnonzero(np.diff(loud, prepend=False, append=False))
    spans = zip(changes[::2], changes[1::2], strict=True)
    return [Stretch(int(start), int(end), float(np.mean(y[start:end])), False) for start, end in spans]
