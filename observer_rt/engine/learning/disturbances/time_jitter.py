"""Noise that grows with the slope of pressure: moments that are off by t show the pressure off by t dp/dt.

What a model does not know on a slope is alike in neighbouring samples: fourth differences hide it.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.masks import DIFFERENCE, mask_of

SLOPE = np.array([3.0, 2.0, 1.0, 0.0, -1.0, -2.0, -3.0]) / 28.0  # of the straight line through seven samples
USUAL = 0.2  # samples, of a jitter by whose scatter the slopes are weighed
CLIP = 16.0  # variances for which one square counts at most: a spike is no jitter
# Of the variance of a mean of squares of fourth differences, whose neighbours are alike, over that of white ones.
ALIKE = 2.63
LENGTH = 8  # samples that contradict a model together
REMEMBERED = 0.9  # weight of the events before an event
FOUND, LOST = 8.0, 5.0  # standard deviations from which on there is a jitter, and below which no more
RELEVANT = 0.1  # samples: less cannot be distinguished from white noise
MOST = 0.5  # samples: more is no jitter


@dataclass(frozen=True, eq=False)
class TimeJitter:
    """Excess of the line pressure's noise where it is steep, from recent events.

    The sums are of weights, with squared slopes and their squares, with loudness and both.
    """

    sums: NDArray[np.float64] = field(default_factory=lambda: np.zeros(5))
    variance: float = 0.0  # of the moments [samples^2]; 0: none

    @property
    def is_known(self) -> bool:
        """Whether the noise depends on the slope."""
        return self.variance > 0.0

    def levels(self, window: Window, sigma: float) -> NDArray[np.float64] | None:
        """Standard deviations (n,) of a window's innovations over that at rest, `sigma`; None: all are alike."""
        if not self.is_known:
            return None
        return np.sqrt(1.0 + self.variance * _squared_slopes(window, sigma))

    def loudest(self, window: Window, sigma: float) -> float:
        """Largest mean square of `levels` over as many samples as contradict a model; 1 where all are alike."""
        levels = self.levels(window, sigma)
        if levels is None:
            return 1.0
        return float(np.convolve(levels**2, np.full(LENGTH, 1.0 / LENGTH), "valid").max())

    def after(self, window: Window, unfiltered: NDArray[np.float64], sigma: float, first: int) -> "TimeJitter":
        """Adds an event's innovations (n,) from `first` on, neither white nor weighed."""
        counts = np.convolve(mask_of(window), np.ones(DIFFERENCE.size), "same") == 0.0
        counts[: first + DIFFERENCE.size] = False
        counts[-DIFFERENCE.size :] = False
        differences = np.convolve(unfiltered, DIFFERENCE, "same") / sigma
        squares = differences[counts] ** 2 / float(DIFFERENCE @ DIFFERENCE)
        slopes = _squared_slopes(window, sigma)[counts]
        expected = 1.0 + USUAL**2 * slopes
        loud = np.minimum(squares, CLIP * expected)
        weights = 1.0 / expected**2
        columns = np.ones_like(slopes), slopes, slopes**2, loud, slopes * loud
        sums = REMEMBERED * self.sums + [float(weights @ column) for column in columns]
        return TimeJitter(sums, _variance_in(sums, LOST if self.is_known else FOUND))


def _variance_in(sums: NDArray[np.float64], needed: float) -> float:
    """Variance of the moments [samples^2], of a straight line through loudness over squared slope; 0: none."""
    count, slopes, squares, loud, both = sums
    information = squares - slopes**2 / count if count > 0.0 else 0.0
    if not information > 0.0:
        return 0.0
    variance = (both - slopes * loud / count) / information
    is_sure = variance * math.sqrt(information / (2.0 * ALIKE)) > needed
    return float(variance) if is_sure and RELEVANT**2 < variance < MOST**2 else 0.0


def _squared_slopes(window: Window, sigma: float) -> NDArray[np.float64]:
    """Squares (n,) of the recorded line pressure's slopes, in `sigma` a sample."""
    return np.asarray((np.convolve(window.output, SLOPE, "same") / sigma) ** 2, np.float64)
