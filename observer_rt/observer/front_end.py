"""From measured lift to seat area: dead band with hysteresis, look-back to the foot of the ramp."""

from numba import njit

from observer_rt.observer.state import RING, Observer

LOOK_BACK = 3  # samples before the crossing of the dead band whose raw lift counts
CONFIRM = 2  # consecutive samples that decide
LOOKAHEAD = LOOK_BACK + CONFIRM - 1  # samples the front end must know beyond the one in hand
_MASK = RING - 1


@njit(cache=True, nogil=True)
def known(observer: Observer, position: int) -> int:
    """How many samples after `position` are received and follow it without a break (at most LOOKAHEAD)."""
    count = 0
    received = observer.memory[0].received
    while (
        count < LOOKAHEAD
        and position + count + 1 < received
        and observer.ring[(position + count + 1) & _MASK].broken == 0
    ):
        count += 1
    return count


@njit(cache=True, nogil=True)
def opens_at(observer: Observer, position: int) -> bool:
    """Whether the dead band is crossed at `position` or soon after: the needle counts as open from there on."""
    threshold = observer.memory[0].lift_on
    run = 0
    for ahead in range(known(observer, position) + 1):
        if observer.ring[(position + ahead) & _MASK].needle_lift > threshold:
            run += 1
            if run == CONFIRM:
                return True
        else:
            run = 0
    return False


@njit(cache=True, nogil=True)
def closes_at(observer: Observer, position: int) -> bool:
    """Whether an open needle counts as closed from `position` on (not while the ramp is still to come)."""
    threshold = observer.memory[0].lift_off
    for ahead in range(min(known(observer, position) + 1, CONFIRM)):
        if observer.ring[(position + ahead) & _MASK].needle_lift > threshold:
            return False
    return not opens_at(observer, position)
