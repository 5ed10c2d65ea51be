"""Stretches over which a line pressure was held before noise came on it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.foundation.compiled import compiled
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
class HeldStretch:
    """Samples [start, end) of a window at which y stays at a level [p_0]; is_extreme: none goes beyond it."""

    start: int
    end: int
    level: float
    is_extreme: bool


def frozen_stretches(
    window: Window, innovations: NDArray[np.float64], sigmas: Sigmas, first: int
) -> Sequence[HeldStretch]:
    """Where a constant explains y much better than the model does by its innovations (n,), and y then jumps.

    Or where it does so very much better for long: y may by chance be let go where it would have been.
    """
    y, mask = window.output, mask_of(window)
    jump = JUMP * sigmas.innovation
    sums, squares, explained = np.zeros((3, len(y) + 1))
    is_leap, is_last = np.zeros((2, len(y) + 1), np.bool_)
    levels = sigmas.innovation, sigmas.noise
    if not _find_ends(y, innovations, levels, first, sums, squares, explained, is_leap, is_last):
        return ()

    def constant_over(starts: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
        mean_square = (sums[ends] - sums[starts]) ** 2 / (ends - starts)
        return np.asarray((squares[ends] - squares[starts] - mean_square) / sigmas.noise**2, np.float64)

    lowest, highest = (float(v) for v in np.partition(y, (2, -3))[[2, -3]])
    found: list[HeldStretch] = []
    for end in (int(end) for end in np.flatnonzero(is_leap | is_last)):
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
        is_let_go = bool(abs(y[end] - level) >= jump) or bool(is_last[end])
        if better[best] < BETTER or not is_let_go or mask[start:end].any():
            continue
        beyond = BEYOND * sigmas.noise
        found.append(HeldStretch(start, end, level, not lowest + beyond < level < highest - beyond))
    return found


@compiled
def _find_ends(
    y: NDArray[np.float64],
    innovations: NDArray[np.float64],
    sigmas: tuple[float, float],
    first: int,
    sums: NDArray[np.float64],
    squares: NDArray[np.float64],
    explained: NDArray[np.float64],
    is_leap: NDArray[np.bool_],
    is_last: NDArray[np.bool_],
) -> bool:
    """Where a stretch may end: by a leap of the innovations, or by how long y was held until then; both (n + 1,).

    sums, squares, explained: (n + 1,) running sums of y - y[0], its squares and those of the innovations. False: it
    ends nowhere.
    """
    n, (innovation, noise) = y.shape[0], sigmas
    in_part, found = np.zeros(n + 1), False
    for k in range(n):
        height, deviate = y[k] - y[0], innovations[k] / innovation
        sums[k + 1] = sums[k] + height
        squares[k + 1] = squares[k] + height * height
        explained[k + 1] = explained[k] + deviate * deviate
        at_most = min(math.fabs(deviate), MOST_OF_ONE)
        in_part[k + 1] = in_part[k] + at_most * at_most
        if k > 0 and math.fabs(innovations[k] - innovations[k - 1]) > JUMP * innovation:
            is_leap[k] = found = True
    for end in range(first + LONG, n):
        mean_square = (sums[end] - sums[end - LONG]) ** 2 / LONG
        constant = (squares[end] - squares[end - LONG] - mean_square) / noise**2
        better = in_part[end] - in_part[end - LONG] - constant
        if constant < LONG + FLAT and better > MUCH_BETTER:
            is_last[end - 1] = False
            is_last[end] = found = True
    return found
