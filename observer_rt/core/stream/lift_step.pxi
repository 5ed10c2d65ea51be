# Steps of the lift of a shut needle: a connection has moved, or a current flows through the coil.
#
# The coil is energized some tenths of a millisecond before the needle opens, and no more when it closes: a step so
# shortly before an opening is gone when the needle sinks. At the lifts in between, which limit no flow, it matters
# little.
#
# A needle that has come down and lingers just off its seat is shut, and its lift's zero is there: sensors creep, and
# show some micrometres of a shut needle for milliseconds after a long opening, for which the injection would go on.

cpdef enum:
    FEWEST = 2  # samples of a step
    BEGINNING = 256  # squares of the noise, before a step is told from it
    LONG_PAST = -RING  # position of a step that there was not

cdef double QUICK = 80e-6  # s, of the mean that shows a step
cdef double LASTS = 60e-6  # s, of a step; every second sample is looked at
cdef double QUICK_RATE = 1.0 / QUICK  # 1/s
cdef double STANDS_OUT = 6.0  # standard deviations of that mean, as it was lately
cdef double LEAST = 0.5e-6  # m
cdef double QUICK_MEMORY = 40e-3  # s
cdef double BEFORE_OPENING = 0.6e-3  # s before an opening, within which a step is one of the current
cdef double SUNK = 10e-6  # m below its summit, and ..
cdef double SUNK_BANDS = 2.0  # .. so many dead bands: a needle closes
cdef double START_LIMIT = LOWEST  # m, of a lift that may be the zero of a shut needle
cdef double MOST_BANDS = 2.0  # dead bands: what stays higher than that is no creep of the zero
cdef double BEYOND_SEAT = LOWEST  # m, from which the needle must have come down


cdef inline void follow_step(Observer* observer, int64_t position, double share) noexcept nogil:
    """Look for a step of the lift of a needle at rest, for the zero to follow; share: of the sample in the mean."""
    memory = observer.memory
    lift_step, resting = &memory.lift_step, &memory.resting_lift
    lift = 0.5 * (observer.ring[position & MASK].lift + observer.ring[(position - 1) & MASK].lift)
    if not abs(lift) < START_LIMIT + memory.dead_band.lift_on:
        lift_step.quick = 0.0
        lift_step.quiet = position
        return
    lift_step.quick += share * (lift - lift_step.quick)
    square = lift_step.quick * lift_step.quick
    if square <= lift_step.quick_limit:
        lift_step.quiet = position
        resting.quick_squares += QUICK / QUICK_MEMORY * share * (square - resting.quick_squares)
        return
    resting.quick_squares += QUICK / QUICK_MEMORY * share * (lift_step.quick_limit - resting.quick_squares)
    if position - lift_step.quiet >= _samples(observer) and resting.lift_count >= BEGINNING:
        _take_step(observer, position)


cdef void expect_steps(Observer* observer) noexcept nogil:
    """Set the limit of the mean that shows a step, beyond what the noise at rest does."""
    memory = observer.memory
    resting = &memory.resting_lift
    noise = max(resting.lift_variance, memory.lift_zero.spread)
    by_noise = 0.5 * QUICK_RATE * observer.constants.interval * noise
    memory.lift_step.quick_limit = max(STANDS_OUT**2 * max(resting.quick_squares, by_noise), LEAST**2)


cdef int64_t _samples(Observer* observer) noexcept nogil:
    """How many samples a step lasts at least."""
    return max(<int64_t> rint(LASTS / observer.constants.interval), FEWEST)


cdef void _take_step(Observer* observer, int64_t position) noexcept nogil:
    """Move the zero by the mean of the last lifts up to a position, if they have stepped and stay."""
    cdef bint is_steady
    memory = observer.memory
    lift_step = &memory.lift_step
    count = min(position - lift_step.quiet, 2 * _samples(observer))
    step = 0.0
    for k in range(count):
        step += observer.ring[(position - k) & MASK].lift / count
    is_steady = abs(step) < START_LIMIT
    for k in range(count):
        is_steady &= abs(observer.ring[(position - k) & MASK].lift - step) < memory.dead_band.lift_on
    lift_step.quick, lift_step.quiet = 0.0, position
    if not is_steady:
        return
    if (position - lift_step.stepped) * observer.constants.interval > BEFORE_OPENING:
        lift_step.before_step = memory.resting_lift.zero
    lift_step.stepped = position
    shift_zero(observer, position + 1, step)


cdef inline double since_step(Observer* observer, int64_t position) noexcept nogil:
    """Share of a sample in a mean over the samples since the last step of the zero."""
    return 1.0 / (1.0 + _samples(observer) + 0.5 * (position - observer.memory.lift_step.stepped))


cdef inline void forget_step(Observer* observer, int64_t position) noexcept nogil:
    """Take back a step by the coil's current, which has ended once the open needle sinks."""
    cdef bint is_of_current
    memory = observer.memory
    needle, lift_step = &memory.needle, &memory.lift_step
    lift = observer.ring[position & MASK].lift
    if position == needle.opening_position or lift > lift_step.summit:
        lift_step.summit = lift
    is_of_current = (needle.opening_position - lift_step.stepped) * observer.constants.interval < BEFORE_OPENING
    if is_of_current and lift_step.summit - lift > max(SUNK, SUNK_BANDS * memory.dead_band.lift_on):
        step = memory.resting_lift.zero - lift_step.before_step
        lift_step.stepped = LONG_PAST
        shift_zero(observer, position + 1, -step)


cdef inline bint lingers(Observer* observer, int64_t position) noexcept nogil:
    """Whether an open needle that is not recorded as shut may be at rest from shortly before `position` on."""
    memory = observer.memory
    lift = observer.ring[position & MASK].lift
    return 0.0 < lift < MOST_BANDS * memory.dead_band.lift_on and memory.lift_step.summit > BEYOND_SEAT


cdef bint come_to_rest(Observer* observer, int64_t position) noexcept nogil:
    """Shut a needle that lingers at a lift just off its seat, and move the zero there; False if it still moves.

    The lift must be flat over the look-ahead and the samples before it: the top of a bounce is shorter.
    """
    memory = observer.memory
    band = &memory.dead_band
    before = observer.constants.timing.confirm
    begin, end = position - before, position + lookahead_at(observer, position) + 1
    if begin <= memory.ramp.foot or end - position <= before:
        return False
    level = 0.0
    for k in range(begin, end):
        level += observer.ring[k & MASK].lift / (end - begin)
    if not band.lift_off < level < MOST_BANDS * band.lift_on:
        return False
    trend, length = 0.0, 0.0
    for k in range(begin, end):
        row = &observer.ring[k & MASK]
        if not abs(row.lift - level) < band.lift_on:
            return False
        along = k - 0.5 * (begin + end - 1)
        trend += along * row.lift
        length += along * along
    if not abs(trend / length) * (end - begin) < band.lift_off:
        return False
    for k in range(begin, position):
        row = &observer.ring[k & MASK]
        row.lift_area = row.seat_area = 0.0
    shut_needle(observer, observer.ring[begin & MASK].index)
    shift_zero(observer, position, level)
    return True
