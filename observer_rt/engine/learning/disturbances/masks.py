"""Stretches of the line pressure that may be off, and the level of the noise they stand out of.

Held, at the end of the range too, or loud: without the samples in it (`Window.masked`) an event is weighed once more,
beside the event as it is, and pays for what they are instead.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.outliers import find_held, find_loud
from observer_rt.engine.estimation.belief import Vector
from observer_rt.engine.estimation.predictor import Window

GAUSSIAN = 1.4826  # standard deviation over the median of the sizes
FEWEST = 16  # samples that tell a level
DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # what the level of the noise is measured by at rest
NEIGHBOURS = 5  # samples whose mean is compared with an end of the range
AT, BEYOND = 1.5, 3.0  # standard deviations of a sample, within which it is there, and beyond which there is none
MOST = 0.35  # share of an event that may be off; beyond it its noise, or its model, is just not known


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations, in units of p_0: of the innovations, and of the line pressure's noise."""

    innovation: float
    noise: float


@dataclass(frozen=True, eq=False)
class CleanWindow:
    """An event without its stretches that are off: the window, and nats of their samples as what they are."""

    window: Window
    nats: float


def loudness(window: Window, innovations: Vector, sigmas: Sigmas, first: int) -> float:
    """Factor by which most innovations (n,) at rest, from sample `first` on, are larger than expected; 1 at least.

    A noise whose level is not known yet has no outliers by the level that is.
    """
    resting = innovations[first:][window.resting[first:]]
    if resting.size < FEWEST:
        return 1.0
    return max(1.0, GAUSSIAN * median(np.abs(resting)) / sigmas.innovation)


def median(values: Vector) -> float:
    """Median of finite values (n,); numpy's own looks for others first, which takes thrice as long."""
    middle = values.size // 2
    parted = np.partition(values, middle)
    above = float(parted[middle])
    return above if values.size % 2 else 0.5 * (float(parted[:middle].max()) + above)


def mask_of(window: Window) -> NDArray[np.bool_]:
    """Samples of a window (n,) that do not count."""
    return window.masked if len(window.masked) else np.zeros(len(window.output), np.bool_)


def without_stretches(window: Window, innovations: Vector, sigmas: Sigmas, first: int) -> CleanWindow | None:
    """The event without samples better explained as held or loud than by their innovations (n,); None: all count.

    Those before sample `first` do not count.
    """
    before = mask_of(window)
    louder = loudness(window, innovations, sigmas, first)
    sigmas = Sigmas(louder * sigmas.innovation, louder * sigmas.noise)
    held = find_held(window.output, innovations / sigmas.innovation, before, sigmas.noise, first)
    spans = np.concatenate((held, find_loud(window.output, sigmas.noise)))
    mask = before.copy()
    for start, end in spans[:, :2].astype(np.int64):
        mask[start:end] = True
    for start, end in held[:, :2].astype(np.int64):
        mask |= _beyond(window.output, float(np.mean(window.output[start:end])), sigmas.noise)
    masked = np.count_nonzero(mask & ~before)
    if not 0 < masked <= MOST * mask.size:
        return None
    more = masked - float(np.sum(spans[:, 1] - spans[:, 0]))
    return CleanWindow(window._replace(masked=mask), float(spans[:, 2].sum()) + max(0.5 * more, 0.0))


def _beyond(y: Vector, level: float, noise: float) -> NDArray[np.bool_]:
    """Samples of y (n,) about a level at which its range ends; none, where it goes on beyond it."""
    means = np.convolve(y - level, np.full(NEIGHBOURS, 1.0 / NEIGHBOURS), "same")
    inner = means[NEIGHBOURS:-NEIGHBOURS] / noise
    sign = 1.0 if inner.max() < BEYOND else -1.0
    if (sign * inner).max() >= BEYOND:
        return np.zeros(y.size, np.bool_)
    at = sign * means > -AT * noise
    return np.asarray(np.convolve(at, np.ones(NEIGHBOURS), "same") > 0.5, np.bool_)
