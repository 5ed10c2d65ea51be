"""A device's clock as the receive stamps show it: a straight line under the stamps of its frames.

A frame is never received before it was sent, so the delays of frames are positive, and the least of them are the
same again and again: the line through the lowest stamps of many short windows (the lower convex hull, as used for
one-way delays in packet networks: Moon, Skelly, Towsley, INFOCOM 1999) gives offset and drift of the clock, whatever
jitter lies above it. How far these lowest stamps scatter about the line is what is not known of the clock.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.frames.frames import RECORDS
from observer_rt.foundation.records import dtype_of

POINTS = 16  # windows whose lowest stamps the line goes by

CLOCK = dtype_of(RECORDS["Clock"])


class Jitter(NamedTuple):
    """Delays of a message's frames over its shortest one: their scatter and greatest [s], over `frames` frames."""

    frames: int
    sigma: float
    greatest: float


def make_clock(interval: float, samples: int, shortest: float) -> NDArray[np.void]:
    """A clock (1,) that has seen no stamp; `interval` [s] between samples, of which a frame has `samples`.

    shortest: time [s] from one frame to the next that a bus can do, 0 where there is none.
    """
    clock = np.zeros(1, CLOCK)
    clock["shortest"] = shortest * 1e9
    clock["interval"] = interval * 1e9
    clock["samples"] = samples
    clock["residual"] = math.inf
    return clock


def jitter_of(clock: np.void) -> Jitter:
    """Delays since the line is known; nothing is known of frames before."""
    frames = int(clock["delays"])
    if frames == 0:
        return Jitter(0, math.nan, math.nan)
    mean = float(clock["delay_sum"]) / frames
    variance = max(0.0, float(clock["delay_squares"]) / frames - mean * mean)
    return Jitter(frames, math.sqrt(variance) * 1e-9, float(clock["delay_max"]) * 1e-9)
