"""A needle that has come down and lingers just off its seat: it is shut, and its lift's zero is there.

Sensors creep: after a long opening a shut needle shows some micrometres for milliseconds. Taken for an open one, the
injection would go on for as long.
"""

from observer_rt.foundation.compiled import inlined, inner_separate
from observer_rt.observer.stream.front_end import LOWEST, known
from observer_rt.observer.stream.lift_step import shift_lifts, shift_zero
from observer_rt.observer.stream.state import RING, Observer

MOST_BANDS = 2.0  # dead bands: what stays higher than that is no creep of the zero
BEYOND_SEAT = LOWEST  # m, from which the needle must have come down
_MASK = RING - 1


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
    shift_zero(observer, level)
    shift_lifts(observer, position, level)
    return True
