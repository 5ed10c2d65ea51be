"""When the needle is open, from a measured lift."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.observer.front_end import CONFIRM, FOOT, LOOK_BACK, dead_band

RAMP = 6  # samples of a ramp from which its slope is taken


@dataclass(frozen=True)
class Opening:
    """One opening of the needle as recorded: samples first..last with measured lift, and the slopes [m a sample].

    rising: of the lift when it leaves its seat, falling: when it meets it; both positive.
    """

    first: int
    last: int
    rising: float
    falling: float


def find_openings(lift: NDArray[np.float64], noise: float) -> list[Opening]:
    """Openings in a measured lift [m] (n,) with white noise [m] of this standard deviation.

    Open from the first of CONFIRM samples above the dead band to the last before CONFIRM samples below its half;
    up to LOOK_BACK samples beside them that stand out of the noise belong to the ramps.
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
            result.append(_opening(lift, first, end - 1, opens))
        k = end
    return result


def _runs(true: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Samples from which on CONFIRM samples are true."""
    run = true.copy()
    for ahead in range(1, CONFIRM):
        run[:-ahead] &= true[ahead:]
        run[-ahead:] = False
    return np.flatnonzero(run)


def _next(starts: NDArray[np.int64], k: int) -> int | None:
    place = int(np.searchsorted(starts, k))
    return int(starts[place]) if place < starts.size else None


def _opening(lift: NDArray[np.float64], first: int, last: int, opens: float) -> Opening:
    for _ in range(LOOK_BACK):
        if first > 0 and lift[first - 1] > FOOT * opens:
            first -= 1
        if last + 1 < lift.size and lift[last + 1] > FOOT * opens:
            last += 1
    return Opening(first, last, _slope(lift[first : last + 1]), _slope(lift[first : last + 1][::-1]))


def _slope(ramp: NDArray[np.float64]) -> float:
    """Slope [a sample] of the straight line through the first samples of a ramp, never falling.

    A ramp shorter than RAMP has its slope from what there is; the first sample lies in the rounded foot.
    """
    used = ramp[1 : 1 + RAMP] if ramp.size > RAMP else ramp[: max(2, math.ceil(ramp.size / 2))]
    if used.size < 2:
        return float(ramp[0])
    return max(float(np.polyfit(np.arange(used.size), used, 1)[0]), 0.0)
