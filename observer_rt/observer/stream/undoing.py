"""Samples as they are recorded, on their way to the observer: what is stated of their channels is undone.

A rail pressure that is late is taken from later samples, on a straight line between two. A lift y whose sensor has
the time constant tau is y + tau y', by central differences: they leave ramps as straight as they are, and what they
take from one sample beside a corner they give to the next.
"""

import math

from observer_rt.foundation.compiled import inner
from observer_rt.model.effective import InputTerms
from observer_rt.observer.stream.state import WAITING, Observer, Undoing

_MASK = WAITING - 1
_NO_DOUBT = 0


def undoing_of(inputs: InputTerms, interval: float) -> Undoing:
    """What there is to undo at a sample interval [s]."""
    late = inputs.rail_delay / interval
    whole = math.floor(late)
    ahead = max(math.ceil(late), int(inputs.lift_lag > 0.0), 0)
    stated = inputs.rail_delay != 0.0 or inputs.lift_lag != 0.0
    return Undoing(stated, whole, late - whole, inputs.lift_lag / interval, ahead)


def louder(lag: float) -> float:
    """By what the white noise of a lift is multiplied where a lag of its sensor [samples] is undone."""
    return math.sqrt(1.0 + 0.5 * lag**2)  # of central differences


@inner
def keep_waiting(
    observer: Observer,
    index: int,
    rail_pressure: float,
    needle_lift: float,
    line_pressure: float,
    interpolated: bool,
    broken: int,
    doubt: int,
    lift_after: float,
    rail_share: float,
) -> None:
    """Take a sample in, until those after it are known; a doubt is one in all that wait."""
    memory = observer.memory[0]
    if broken != 0:
        memory.unbroken_since = memory.recorded
    row = memory.waiting_samples[memory.recorded & _MASK]
    row.index = index
    row.rail_pressure = rail_pressure
    row.needle_lift = needle_lift
    row.line_pressure = line_pressure
    row.lift_after = lift_after
    row.rail_share = rail_share
    row.interpolated = interpolated
    row.broken = broken
    row.doubt = doubt
    memory.recorded += 1
    if doubt != _NO_DOUBT:
        for number in range(memory.given_on, memory.recorded):
            memory.waiting_samples[number & _MASK].doubt = doubt


@inner
def true_rail_pressure(observer: Observer, number: int) -> float:
    """Of the `number`-th sample [Pa]; at the ends of a stretch that of its first or last sample."""
    memory = observer.memory[0]
    undoing = observer.constants.undoing
    last = memory.recorded - 1
    earlier = min(max(number + undoing.rail_late, memory.unbroken_since), last)
    later = min(max(number + undoing.rail_late + 1, memory.unbroken_since), last)
    start = memory.waiting_samples[earlier & _MASK].rail_pressure
    end = memory.waiting_samples[later & _MASK].rail_pressure
    return float(start + undoing.rail_fraction * (end - start))


@inner
def true_lift(observer: Observer, number: int) -> float:
    """Of the `number`-th sample [m]; at the ends of a stretch from the one neighbour it has."""
    memory = observer.memory[0]
    before = max(number - 1, memory.unbroken_since)
    after = min(number + 1, memory.recorded - 1)
    lift = memory.waiting_samples[number & _MASK].needle_lift
    if after == before:
        return float(lift)
    rise = (
        memory.waiting_samples[after & _MASK].needle_lift - memory.waiting_samples[before & _MASK].needle_lift
    )
    return float(lift + observer.constants.undoing.lift_lag * rise / (after - before))
