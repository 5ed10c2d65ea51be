"""Samples that no sensor means: spikes, frozen and clipped stretches, dropouts. Recognised as they come, one by one.

A value that must not be used is marked in `bridged` of its sample. For a line pressure x~ then goes on by the model,
without correction, and what is learned leaves it out; a rail pressure or lift is replaced by its neighbours or held.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.foundation.continuity import Doubt
from observer_rt.observer.stream.state import LIFT, LINE, RAIL, REACH, RING, Observer

SLOWEST_FILTER = 21e-6  # s of a sample period, up to which seven samples are short for a line
STEP = 5.0  # standard deviations between two samples, after which spikes are looked for
SPIKE = 4.5  # from the median of the seven
DEVIATION = 1.4826  # standard deviation of normal numbers over their median absolute deviation
UNLIKELY = math.log(1e-8)  # probability a sample of so many equal values by chance
FEWEST_REPEATS = 4  # that are a frozen value: so many samples wait for their look-ahead
UNLIKELY_AFTER_LEAP = math.log(1e-4)
FEWEST_AFTER_LEAP = 2
MOST_SAMPLES = RING  # more than ever may be bridged
WELL_KNOWN = 1000  # samples from which on the share of equal neighbours is known
DROPOUT = 30.0  # standard deviations by which a value that then stays is a dropout
LEAP = 10.0  # of e~ from one sample to the next; a wrong model's grows over several
_MASK = RING - 1
_NONE, _FROZEN, _CLIPPED = int(Doubt.NONE), int(Doubt.FROZEN), int(Doubt.CLIPPED)


@njit(cache=True, nogil=True, inline="always")
def inspect(observer: Observer, position: int) -> int:
    """Look at a sample as it is received, and at those before it; why it is not to be trusted (`Doubt`)."""
    channels = observer.memory[0].channels
    row = observer.ring[position & _MASK]
    doubt = _NONE
    if not row.interpolated and row.broken == 0:
        if _is_odd(channels[LINE], position, row.line_pressure):
            doubt = _look(observer, position, LINE, row.line_pressure)
        if _is_odd(channels[LIFT], position, row.needle_lift):
            doubt = max(doubt, _look(observer, position, LIFT, row.needle_lift))
        # of a slower rail pressure most values are made up
        is_fast = observer.constants.rail_every <= 1.0
        if is_fast and _is_odd(channels[RAIL], position, row.rail_pressure):
            doubt = max(doubt, _look(observer, position, RAIL, row.rail_pressure))
    return doubt


@njit(cache=True, nogil=True, inline="always")
def _is_odd(channel, position: int, value: float) -> bool:  # type: ignore[no-untyped-def]
    """Take in a value of a channel; whether there is more to be done than for most of them."""
    last = channel.last
    channel.last = value
    if value == last:
        channel.run += 1
        return bool(channel.run == 1 or channel.run >= channel.needed or position < channel.until)
    if channel.run > 0:
        if channel.run < channel.needed:
            channel.repeats += channel.run
        channel.run = 0
    if abs(value - last) > STEP * channel.noise:
        channel.until = position + 2 * REACH
    return bool(position < channel.until)


@njit(cache=True, nogil=True, inline="always")
def accepted(memory, longest: int, innovation: float) -> bool:  # type: ignore[no-untyped-def]
    """Whether an innovation of x~ [p_0] may correct it: not where it leaps, for `longest` samples at most."""
    leap = innovation - memory.accepted_innovation
    is_leap = leap * leap * memory.innovation_weight > LEAP * LEAP
    if is_leap and memory.synchronised and memory.leaping < longest:
        memory.leaping += 1
    else:
        memory.accepted_innovation = innovation
        memory.leaping = 0
    return bool(memory.leaping == 0)


@njit(cache=True, nogil=True)
def _look(observer: Observer, position: int, number: int, value: float) -> int:
    """Do what is to be done about a channel whose value at a position is odd; its `Doubt`."""
    channel = observer.memory[0].channels[number]
    if channel.run > 0:
        _follow_run(observer, position, number, value)
    elif channel.bridged > 0:
        channel.bridged -= 1
    if channel.bridged > 0:
        channel.until = max(channel.until, position + 2)
    _mend(observer, position - REACH, number)
    return int(_doubt(channel, number, observer.constants.timing.bridge))


@njit(cache=True, nogil=True)
def value_of(row, channel: int) -> float:  # type: ignore[no-untyped-def]
    """Of a sample, by number of the channel."""
    if channel == RAIL:
        return float(row.rail_pressure)
    if channel == LIFT:
        return float(row.needle_lift)
    return float(row.line_pressure)


@njit(cache=True, nogil=True)
def _replace(row, channel: int, value: float) -> None:  # type: ignore[no-untyped-def]
    if channel == RAIL:
        row.rail_pressure = value
    elif channel == LIFT:
        row.lift += value - row.needle_lift
        row.needle_lift = value
    else:
        row.line_pressure = value


@njit(cache=True, nogil=True)
def _follow_run(observer: Observer, position: int, number: int, value: float) -> None:
    """A channel has the value of the sample before: bridge it, once that is no chance."""
    channel = observer.memory[0].channels[number]
    longest = observer.constants.timing.bridge
    if channel.run == 1:
        _note_run(observer, position, number, value)
    if channel.run < channel.needed or channel.needed > longest:
        return
    if channel.run == channel.needed:
        channel.is_clipped = value == channel.held and not channel.is_dropout
        channel.held = value
        for k in range(channel.needed - int(not channel.is_dropout)):
            _bridge(observer, position - 1 - k, number)
    _bridge(observer, position, number)
    channel.bridged = min(channel.bridged, 2 * longest + 1)


@njit(cache=True, nogil=True)
def _note_run(observer: Observer, position: int, number: int, value: float) -> None:
    """Two samples, the second at `position`, have one value: how many must follow, and what it was before them."""
    channel = observer.memory[0].channels[number]
    channel.needed = MOST_SAMPLES
    if position <= observer.memory[0].segment_start + 1:
        return
    channel.instead = value_of(observer.ring[(position - 2) & _MASK], number)
    channel.is_dropout = abs(value - channel.instead) > DROPOUT * channel.noise
    channel.needed = repeats_needed(channel.repeats, position, channel.is_dropout)


@njit(cache=True, nogil=True)
def repeats_needed(repeats: int, samples: int, is_dropout: bool) -> int:
    """Equal neighbours in a row that are no chance, where so many of all samples had one; fewer after a leap."""
    if samples < WELL_KNOWN:
        return MOST_SAMPLES
    chance = (repeats + 1.0) / (samples + 1.0)
    if chance > 0.99:
        return MOST_SAMPLES
    if is_dropout:
        return max(FEWEST_AFTER_LEAP, math.ceil(UNLIKELY_AFTER_LEAP / math.log(chance)))
    return max(FEWEST_REPEATS, math.ceil(UNLIKELY / math.log(chance)))


@njit(cache=True, nogil=True)
def _doubt(channel, number: int, longest: int) -> int:  # type: ignore[no-untyped-def]
    """Of a channel, so many of whose last samples were bridged; inputs that are clipped are wrong from the start."""
    if channel.is_clipped and number != LINE:
        longest = 0
    if channel.bridged <= longest:
        return _NONE
    return _CLIPPED if channel.is_clipped else _FROZEN


@njit(cache=True, nogil=True)
def _bridge(observer: Observer, position: int, number: int) -> None:
    """Do not use a value: of an input, hold the one before a dropout."""
    channel = observer.memory[0].channels[number]
    row = observer.ring[position & _MASK]
    row.bridged |= 1 << number
    channel.bridged += 1
    observer.memory[0].bridged += 1
    if channel.is_dropout and number != LINE:
        _replace(row, number, channel.instead)


@njit(cache=True, nogil=True)
def _mend(observer: Observer, position: int, number: int) -> None:
    """Put a straight line in the place of a value that stands out among seven: Hampel's identifier."""
    memory = observer.memory[0]
    if not observer.constants.timing.filtered or position < memory.segment_start + REACH:
        return
    for k in range(1, 2 * REACH + 1):
        if observer.ring[(position - REACH + k) & _MASK].broken != 0:
            return
    around = memory.around
    for k in range(2 * REACH + 1):
        around[k] = value_of(observer.ring[(position - REACH + k) & _MASK], number)
    middle = _median(around)
    row = observer.ring[position & _MASK]
    for k in range(2 * REACH + 1):
        around[k] = abs(value_of(observer.ring[(position - REACH + k) & _MASK], number) - middle)
    limit = SPIKE * max(memory.channels[number].noise, DEVIATION * _median(around))
    if abs(value_of(row, number) - middle) <= limit:
        return
    earlier = value_of(observer.ring[(position - 1) & _MASK], number)
    later, distance = middle, 1
    for k in range(1, REACH + 1):
        following = value_of(observer.ring[(position + k) & _MASK], number)
        if abs(following - middle) <= limit:
            later, distance = following, k
            break
    _replace(row, number, earlier + (later - earlier) / (distance + 1))
    row.bridged |= 1 << number
    memory.spikes += 1


@njit(cache=True, nogil=True)
def _median(values: NDArray[np.float64]) -> float:
    """Of an odd number of values, which are sorted in place."""
    for i in range(1, values.shape[0]):
        value = values[i]
        j = i
        while j > 0 and values[j - 1] > value:
            values[j] = values[j - 1]
            j -= 1
        values[j] = value
    return float(values[values.shape[0] // 2])
