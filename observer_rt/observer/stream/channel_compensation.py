"""Compensates the stated delay of the rail pressure and the stated lag of the lift sensor, sample by sample.

A rail pressure that is late is taken from later samples, on a straight line between two. A lift y whose sensor has
the time constant tau is y + tau y', by central differences: they leave ramps as straight as they are, and what they
take from one sample beside a corner they give to the next.
"""

import math

from observer_rt.foundation.compiled import inner
from observer_rt.foundation.continuity import RECORDED_RING
from observer_rt.model.effective import InputTerms
from observer_rt.observer.stream.state import LIFT, RAIL, Observer, Undoing

_MASK = RECORDED_RING - 1


def undoing_of(inputs: InputTerms, interval: float) -> Undoing:
    """What there is to undo at a sample interval [s]."""
    late = inputs.rail_delay / interval
    whole = math.floor(late)
    ahead = max(math.ceil(late), int(inputs.lift_lag > 0.0), 0)
    stated = inputs.rail_delay != 0.0 or inputs.lift_lag != 0.0
    return Undoing(stated, whole, late - whole, inputs.lift_lag / interval, ahead)


def noise_gain(lag: float) -> float:
    """By what the white noise of a lift is multiplied where a lag of its sensor [samples] is undone."""
    return math.sqrt(1.0 + 0.5 * lag**2)  # of central differences


@inner
def true_rail_pressure(observer: Observer, number: int) -> float:
    """Of the `number`-th sample [Pa]; at the ends of a stretch that of its first or last sample."""
    memory = observer.memory[0]
    undoing = observer.constants.undoing
    last = memory.recorded - 1
    earlier = min(max(number + undoing.rail_late, memory.unbroken_since), last)
    later = min(max(number + undoing.rail_late + 1, memory.unbroken_since), last)
    start = observer.recorded[earlier & _MASK].values[RAIL]
    end = observer.recorded[later & _MASK].values[RAIL]
    return float(start + undoing.rail_fraction * (end - start))


@inner
def true_lift(observer: Observer, number: int) -> float:
    """Of the `number`-th sample [m]; at the ends of a stretch from the one neighbour it has."""
    memory = observer.memory[0]
    before = max(number - 1, memory.unbroken_since)
    after = min(number + 1, memory.recorded - 1)
    lift = observer.recorded[number & _MASK].values[LIFT]
    if after == before:
        return float(lift)
    rise = observer.recorded[after & _MASK].values[LIFT] - observer.recorded[before & _MASK].values[LIFT]
    return float(lift + observer.constants.undoing.lift_lag * rise / (after - before))
