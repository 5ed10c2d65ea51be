"""Smoothing of the rail pressure, which drives a model: noise that drives waves passes for a lag, or for damping."""

import numpy as np
from numpy.typing import NDArray

WIDTH = 50e-6  # s, of the rail pressure's kernel: it leaves what a rail does up to some 3 kHz
REACH = 4.0  # widths to either side


def smoothing_of(interval: float) -> float:
    """Width of the kernel [s] at a sample interval [s]: at least a sample, so that noise does not fix the delay."""
    return max(WIDTH, interval)


def smoothed(rail: NDArray[np.float64], interval: float, late: float = 0.0) -> NDArray[np.float64]:
    """Rail pressure (n,) at samples of an interval [s], smoothed, of a channel that records it `late` samples late.

    The kernel is of fourth order, (3 - u2)/2 times a normal density: parabolas pass unchanged.
    """
    width = smoothing_of(interval) / interval
    reach = int(np.ceil(REACH * width + abs(late)))
    u = (np.arange(-reach, reach + 1) - late) / width
    weights = (3.0 - u**2) * np.exp(-0.5 * u**2)
    beyond = np.pad(rail, reach, mode="edge")
    return np.asarray(np.convolve(beyond, weights[::-1] / weights.sum(), "valid"), np.float64)
