"""The lift of a shut needle that steps: a connection that moved, or the current through the coil.

The coil is energized some tenths of a millisecond before the needle opens, and no more when it closes: a step so
shortly before an opening is gone when the needle sinks. At the lifts in between, which limit no flow, it matters
little.

A needle that has come down and lingers just off its seat: it is shut, and its lift's zero is there.

Sensors creep: after a long opening a shut needle shows some micrometres for milliseconds. Taken for an open one, the
injection would go on for as long.
"""

import math

from observer_rt.foundation.compiled import inlined, inner, inner_separate
from observer_rt.observer.stream.front_end import LOWEST, known
from observer_rt.observer.stream.state import RING, Observer

QUICK = 80e-6  # s, of the mean that shows a step
LASTS = 60e-6  # s, of a step; every second sample is looked at
FEWEST = 2  # samples of that
QUICK_RATE = 1.0 / QUICK  # 1/s
STANDS_OUT = 6.0  # standard deviations of that mean, as it was lately
LEAST = 0.5e-6  # m
QUICK_MEMORY = 40e-3  # s
BEGINNING = 256  # squares of the noise, before a step is told from it
BEFORE_OPENING = 0.6e-3  # s before an opening, within which a step is one of the current
SUNK = 10e-6  # m below its summit, and ..
SUNK_BANDS = 2.0  # .. so many dead bands: a needle closes
START_LIMIT = LOWEST  # m, of a lift that may be the zero of a shut needle
LONG_PAST = -RING  # position of a step that there was not
FURTHEST_ZERO = 40e-6  # m, of a zero that is followed
_MASK = RING - 1


@inlined
def follow_step(observer: Observer, position: int, share: float) -> None:
    """At a sample of a needle at rest: look for a step of its lift, and have the zero follow it at once.

    share: of the sample, with the one before it, in the quick mean.
    """
    memory = observer.memory[0]
    lift = 0.5 * (observer.ring[position & _MASK].lift + observer.ring[(position - 1) & _MASK].lift)
    if not abs(lift) < START_LIMIT + memory.lift_on:
        memory.quick = 0.0
        memory.quiet = position
        return
    memory.quick += share * (lift - memory.quick)
    square = memory.quick * memory.quick
    if square <= memory.quick_limit:
        memory.quiet = position
        memory.quick_squares += QUICK / QUICK_MEMORY * share * (square - memory.quick_squares)
        return
    memory.quick_squares += QUICK / QUICK_MEMORY * share * (memory.quick_limit - memory.quick_squares)
    if position - memory.quiet >= _samples(observer) and memory.lift_count >= BEGINNING:
        _take_step(observer, position)


@inner
def expect_steps(observer: Observer) -> None:
    """How far the noise at rest moves the mean that shows a step."""
    memory = observer.memory[0]
    by_noise = 0.5 * QUICK_RATE * observer.constants.interval * max(memory.lift_variance, memory.spread)
    memory.quick_limit = max(STANDS_OUT**2 * max(memory.quick_squares, by_noise), LEAST**2)


@inner
def _samples(observer: Observer) -> int:
    return max(round(LASTS / observer.constants.interval), FEWEST)


@inner
def _take_step(observer: Observer, position: int) -> None:
    """The lift has been another one for some samples up to a position: from there on that is the zero."""
    memory = observer.memory[0]
    count = min(position - memory.quiet, 2 * _samples(observer))
    step = 0.0
    for k in range(count):
        step += observer.ring[(position - k) & _MASK].lift / count
    is_steady = abs(step) < START_LIMIT
    for k in range(count):
        is_steady &= abs(observer.ring[(position - k) & _MASK].lift - step) < memory.lift_on
    memory.quick, memory.quiet = 0.0, position
    if not is_steady:
        return
    if (position - memory.stepped) * observer.constants.interval > BEFORE_OPENING:
        memory.before_step = memory.zero
    memory.stepped = position
    shift_zero(observer, position + 1, step)


@inlined
def since_step(observer: Observer, position: int) -> float:
    """Share of a sample in a mean over those since the last step of the zero."""
    return float(1.0 / (1.0 + _samples(observer) + 0.5 * (position - observer.memory[0].stepped)))


@inlined
def forget_step(observer: Observer, position: int) -> None:
    """At a sample with the needle open: once it sinks, the zero is that from before the current."""
    memory = observer.memory[0]
    lift = observer.ring[position & _MASK].lift
    if position == memory.opening or lift > memory.summit:
        memory.summit = lift
    is_of_current = (memory.opening - memory.stepped) * observer.constants.interval < BEFORE_OPENING
    if is_of_current and memory.summit - lift > max(SUNK, SUNK_BANDS * memory.lift_on):
        step = memory.zero - memory.before_step
        memory.stepped = LONG_PAST
        shift_zero(observer, position + 1, -step)


@inner
def shift_zero(observer: Observer, begin: int, step: float) -> None:
    """The zero, and what it is worked out from, is another one by a step [m], within its limits.

    It was at the samples from `begin` on, too, whose lift is known already.
    """
    memory = observer.memory[0]
    if not abs(memory.zero + step) <= FURTHEST_ZERO:
        step = math.copysign(FURTHEST_ZERO, memory.zero + step) - memory.zero
    memory.zero += step
    memory.zero_mean += step
    memory.zero_near += step
    memory.zero_behind += step
    for k in range(begin, memory.lifted):
        observer.ring[k & _MASK].lift -= step


MOST_BANDS = 2.0  # dead bands: what stays higher than that is no creep of the zero
BEYOND_SEAT = LOWEST  # m, from which the needle must have come down


@inlined
def lingers(observer: Observer, position: int) -> bool:
    """Whether an open needle that is not recorded as shut may be at rest from shortly before `position` on."""
    memory = observer.memory[0]
    lift = observer.ring[position & _MASK].lift
    return bool(0.0 < lift < MOST_BANDS * memory.lift_on and memory.summit > BEYOND_SEAT)


@inner_separate
def come_to_rest(observer: Observer, position: int) -> bool:
    """Shut a needle that lingers at a lift just off its seat, and move the zero there; False if it still moves.

    Flat over the look-ahead and the samples before it: the top of a bounce is too short for that.
    """
    memory = observer.memory[0]
    before = observer.constants.timing.confirm
    begin, end = position - before, position + known(observer, position) + 1
    if begin <= memory.foot or end - position <= before:
        return False
    level = 0.0
    for k in range(begin, end):
        level += observer.ring[k & _MASK].lift / (end - begin)
    if not memory.lift_off < level < MOST_BANDS * memory.lift_on:
        return False
    trend, length = 0.0, 0.0
    for k in range(begin, end):
        row = observer.ring[k & _MASK]
        if not abs(row.lift - level) < memory.lift_on:
            return False
        along = k - 0.5 * (begin + end - 1)
        trend += along * row.lift
        length += along * along
    if not abs(trend / length) * (end - begin) < memory.lift_off:
        return False
    for k in range(begin, position):
        row = observer.ring[k & _MASK]
        row.lift_area = 0.0
        row.seat_area = 0.0
    memory.needle_open = False
    memory.shut_since = observer.ring[begin & _MASK].index
    shift_zero(observer, position, level)
    return True
