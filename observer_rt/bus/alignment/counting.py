"""Frames without an index are counted: by a counter where they carry one, and by a loop locked on their stamps.

The n-th frame of a cyclic message was sent at t0 + n x cycle; its stamp lies later by a delay that is never
negative. So a frame that comes late is late, not one of the next cycle: frames are lost only when the delay reaches
the time in which the counter comes round (one cycle where there is no counter) and delays like that do not occur
otherwise.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.clock import ENOUGH_POINTS, delay_of
from observer_rt.foundation.compiled import compiled, inner, separate

SURE = 0.75  # cycles short of a whole turn of the counter, up to which a delay is surely no loss
DECIDED = 0.5  # the same, from which on frames are lost
UNUSUAL = (
    2.0  # times the usual greatest delay, and SURE of a cycle less than one, is a delay that tells of trouble
)
SLIPPED = (
    0.5  # cycles beyond what is not known, by which all delays of a window grew: frames were lost unseen
)
OLD_FRAMES_OF_RESTART = 3  # consecutive old frames that mean: the device began anew

COUNTING = np.dtype(
    [
        ("modulus", np.int64),  # of the counter; 1 without one
        ("begun", np.bool_),
        ("number", np.int64),  # of the last frame
        ("sequence", np.int64),  # its counter
        ("old", np.int64),  # frames older than the last, consecutive
    ],
    align=True,
)


class Count(IntEnum):
    """What a frame is to the ones before it."""

    NEXT = 0
    REPEATED = 1
    OLD = 2  # overtaken by a later one
    ANEW = 3  # it fits nothing counted so far


def make_counting(modulus: int) -> NDArray[np.void]:
    """Memory (1,) for one message that no frame has come of; `modulus` of its counter, 1 without one."""
    counting = np.zeros(1, COUNTING)
    counting["modulus"] = modulus
    return counting


@separate
def count_frame(counting, clock, sequence: int, stamp: int) -> int:  # type: ignore[no-untyped-def]
    """Give a frame its `number`; `Count`. `sequence`: its counter; the clock counts in samples."""
    if not counting.begun:
        _count_anew(counting, sequence)
        return Count.NEXT
    cycle = clock.samples * clock.interval
    turn = counting.modulus * cycle
    step = (sequence - counting.sequence) % counting.modulus if counting.modulus > 1 else 1
    number = counting.number + step
    delay = delay_of(clock, (number + 1) * clock.samples - 1, stamp)
    if delay >= turn - DECIDED * cycle and sees_losses(counting, clock):
        number += counting.modulus * math.floor((delay + DECIDED * cycle) / turn)
    elif step == 0:
        return Count.REPEATED
    elif delay < -DECIDED * cycle - clock.residual:
        # it cannot have come before it was sent
        counting.old += 1
        if counting.modulus == 1 or counting.old >= OLD_FRAMES_OF_RESTART or delay + turn < -DECIDED * cycle:
            _count_anew(counting, sequence)
            return Count.ANEW
        return Count.OLD
    counting.number = number
    counting.sequence = sequence
    counting.old = 0
    return Count.NEXT


@inner
def sees_losses(counting, clock) -> bool:  # type: ignore[no-untyped-def]
    """Whether delays like those of the last window leave no doubt of how many frames were lost."""
    cycle = clock.samples * clock.interval
    return bool(clock.points >= ENOUGH_POINTS and clock.spread < (counting.modulus - SURE) * cycle)


@compiled
def is_sure(counting, clock) -> bool:  # type: ignore[no-untyped-def]
    """Whether the frames of this window and the last are numbered without doubt."""
    cycle = clock.samples * clock.interval
    latest = max(clock.spread, clock.latest)
    return bool(
        clock.residual < math.inf
        and latest < (counting.modulus - SURE) * cycle
        and latest < UNUSUAL * clock.usual + (1.0 - SURE) * cycle
    )


@compiled
def has_slipped(clock) -> bool:  # type: ignore[no-untyped-def]
    """Whether the window just ended shows that frames were lost before it, unseen among their delays."""
    return bool(clock.raised > SLIPPED * clock.samples * clock.interval + clock.residual)


@inner
def _count_anew(counting, sequence: int) -> None:  # type: ignore[no-untyped-def]
    counting.begun = True
    counting.number = 0
    counting.sequence = sequence
    counting.old = 0
