"""Openings of the needle, from a measured lift, and the lift as it was before a slow sensor rounded it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.core.stream.stream import CONFIRM, FOOT, LOOK_BACK, dead_band
from observer_rt.engine.stream.state import noise_gain
from observer_rt.foundation.units import Bools, Floats, Ints

MOST_RAMP_SAMPLES = 8  # samples at most, through which the straight line of a ramp is laid
RAMP_TIME = 80e-6  # s, of these samples
LAG_GRID = 2e-6  # s of lag, at whose multiples openings are looked for: between them nothing jumps


@dataclass(frozen=True)
class Ramp:
    """A ramp at the edge of an opening: lift [m] at its outermost sample, and change inwards [m a sample]."""

    lift: float
    slope: float


@dataclass(frozen=True)
class Opening:
    """One opening of the needle as recorded: samples first..last with measured lift, and its two ramps."""

    first: int
    last: int
    rising: Ramp
    falling: Ramp


def ramp_samples(sample_rate: float) -> int:
    """Samples through which the straight line of a ramp is laid; sample rate [Hz]."""
    return min(max(round(RAMP_TIME * sample_rate), 2), MOST_RAMP_SAMPLES)


def find_openings(lift: Floats, noise: float, ramp: int = MOST_RAMP_SAMPLES) -> list[Opening]:
    """Openings in a measured lift [m] (n,) with white noise [m]; ramp: samples for the straight line of a ramp.

    They last from the first of CONFIRM samples above the dead band to the last before CONFIRM samples below its half,
    with up to LOOK_BACK samples beside them that stand out of the noise.
    """
    opens, shuts = dead_band(noise)
    above, below = _runs(lift > opens), _runs(~(lift > shuts))
    result = []
    k = 0
    while (first := _next(above, k)) is not None:
        end = _next(below, first)
        if end is None:
            break  # cut off: the recording ends with an open needle
        if first > 0:
            result.append(_opening(lift, first, end - 1, opens, ramp))
        k = end
    return result


def opening_between(lift: Floats, first: int, last: int, ramp: int) -> Opening:
    """The opening of these samples in a lift [m] (n,). ramp: samples its straight lines are laid through."""
    inside = lift[first : last + 1]
    return Opening(first, last, _ramp(inside, ramp), _ramp(inside[::-1], ramp))


def _runs(true: Bools) -> Ints:
    run = true.copy()
    for ahead in range(1, CONFIRM):
        run[:-ahead] &= true[ahead:]
        run[-ahead:] = False
    return np.flatnonzero(run)


def _next(starts: Ints, k: int) -> int | None:
    index = int(np.searchsorted(starts, k))
    return int(starts[index]) if index < starts.size else None


def _opening(lift: Floats, first: int, last: int, opens: float, ramp: int) -> Opening:
    for _ in range(LOOK_BACK):
        if first > 0 and lift[first - 1] > FOOT * opens:
            first -= 1
        if last + 1 < lift.size and lift[last + 1] > FOOT * opens:
            last += 1
    return opening_between(lift, first, last, ramp)


def _ramp(lift: Floats, samples: int) -> Ramp:
    """The line through the first samples of a ramp, but the very first; level where they fall."""
    first, end = (1, 1 + samples) if lift.size > 2 * samples else (0, max(2, math.ceil(lift.size / 2)))
    used = lift[first:end]
    offsets = np.arange(used.size) - 0.5 * (used.size - 1)
    slope = float(offsets @ used) / max(float(offsets @ offsets), 0.5)  # one sample has none
    return Ramp(float(np.mean(used)) - slope * (first + 0.5 * (used.size - 1)), max(slope, 0.0))


def without_lag(lift: Floats, sample_rate: float, lag: float) -> Floats:
    """y + lag y' [m] (n,) of a recorded lift y; central differences leave straight ramps exact."""
    return np.asarray(lift + lag * sample_rate * np.gradient(lift))


def openings_without_lag(
    lift: Floats, noise: float, recorded: Sequence[Opening], sample_rate: float, lag: float
) -> list[tuple[float, list[Opening]]]:
    """Openings with a lag [s] undone, at multiples of LAG_GRID beside it, with weights; noise: as recorded [m]."""
    restored, ramp = without_lag(lift, sample_rate, lag), ramp_samples(sample_rate)
    below = math.floor(lag / LAG_GRID)
    result = []
    for multiple, share in ((below, 1.0 + below - lag / LAG_GRID), (below + 1, lag / LAG_GRID - below)):
        near = multiple * LAG_GRID
        openings = find_openings(without_lag(lift, sample_rate, near), noise * noise_gain(near * sample_rate), ramp)
        kept = [one for one in openings if any(one.first <= old.last and old.first <= one.last for old in recorded)]
        result.append((share, [opening_between(restored, one.first, one.last, ramp) for one in kept]))
    return result
