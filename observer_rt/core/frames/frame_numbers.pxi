# Numbers of frames without an index: by a counter where they carry one, and by a loop locked on their stamps.
#
# The n-th frame of a cyclic message was sent at t0 + n x cycle; its stamp lies later by a delay that is never
# negative. So a frame that comes late is late, not one of the next cycle: beyond what the counter itself shows, frames
# are lost only when the delay reaches the time in which the counter comes round (one cycle where there is no counter)
# and delays like that do not occur otherwise.

cdef enum:
    OLD_FRAMES_OF_RESTART = 3  # consecutive old frames that mean: the device began anew

cdef double SURE = 0.75  # cycles short of a whole turn of the counter, up to which a delay is surely no loss
cdef double DECIDED = 0.5  # the same, from which on frames are lost
cdef double UNUSUAL = 2.0  # times the usual greatest delay, and SURE of a cycle less than one, a delay means trouble
cdef double SLIPPED = 0.5  # cycles beyond what is not known, by which all delays of a window grew: frames were lost unseen


cdef int64_t count_frame(Counting* counting, Clock* clock, int64_t sequence, int64_t stamp) noexcept nogil:
    """Give a frame its `number`; returns how it was counted, `Count`.

    sequence: its counter; the clock counts in samples.
    """
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
        number += counting.modulus * <int64_t> floor((delay + DECIDED * cycle) / turn)
    elif step == 0:
        return COUNT_REPEATED
    elif delay < -DECIDED * cycle - clock.residual:
        # it cannot have come before it was sent
        counting.old += 1
        if counting.modulus == 1 or counting.old >= OLD_FRAMES_OF_RESTART or delay + turn < -DECIDED * cycle:
            _count_anew(counting, sequence)
            return COUNT_ANEW
        return COUNT_OLD
    counting.number, counting.sequence, counting.old = number, sequence, 0
    return COUNT_NEXT


cdef bint sees_losses(Counting* counting, Clock* clock) noexcept nogil:
    """Whether delays like those of the last window leave no doubt of how many frames were lost."""
    cycle = clock.samples * clock.interval
    return clock.points >= ENOUGH_POINTS and clock.spread < (counting.modulus - SURE) * cycle


cdef bint is_sure(Counting* counting, Clock* clock) noexcept nogil:
    """Whether the frames of this window and the last are numbered without doubt."""
    cycle = clock.samples * clock.interval
    latest = max(clock.spread, clock.latest)
    return (
        clock.residual < INFINITY
        and latest < (counting.modulus - SURE) * cycle
        and latest < UNUSUAL * clock.usual + (1.0 - SURE) * cycle
    )


cdef bint has_slipped(Clock* clock) noexcept nogil:
    """Whether the window just ended shows that frames were lost before it, unseen among their delays."""
    return clock.raised > SLIPPED * clock.samples * clock.interval + clock.residual


cdef void _count_anew(Counting* counting, int64_t sequence) noexcept nogil:
    counting.begun, counting.sequence = True, sequence
    counting.number = counting.old = 0
