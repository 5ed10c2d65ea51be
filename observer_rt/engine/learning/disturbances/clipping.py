"""End of the line pressure's range, found though noise that came on it later lets no value repeat.

There it is flat, and the model says that it should not be: its innovations change while y does not. So it is in
event after event at one level, beyond which no value goes. What lies there says nothing and is masked, and the model
bridges it as it does outliers.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.outliers import AT_LEVEL, FEWEST, find_pile, smoothed
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.masks import Sigmas, mask_of, median
from observer_rt.foundation.records import NOT_KEPT

BEYOND = 3.0  # standard deviations above it that no range ends at
MARGIN = 3  # samples on either side of those at the level: the mean sees them too late
FLAT = 3.0  # standard deviations of the chi2 of a constant that is one
CHANGING = 12.0  # chi2 by which the innovations change there more than y does
EXPLAINED = 1.5  # standard deviations of most innovations, where the model is known
CLEAR = 60.0  # of that, from which on one event is enough for itself
SAME_LEVEL = 1.0  # standard deviations of a sample
REMEMBERED = 6  # events at a level
RECURS = 3  # of these
_SIGNS = (-1.0, 1.0)  # of the lower and the upper end
Levels = tuple[float, ...]


@dataclass(frozen=True)
class Pile:
    """Samples at the highest level [p_0] of y, or of -y; changing: chi2 by which the model says that they go on."""

    level: float
    changing: float


@dataclass(frozen=True)
class EndsOfRange:
    """Both ends of the line pressure's range, low and high, as far as events have shown them.

    levels: of recent events; piles: of the event in hand.
    """

    levels: tuple[Levels, Levels] = ((), ())
    piles: tuple[Pile | None, Pile | None] = field(default=(None, None), metadata=NOT_KEPT)

    @property
    def is_known(self) -> bool:
        """Whether one of the ends is known."""
        return any(len(levels) >= RECURS for levels in self.levels)

    def masked(
        self, window: Window, innovations: NDArray[np.float64], sigmas: Sigmas, first: int
    ) -> tuple["EndsOfRange", NDArray[np.bool_]]:
        """Marks samples (n,) of a window that are masked or lie at an end, known or clear by innovations (n,).

        Innovations before sample `first` do not count.
        """
        before = mask_of(window)
        mask = before.copy()
        levels, piles = list(self.levels), list(self.piles)
        for end, sign in enumerate(_SIGNS):
            y = sign * window.output
            if levels[end] and np.count_nonzero(_is_beyond(y, levels[end], sigmas)) >= FEWEST:
                levels[end] = ()
            if len(levels[end]) >= RECURS:
                mask |= _about(y, float(np.mean(levels[end])), sigmas)
                continue
            pile = pile_of(y, innovations, before, sigmas, first)
            if pile is None:
                continue
            piles[end] = pile
            if pile.changing > CLEAR and _is_explained(innovations[first:], sigmas):
                mask |= _about(y, pile.level, sigmas)
        return replace(self, levels=(levels[0], levels[1]), piles=(piles[0], piles[1])), mask

    def after(self, window: Window, sigmas: Sigmas) -> "EndsOfRange":
        """Adds the findings of an event while it was fitted."""
        low, high = (
            _levels_after(levels, pile, sign * window.output, sigmas)
            for sign, levels, pile in zip(_SIGNS, self.levels, self.piles, strict=True)
        )
        return EndsOfRange((low, high))


def _levels_after(levels: Levels, pile: Pile | None, y: NDArray[np.float64], sigmas: Sigmas) -> Levels:
    """Levels of an end, with an event whose y (n,) has such a pile there."""
    if levels and _is_beyond(y, levels, sigmas).any():
        levels = ()
    if pile is None or pile.changing < CHANGING:
        return levels
    if levels and abs(pile.level - np.mean(levels)) > SAME_LEVEL * sigmas.noise:
        levels = ()
    return (*levels, pile.level)[-REMEMBERED:]


def pile_of(
    y: NDArray[np.float64], innovations: NDArray[np.float64], masked: NDArray[np.bool_], sigmas: Sigmas, first: int
) -> Pile | None:
    """The samples of y (n,) about its highest level that are not masked, None where they are too few, or y rests."""
    samples, level, constant, changing = find_pile(y, innovations, masked, sigmas.noise, first)
    if samples < FEWEST:
        return None
    constant, changing = constant / sigmas.noise**2, changing / sigmas.innovation**2
    is_flat = constant < samples + FLAT * math.sqrt(2.0 * samples)
    return Pile(level, changing - constant if is_flat else 0.0)


def _is_explained(innovations: NDArray[np.float64], sigmas: Sigmas) -> bool:
    """Whether most innovations (n,) are as the model says."""
    return median(np.abs(innovations)) < EXPLAINED * sigmas.innovation


def _about(y: NDArray[np.float64], level: float, sigmas: Sigmas) -> NDArray[np.bool_]:
    """Samples of y (n,) whose means over some neighbours are at a level, and those beside them."""
    at = smoothed(y) > level - AT_LEVEL * sigmas.noise
    return np.asarray(np.convolve(at, np.ones(2 * MARGIN + 1), "same") > 0.5, np.bool_)


def _is_beyond(y: NDArray[np.float64], levels: Levels, sigmas: Sigmas) -> NDArray[np.bool_]:
    """Means of y (n,) over some neighbours above levels at which the range ends, so that it does not."""
    return np.asarray(smoothed(y) > float(np.mean(levels)) + BEYOND * sigmas.noise, np.bool_)
