"""Few samples of the line pressure that stand out by what the model says of them."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from observer_rt.observer.learning.disturbances.levels import robust_sigma

LEAP = 8.0  # standard deviations of the innovations from one sample to the next
WIDEST_SPIKE = 8  # samples
SHARP = 5.5  # standard deviations of the mean of a spike that leaps less: of noise one in 10,000 events
SHARP_WIDTHS = (1, 2, 3)  # samples of it
BESIDE = 5  # samples before it, and after it
NO_SPIKE = 3.0  # standard deviations of their mean: a wrong model leaves more than three samples
MOST_SPIKES = 12  # in an event


def spikes_of(innovations: NDArray[np.float64], sigma: float, first: int) -> list[tuple[int, int]]:
    """Samples [start, end) of innovations (n,), from `first` on, that leap away and soon back."""
    steps = np.diff(innovations)
    leaps = [int(k) for k in np.flatnonzero(np.abs(steps) > LEAP * sigma) if k >= first]
    found: list[tuple[int, int]] = []
    for leap, back in pairwise(leaps):
        is_apart = not found or leap >= found[-1][1]
        if is_apart and back - leap <= WIDEST_SPIKE and steps[leap] * steps[back] < 0.0:
            found.append((leap + 1, back + 1))
    return found


def sharp_spikes_of(innovations: NDArray[np.float64], sigma: float, first: int) -> list[tuple[int, int]]:
    """The same of those that stand out by no leap, but from what is beside them.

    Where the innovations are larger than they should be, so must be the spikes. Of many the model is to blame.
    """
    counted = innovations[first:]
    if _largest_mean(counted) < SHARP * sigma:  # nor is anything sharp by a larger one
        return []
    sigma = max(sigma, robust_sigma(counted))
    counted = counted / sigma
    left, found = counted.copy(), list[tuple[int, int]]()
    for _ in range(MOST_SPIKES + 1):
        total = np.concatenate(([0.0], np.cumsum(left)))
        deviates = {
            width: _spread((total[width:] - total[:-width]) / np.sqrt(width)) for width in SHARP_WIDTHS
        }
        width = max(SHARP_WIDTHS, key=lambda width: float(np.max(np.abs(deviates[width]))))
        start = int(np.argmax(np.abs(deviates[width])))
        height, end = float(deviates[width][start]), start + width
        if abs(height) < SHARP:
            return found
        beside = np.concatenate((counted[max(start - BESIDE, 0) : start], counted[end : end + BESIDE]))
        if np.sign(height) * beside.sum() < NO_SPIKE * np.sqrt(beside.size):
            found.append((first + start, first + end))
        left[start:end] = 0.0
    return []


def _largest_mean(innovations: NDArray[np.float64]) -> float:
    """Over the widths of a spike, with the square root of the samples as its weight."""
    total = np.concatenate(([0.0], np.cumsum(innovations)))
    return max(float(np.max(np.abs(total[w:] - total[:-w]))) / math.sqrt(w) for w in SHARP_WIDTHS)


def _spread(deviates: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deviates by what most of them are, if that is more than 1: the sums of coloured noise are larger."""
    return deviates / max(1.0, robust_sigma(deviates))
