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

from observer_rt.foundation.compiled import compiled, inner, inner_separate, separate
from observer_rt.foundation.small_arrays import ascending

POINTS = 16  # windows whose lowest stamps the line goes by
ENOUGH_POINTS = 4  # from which on the line is trusted
WINDOW = 0.2e9  # ns
MAX_DRIFT = 500e-6  # of any clock worth the name; more is a wrong sample rate in the bench file
STEP = 1e6  # ns that the lowest stamps of a window may leave the line by before the clock counts as set anew
PROMPT = 2e3  # ns of delay, within which a frame came without waiting
FEW_PROMPT = 1 / 3  # share of such frames, below which it is not sure that any did
# Of the mean delay, that the least one may then have: batches beat with the cycle.
LEAST_OF_DELAYS = 0.75
USUAL_GAIN = 0.25  # of the greatest delay of a window, in what is usual
# Share of frames closer than a bus can carry them, above which stamps are those of batches.
FEW_TOGETHER = 0.1

CLOCK = np.dtype(
    [
        ("interval", np.float64),  # ns, nominal, between two samples
        ("samples", np.int64),  # of a frame
        ("shortest", np.float64),  # ns from one frame to the next that a bus can do
        ("begun", np.bool_),
        ("first_index", np.int64),
        ("first_stamp", np.int64),  # ns
        ("last_stamp", np.int64),
        # the window under way
        ("window_end", np.float64),  # ns after the first stamp
        ("lowest", np.float64),  # ns, of the excess
        ("lowest_at", np.float64),  # samples after the first
        ("latest", np.float64),  # ns, of the delays
        ("frames", np.int64),
        ("prompt", np.int64),
        ("waited", np.float64),  # ns, sum of the delays
        ("together", np.int64),  # frames that came sooner after their predecessor than a bus can carry them
        # finished windows
        ("points", np.int64),
        ("places", np.float64, (POINTS,)),  # samples after the first
        ("excesses", np.float64, (POINTS,)),  # ns, of the stamp over the nominal time
        # the line under the excesses
        ("offset", np.float64),  # ns
        ("drift", np.float64),  # ns a sample
        ("residual", np.float64),  # ns that the line may be off by, infinite while it is not known
        ("spread", np.float64),  # ns, greatest delay of the last window
        ("usual", np.float64),  # ns, what the windows before had
        ("raised", np.float64),  # ns, by which its lowest stamp lay above the line before
        # delays since the line is known
        ("delays", np.int64),
        ("delay_sum", np.float64),  # ns
        ("delay_squares", np.float64),
        ("delay_max", np.float64),
    ],
    align=True,
)


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


@compiled
def forget(clock) -> None:  # type: ignore[no-untyped-def]
    """Begin anew: the index or the stamps no longer continue those before."""
    clock.begun = False
    clock.points = 0
    clock.offset = 0.0
    clock.drift = 0.0
    clock.residual = math.inf
    clock.spread = 0.0
    clock.latest = 0.0
    clock.usual = 0.0
    clock.raised = 0.0


@inner
def excess(clock, index: int, stamp: int) -> float:  # type: ignore[no-untyped-def]
    """ns by which a stamp lies after the nominal time of the sample `index`."""
    return float((stamp - clock.first_stamp) - (index - clock.first_index) * clock.interval)


@separate
def delay_of(clock, index: int, stamp: int) -> float:  # type: ignore[no-untyped-def]
    """ns by which a stamp lies above the line; 0 for the first one."""
    if not clock.begun:
        return 0.0
    line = clock.offset + clock.drift * (index - clock.first_index)
    return float(excess(clock, index, stamp) - line)


@separate
def take_stamp(clock, index: int, stamp: int) -> bool:  # type: ignore[no-untyped-def]
    """Note that the frame whose last sample is `index` was received at `stamp` [ns].

    True when that ended a window, so that line, residual and spread are new.
    """
    if not clock.begun:
        clock.begun = True
        clock.first_index = index
        clock.first_stamp = stamp
        _open_window(clock, 0.0)
    place = float(index - clock.first_index)
    above = excess(clock, index, stamp)
    delay = above - clock.offset - clock.drift * place
    if clock.points < ENOUGH_POINTS and delay < 0.0:
        clock.offset += delay  # the lowest stamp so far
        delay = 0.0
    elif clock.points >= ENOUGH_POINTS:
        clock.delays += 1
        clock.delay_sum += delay
        clock.delay_squares += delay * delay
        clock.delay_max = max(clock.delay_max, delay)
    clock.latest = max(clock.latest, delay)
    clock.waited += delay
    clock.prompt += delay < PROMPT
    clock.frames += 1
    if clock.frames > 1 and stamp - clock.last_stamp < clock.shortest:
        clock.together += 1
    clock.last_stamp = stamp
    if above < clock.lowest:
        clock.lowest = above
        clock.lowest_at = place
    now = float(stamp - clock.first_stamp)
    if now < clock.window_end:
        return False
    _close_window(clock, now)
    return True


