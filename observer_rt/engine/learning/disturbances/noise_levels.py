"""Levels of innovations and noise of an event, expected and found; what of it is masked already."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Window

GAUSSIAN = 1.4826  # standard deviation over the median of the sizes
FEWEST = 16  # samples that tell a level


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations, in units of p_0: of the innovations, and of the line pressure's noise."""

    innovation: float
    noise: float

    def times(self, factor: float) -> "Sigmas":
        """Levels of a noise louder by a factor."""
        return Sigmas(factor * self.innovation, factor * self.noise)


def loudness(window: Window, innovations: NDArray[np.float64], sigmas: Sigmas, first: int) -> float:
    """Factor by which most innovations (n,) at rest, from sample `first` on, are larger than expected; 1 at least.

    A noise whose level is not known yet has no outliers by the level that is.
    """
    resting = innovations[first:][window.resting[first:]]
    if resting.size < FEWEST:
        return 1.0
    return max(1.0, robust_sigma(resting) / sigmas.innovation)


def robust_sigma(values: NDArray[np.float64]) -> float:
    """Standard deviation of most values (n,) about 0, however far a few of them are."""
    return GAUSSIAN * median(np.abs(values))


def median(values: NDArray[np.float64]) -> float:
    """Median of finite values (n,); numpy's own looks for others first, which takes thrice as long."""
    middle = values.size // 2
    parted = np.partition(values, middle)
    above = float(parted[middle])
    return above if values.size % 2 else 0.5 * (float(parted[:middle].max()) + above)


def mask_of(window: Window) -> NDArray[np.bool_]:
    """Samples of a window (n,) that do not count."""
    return window.masked if len(window.masked) else np.zeros(len(window.output), np.bool_)
