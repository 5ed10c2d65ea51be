"""Outliers that only the model shows, and levels of the noise they stand out of.

Outliers are masked (`Window.masked`), and the event is fitted again. A stretch that may be the truth is not: one
at the event's highest or lowest level, if that recurs, is clipped; one at the same place in event after event is
what the injector does; and of many in one event the model is to blame.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.outliers import LENGTH, find_held, find_loud
from observer_rt.engine.estimation.predictor import Window

GAUSSIAN = 1.4826  # standard deviation over the median of the sizes
FEWEST = 16  # samples that tell a level

BEYOND = 3.0  # standard deviations, within which a value counts as the highest or lowest
DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # what the level of the noise is measured by at rest
MOST = 0.35  # share of an event in bursts, beyond which its noise is just not known
MARGIN = 3  # a third of a stretch before it is masked as well: it may have begun unseen
MOST_STRETCHES = 3  # in an event
REMEMBERED = 6  # events, of stretches
RECURS = 3  # of these, with a stretch at the same place
SAME_PLACE = 8  # samples
SAME_LEVEL = 3.0  # standard deviations


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
    return max(1.0, GAUSSIAN * median(np.abs(resting)) / sigmas.innovation)


def median(values: NDArray[np.float64]) -> float:
    """Median of finite values (n,); numpy's own looks for others first, which takes thrice as long."""
    middle = values.size // 2
    parted = np.partition(values, middle)
    above = float(parted[middle])
    return above if values.size % 2 else 0.5 * (float(parted[:middle].max()) + above)


def mask_of(window: Window) -> NDArray[np.bool_]:
    """Samples of a window (n,) that do not count."""
    return window.masked if len(window.masked) else np.zeros(len(window.output), np.bool_)


@dataclass(frozen=True)
class HeldStretch:
    """Samples [start, end) of a window at which y stays at a level [p_0]; is_extreme: none goes beyond it."""

    start: int
    end: int
    level: float
    is_extreme: bool


def frozen_stretches(
    window: Window, innovations: NDArray[np.float64], sigmas: Sigmas, first: int
) -> Sequence[HeldStretch]:
    """Stretches at which a constant explains y much better than the model by its innovations (n,), and y then jumps.

    Or where it does so very much better for long: y may by chance be let go where it would have been.
    """
    y = window.output
    spans = find_held(y, innovations, mask_of(window), sigmas.innovation, sigmas.noise, first)
    if not len(spans):
        return ()
    lowest, highest = np.partition(y, (2, -3))[[2, -3]]
    beyond = BEYOND * sigmas.noise
    return [
        HeldStretch(int(start), int(end), level, not lowest + beyond < level < highest - beyond)
        for start, end, level in spans.tolist()
    ]


def bursts_of(y: NDArray[np.float64], noise: float) -> list[HeldStretch]:
    """Stretches of y (n,) louder than its noise (standard deviation); fourth differences remove slow parts."""
    loud = np.empty(y.size, np.bool_)
    if not 0 < find_loud(y, noise, loud) <= MOST * y.size:
        return []
    changes = np.flatnonzero(np.diff(loud, prepend=False, append=False))
    spans = zip(changes[::2], changes[1::2], strict=True)
    return [HeldStretch(int(start), int(end), float(np.mean(y[start:end])), False) for start, end in spans]


@dataclass(frozen=True)
class OutlierSearch:
    """Places of outliers in recent events.

    stretches: places, from the event's opening on, and levels; bursts: their middles, from the opening on.
    """

    stretches: tuple[tuple[tuple[int, float], ...], ...] = ()
    bursts: tuple[tuple[int, ...], ...] = ()

    def masked(
        self, window: Window, innovations: NDArray[np.float64], sigmas: Sigmas, first: int
    ) -> NDArray[np.bool_] | None:
        """Mask (n,) of an event's outliers, with the samples masked already; None: no others.

        innovations: (n,); those before sample `first` do not count.
        """
        before = mask_of(window)
        mask = before.copy()
        sigmas = sigmas.times(loudness(window, innovations, sigmas, first))
        stretches = frozen_stretches(window, innovations, sigmas, first)
        if len(stretches) <= MOST_STRETCHES:
            for stretch in stretches:
                if not self._is_true(window, stretch, sigmas):
                    mask[max(stretch.start - (stretch.end - stretch.start) // MARGIN, 0) : stretch.end] = True
        for burst in bursts_of(window.output, sigmas.noise):
            if not self._is_usual(burst, window.opening):
                mask[burst.start : burst.end] = True
        return mask if (mask & ~before).any() else None

    def after(self, window: Window, innovations: NDArray[np.float64], sigmas: Sigmas, first: int) -> "OutlierSearch":
        """Adds a fitted event."""
        stretches = frozen_stretches(window, innovations, sigmas, first)
        places = tuple((s.start - window.opening, s.level) for s in stretches)
        bursts = tuple(_middle(burst) - window.opening for burst in bursts_of(window.output, sigmas.noise))
        return OutlierSearch((*self.stretches, places)[-REMEMBERED:], (*self.bursts, bursts)[-REMEMBERED:])

    def _is_true(self, window: Window, stretch: HeldStretch, sigmas: Sigmas) -> bool:
        """Whether a stretch is no outlier, but the truth, or the end of what the sensor can show."""
        offset = stretch.start - window.opening
        alike = sum(any(abs(offset - there) <= SAME_PLACE for there, _ in event) for event in self.stretches)
        return alike + 1 >= RECURS or (stretch.is_extreme and self._recurs_at(stretch.level, sigmas))

    def _is_usual(self, burst: HeldStretch, opening: int) -> bool:
        """Whether there is a burst in event after event: then it is what the injector does, or its sensor."""
        offset = _middle(burst) - opening
        alike = sum(any(abs(offset - there) <= LENGTH for there in event) for event in self.bursts)
        return alike + 1 >= RECURS

    def _recurs_at(self, level: float, sigmas: Sigmas) -> bool:
        close = SAME_LEVEL * sigmas.noise
        return any(abs(level - other) <= close for event in self.stretches for _, other in event)


def _middle(stretch: HeldStretch) -> int:
    return (stretch.start + stretch.end) // 2