@compiled
def time_of(clock, index: float, epoch: int) -> float:  # type: ignore[no-untyped-def]
    """Time [ns after the stamp `epoch`] at which the frame that ends in sample `index` came, had it no jitter."""
    place = index - clock.first_index
    return float((clock.first_stamp - epoch) + clock.offset + place * (clock.interval + clock.drift))


@compiled
def index_at(clock, time: float, epoch: int) -> float:  # type: ignore[no-untyped-def]
    """The inverse of `time_of`: the sample, with its fraction, at a time [ns after the stamp `epoch`]."""
    since = time - (clock.first_stamp - epoch) - clock.offset
    return float(clock.first_index + since / (clock.interval + clock.drift))


@inner
def _open_window(clock, start: float) -> None:  # type: ignore[no-untyped-def]
    clock.window_end = start + WINDOW
    clock.lowest = math.inf
    clock.latest = 0.0
    clock.frames = 0
    clock.prompt = 0
    clock.waited = 0.0
    clock.together = 0


@inner_separate
def _close_window(clock, now: float) -> None:  # type: ignore[no-untyped-def]
    """Take the lowest stamp of the window into the line, or begin a new line when it does not belong to it."""
    off_line = clock.lowest - clock.offset - clock.drift * clock.lowest_at
    clock.raised = off_line if clock.points >= ENOUGH_POINTS else 0.0
    if clock.points >= ENOUGH_POINTS and abs(off_line) > STEP:
        clock.points = 0
        clock.drift = 0.0
        clock.offset = clock.lowest
        clock.residual = math.inf
    row = clock.points % POINTS
    clock.places[row] = clock.lowest_at
    clock.excesses[row] = clock.lowest
    clock.points += 1
    clock.spread = clock.latest
    if clock.points <= ENOUGH_POINTS:
        clock.usual = max(clock.usual, clock.spread)
    else:
        clock.usual += USUAL_GAIN * (clock.spread - clock.usual)
    if clock.points >= ENOUGH_POINTS:
        _draw_line(clock)
        if clock.together > FEW_TOGETHER * clock.frames:
            # all frames of a batch carry its time: when each was sent lies somewhere within a cycle
            clock.residual += clock.samples * clock.interval
        if clock.prompt < FEW_PROMPT * clock.frames:
            clock.residual += LEAST_OF_DELAYS * clock.waited / clock.frames
    _open_window(clock, now)


@inner_separate
def _draw_line(clock) -> None:  # type: ignore[no-untyped-def]
    """The edge of the lower convex hull under the middle of the points, and how far the points are from it."""
    count = min(clock.points, POINTS)
    order = ascending(clock.places[:count])
    x = clock.places[:count][order]
    y = clock.excesses[:count][order]
    hull = np.empty(count, np.int64)
    size = 0
    for k in range(count):
        while size >= 2 and _is_above(x, y, hull[size - 2], hull[size - 1], k):
            size -= 1
        hull[size] = k
        size += 1
    middle = x.mean()
    edge = 0
    while edge < size - 2 and x[hull[edge + 1]] < middle:
        edge += 1
    a, b = hull[edge], hull[edge + 1]
    clock.drift = (y[b] - y[a]) / (x[b] - x[a])
    clock.offset = y[a] - clock.drift * x[a]
    clock.residual = math.inf
    if abs(clock.drift) <= MAX_DRIFT * clock.interval:
        # not their greatest: in some windows every frame may have been late
        distances = y - clock.offset - clock.drift * x
        clock.residual = distances[ascending(distances)[3 * count // 4]]


@inner
def _is_above(x: NDArray[np.float64], y: NDArray[np.float64], a: int, b: int, c: int) -> bool:
    """Whether point b lies on or above the straight line from a to c."""
    return bool((y[b] - y[a]) * (x[c] - x[a]) >= (y[c] - y[a]) * (x[b] - x[a]))


def jitter_of(clock: np.void) -> Jitter:
    """Delays since the line is known; nothing is known of frames before."""
    frames = int(clock["delays"])
    if frames == 0:
        return Jitter(0, math.nan, math.nan)
    mean = float(clock["delay_sum"]) / frames
    variance = max(0.0, float(clock["delay_squares"]) / frames - mean * mean)
    return Jitter(frames, math.sqrt(variance) * 1e-9, float(clock["delay_max"]) * 1e-9)
