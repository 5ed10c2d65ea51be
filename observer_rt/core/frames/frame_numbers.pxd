# Numbers of frames without an index: by a counter where they carry one, and by a loop locked on their stamps.
#
# The n-th frame of a cyclic message was sent at t0 + n x cycle; its stamp lies later by a delay that is never
# negative. So a frame that comes late is late, not one of the next cycle: beyond what the counter itself shows, frames
# are lost only when the delay reaches the time in which the counter comes round (one cycle where there is no counter)
# and delays like that do not occur otherwise. A delay that is no whole number of such times is a pause, or a clock set
# anew. A frame that could not be sent by the time of its stamp is overtaken by a later one, and late; its counter may
# say so before the clock is known.

from libc.math cimport INFINITY, floor, fmin
from libc.stdint cimport int64_t

from observer_rt.core.frames.clock cimport ENOUGH_POINTS, delay_of
from observer_rt.core.frames.records cimport Clock, Counting

cdef enum:  # Count
    COUNT_NEXT, COUNT_REPEATED, COUNT_OLD, COUNT_ANEW

cdef enum:
    OLD_FRAMES_OF_RESTART = 3  # consecutive old frames that mean: the device began anew

cdef extern from *:
    """
    #define SURE 0.75
    #define DECIDED 0.5
    #define UNUSUAL 2.0
    #define WANDER 10e-6
    #define UNKNOWN 0.1e9
    #define SLIPPED 0.5
    """
    const double SURE  # cycles short of a whole turn of the counter, up to which a delay is surely no loss
    const double DECIDED  # the same, from which on frames are lost
    const double UNUSUAL  # times the usual greatest delay, and SURE of a cycle less than one, a delay means trouble
    const double WANDER  # of a delay, by which a clock that was known may have gone astray meanwhile
    const double UNKNOWN  # ns, that the first frames may be late by while the clock is not known
    const double SLIPPED  # cycles beyond what is not known, by which all delays of a window grew: frames were lost unseen


cdef inline int64_t count_frame(Counting* counting, Clock* clock, int64_t sequence, int64_t stamp) noexcept nogil:
    """Give a frame its `number`, by its counter `sequence`; returns how it was counted, `Count`."""
    if not counting.begun:
        _count_anew(counting, sequence)
        return COUNT_NEXT
    cycle = clock.samples * clock.interval
    turn = counting.modulus * cycle
    cdef int64_t step = 1
    if counting.modulus > 1:
        step = (sequence - counting.sequence) % counting.modulus
        step += counting.modulus if step < 0 else 0
    number = counting.number + step
    delay = delay_of(clock, (number + 1) * clock.samples - 1, stamp)
    if delay >= turn - DECIDED * cycle and sees_losses(counting, clock):
        turns = floor((delay + DECIDED * cycle) / turn)
        off = abs(delay - turns * turn)
        if min(off, turn - off) > DECIDED * cycle + UNUSUAL * clock.usual + WANDER * delay:
            _count_anew(counting, sequence)
            return COUNT_ANEW
        number += counting.modulus * <int64_t> turns
    elif step == 0:
        return COUNT_REPEATED
    elif delay < -DECIDED * cycle - _unknown(counting, clock, turn):
        # it cannot have come before it was sent
        counting.old += 1
        if counting.modulus == 1 or counting.old >= OLD_FRAMES_OF_RESTART or delay + turn < -DECIDED * cycle:
            _count_anew(counting, sequence)
            return COUNT_ANEW
        return COUNT_OLD
    counting.number, counting.sequence, counting.old = number, sequence, 0
    return COUNT_NEXT


cdef inline bint sees_losses(Counting* counting, Clock* clock) noexcept nogil:
    """Whether delays like those of the last window leave no doubt of how many frames were lost."""
    cycle = clock.samples * clock.interval
    return clock.points >= ENOUGH_POINTS and clock.spread < (counting.modulus - SURE) * cycle


cdef inline bint is_sure(Counting* counting, Clock* clock) noexcept nogil:
    """Whether the frames of this window and the last are numbered without doubt."""
    cycle = clock.samples * clock.interval
    latest = max(clock.spread, clock.latest)
    return (
        clock.residual < INFINITY
        and latest < (counting.modulus - SURE) * cycle
        and latest < UNUSUAL * clock.usual + (1.0 - SURE) * cycle
    )


cdef inline bint has_slipped(Clock* clock) noexcept nogil:
    """Whether the window just ended shows that frames were lost before it, unseen among their delays."""
    return clock.raised > SLIPPED * clock.samples * clock.interval + clock.residual


cdef inline double _unknown(Counting* counting, Clock* clock, double turn) noexcept nogil:
    """Time [ns] by which a frame may seem to come too early and be the next one all the same."""
    # with a counter: beyond half a turn it is likelier one of the turn before
    return clock.residual if counting.modulus == 1 else fmin(clock.residual, fmin(0.5 * turn, UNKNOWN))


cdef inline void _count_anew(Counting* counting, int64_t sequence) noexcept nogil:
    counting.begun, counting.sequence = True, sequence
    counting.number = counting.old = 0
