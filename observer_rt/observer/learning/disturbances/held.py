"""Stretches over which a line pressure was held before noise came on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.observer.learning.disturbances.levels import Sigmas, mask_of

SHORTEST, LONGEST = 8, 64  # samples of a stretch
BETTER = 40.0  # chi2 by which a constant must beat the model
JUMP = 5.0  # standard deviations by which the value jumps when it is let go
LONG = 24  # samples of one that need not jump when it is let go
MUCH_BETTER = 300.0  # chi2 by which a constant must then beat the model
MOST_OF_ONE = 6.0  # standard deviations for which a sample of it counts at most: one alone is a spike
FLAT = (
    28.0  # chi2 of a constant over so many samples that is one, beyond their number: four standard deviations
)
RECOVERY = 20  # samples after a stretch, until the innovations are themselves again
BEYOND = 3.0  # standard deviations, within which a value counts as the highest or lowest


@dataclass(frozen=True)
class Stretch:
    """Samples [start, end) of a window at which y stays at a level [p_0]; is_extreme: none goes beyond it."""

    start: int
    end: int
    level: float
    is_extreme: bool


def frozen_stretches(
    window: Window, innovations: NDArray[np.float64], sigmas: Sigmas, first: int
) -> Sequence[Stretch]:
    """Where a constant explains y much better than the model does by its innovations (n,), and y then jumps.

    Or where it does so very much better for long: y may by chance be let go where it would have been.
    """
    y, mask = window.output, mask_of(window)
    jump = JUMP * sigmas.innovation
    sums, squares = (np.concatenate(([0.0], np.cumsum(v))) for v in (y - y[0], (y - y[0]) ** 2))
    explained = np.concatenate(([0.0], np.cumsum((innovations / sigmas.innovation) ** 2)))

    def constant_over(starts: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
        mean_square = (sums[ends] - sums[starts]) ** 2 / (ends - starts)
        return np.asarray((squares[ends] - squares[starts] - mean_square) / sigmas.noise**2, np.float64)

    leaps = np.flatnonzero(np.abs(np.diff(innovations)) > jump) + 1
    starts = np.arange(first, len(y) - LONG)
    constant = constant_over(starts, starts + LONG)
    in_part = np.minimum(innovations, MOST_OF_ONE * sigmas.innovation) / sigmas.innovation
    in_part = np.concatenate(([0.0], np.cumsum(np.maximum(in_part, -MOST_OF_ONE) ** 2)))
    better = in_part[starts + LONG] - in_part[starts] - constant
    long_held = starts[(constant < LONG + FLAT) & (better > MUCH_BETTER)] + LONG
    lasts = long_held[np.diff(long_held, append=2 * len(y)) > 1]
    ends = np.union1d(leaps, lasts)
    if not ends.size:
        return ()
    lowest, highest = (float(v) for v in np.partition(y, (2, -3))[[2, -3]])
    found: list[Stretch] = []
    for end in (int(end) for end in ends):
        begin = found[-1].end + RECOVERY if found else first
        lengths = np.arange(SHORTEST, min(LONGEST, end - begin) + 1)
        if lengths.size == 0:
            continue
        better = (
            explained[end]
            - explained[end - lengths]
            - constant_over(end - lengths, np.full_like(lengths, end))
        )
        best = int(np.argmax(better))
        start = end - int(lengths[best])
        level = float((sums[end] - sums[start]) / (end - start) + y[0])
        is_let_go = bool(abs(y[end] - level) >= jump) or end in lasts
        if better[best] < BETTER or not is_let_go or mask[start:end].any():
            continue
        beyond = BEYOND * sigmas.noise
        found.append(Stretch(start, end, level, not lowest + beyond < level < highest - beyond))
    return found
