# Follows the zero of a shut needle's lift, which is no motion.
#
# A zero faster than its mean can follow (hum) is extrapolated: level and slope come from a mean and its own mean.

cdef enum:
    RECENT = 4000  # samples since a step, by when its mean is the running one
    LATELY = 256  # squares of the noise: it has fallen where their mean is FALLEN times less than that of all
    _BEGINNING = 1000  # samples; afterwards every second one is looked at
    _LOOK = 32  # of these after which dead band and crosstalk are worked out

cdef double FURTHEST_ZERO = 40e-6  # m, of a zero that is followed
cdef double ZERO_RATE = 800.0  # 1/s: share of a sample in the running zero over the sample interval
cdef double NEAR_RATE = 1600.0  # 1/s
cdef double MOVES = 0.2e-6  # m, rms of a mean over its own mean, from which on the zero moves; and ..
cdef double MOVES_BEYOND = 0.2  # .. standard deviations of a sample: eight times what white noise does at 100 kHz
cdef double MOVES_RATE = 25.0  # 1/s, of that mean square
cdef double MOVES_ON = 5e-3  # s without standstill in which the zero goes on as before
cdef double CLIP = 0.6  # of the dead band, three sigma: by more a sample does not count
cdef double FALLEN = 4.0


cdef inline void take_out_zero(Observer* observer, int64_t position) noexcept nogil:
    """Work out the lift of all samples known at `position`: the recorded one without its zero and crosstalk.

    It is done here and not when samples are received, because how many come at once must not matter.
    """
    memory = observer.memory
    zero, resting = &memory.lift_zero, &memory.resting_lift
    end = position + lookahead_at(observer, position) + 1
    if zero.lifted == 0:
        _begin(observer, end)
    for k in range(zero.lifted, end):
        row = &observer.ring[k & MASK]
        row.lift = row.needle_lift - resting.zero
        if resting.crosstalk != 0.0:
            pressed = resting.crosstalk * (row.line_pressure - memory.crosstalk.line_mean)
            if abs(pressed) < FURTHEST_ZERO:  # a line pressure that is a number
                row.lift -= pressed
    zero.lifted = end


cdef void _begin(Observer* observer, int64_t end) noexcept nogil:
    """Begin with the zero and crosstalk that were known before the first samples, which end before `end`.

    The zero is forgotten where it would open a needle that is shut without it. The line pressure's mean begins at the
    rail pressure, because the line may still ring, or fill.
    """
    memory = observer.memory
    resting, band = &memory.resting_lift, &memory.dead_band
    if resting.crosstalk != 0.0:
        memory.crosstalk.line_mean = observer.ring[0].rail_pressure
    lift = 0.0
    for k in range(end):
        lift += observer.ring[k].needle_lift / end
    if resting.zero + band.lift_on < lift < band.lift_on:
        shift_zero(observer, end, -resting.zero)


cdef inline bint is_beyond_limit(Observer* observer) noexcept nogil:
    """Whether the zero has gone further than drift does: the needle may not be shut at all."""
    return abs(observer.memory.resting_lift.zero) >= FURTHEST_ZERO


cdef void follow_lift(Observer* observer, int64_t position) noexcept nogil:
    """Take the lift at `position` into the stop of an open needle, or into zero and noise of one at rest."""
    memory = observer.memory
    if memory.needle.is_open:
        _move_on(observer, position)
        follow_opening(observer, position)
        forget_step(observer, position)
        return
    if memory.stop.highest > 0.0:
        take_opening(observer)
    row = &observer.ring[position & MASK]
    if row.index - memory.needle.shut_index <= observer.constants.timing.bounce:
        _move_on(observer, position)
    elif not (row.interpolated or (memory.lift_zero.count >= _BEGINNING and row.index % 2)):
        _follow_at_rest(observer, position)


cdef void _follow_at_rest(Observer* observer, int64_t position) noexcept nogil:
    """Take the lift of a needle at rest into its zero, steps of it, its noise and its crosstalk."""
    cdef bint has_begun
    memory = observer.memory
    zero, resting, regression = &memory.lift_zero, &memory.resting_lift, &memory.crosstalk
    row, interval = &observer.ring[position & MASK], observer.constants.interval
    has_begun = zero.count >= _BEGINNING
    follow_step(observer, position, min((2.0 if has_begun else 1.0) * QUICK_RATE * interval, 1.0))
    lift = row.needle_lift - resting.zero
    if not isfinite(lift):
        return
    swing = _swing(observer, row.line_pressure)
    zero.count += 1
    share = 2.0 * ZERO_RATE * interval
    if not has_begun:
        share = max(1.0 / zero.count, 0.5 * share)
    regression.line_mean += share * swing
    clip = CLIP * memory.dead_band.lift_on
    # what was known of the crosstalk before these samples moves no zero until they confirm it
    added = resting.crosstalk * swing if regression.count >= CROSSTALK_SAMPLES else 0.0
    left = min(max(lift - added, -clip), clip)
    _follow(observer, position, resting.zero + left, share)
    gather_crosstalk(observer, swing, lift)
    shut_for = row.index - memory.needle.shut_index
    if shut_for > observer.constants.timing.bounce + 4 and (zero.count % 2 == 0 or not has_begun):
        _gather_noise(observer, position, left)
    if zero.count % _LOOK == 0:
        _follow_dead_band(memory)
        expect_steps(observer)
        _find_crosstalk(observer)


cdef inline void _follow_dead_band(ObserverMemory* memory) noexcept nogil:
    """Widen the dead band to the lift's noise at once, and narrow it when enough samples show less."""
    resting, band = &memory.resting_lift, &memory.dead_band
    opens = opening_band(sqrt(max(resting.lift_variance, memory.lift_zero.spread)))
    if resting.lift_count >= ENOUGH_SAMPLES or opens > band.lift_on:
        band.lift_on, band.lift_off = opens, 0.5 * opens


cdef inline void _follow(Observer* observer, int64_t position, double lift, double share) noexcept nogil:
    """Take a shut needle's lift [m] into the mean by a share; the zero is the mean, or ahead of one that moves."""
    memory = observer.memory
    zero, resting = &memory.lift_zero, &memory.resting_lift
    interval = observer.constants.interval
    if position - memory.lift_step.stepped < RECENT:
        share = max(share, since_step(observer, position))
    near = max(share, 2.0 * NEAR_RATE * interval)
    zero.mean += share * (lift - zero.mean)
    zero.near += near * (lift - zero.near)
    zero.behind += near * (zero.near - zero.behind)
    ahead = zero.near - zero.behind
    zero.moves += 2.0 * MOVES_RATE * interval * (ahead * ahead - zero.moves)
    zero.followed = position
    if zero.moves > max(MOVES**2, MOVES_BEYOND**2 * resting.lift_variance):
        resting.zero = zero.near + ahead
        zero.slope = 0.5 * ahead * near / (1.0 - near)
    else:
        resting.zero = zero.mean
        zero.slope = 0.0
    resting.zero = min(max(resting.zero, -FURTHEST_ZERO), FURTHEST_ZERO)


cdef inline void _move_on(Observer* observer, int64_t position) noexcept nogil:
    """Move the zero on as before at a sample that does not show it, for a short time."""
    zero = &observer.memory.lift_zero
    if zero.slope != 0.0 and (position - zero.followed) * observer.constants.interval < MOVES_ON:
        shift_zero(observer, zero.lifted, zero.slope)


cdef void shift_zero(Observer* observer, int64_t begin, double step) noexcept nogil:
    """Move the zero, and the means that it comes from, by a step [m], within its limits.

    The lifts that are known already from the position `begin` on are corrected by the step.
    """
    resting, zero = &observer.memory.resting_lift, &observer.memory.lift_zero
    if not abs(resting.zero + step) <= FURTHEST_ZERO:
        step = copysign(FURTHEST_ZERO, resting.zero + step) - resting.zero
    resting.zero += step
    zero.mean += step
    zero.near += step
    zero.behind += step
    for k in range(begin, zero.lifted):
        observer.ring[k & MASK].lift -= step


cdef void _gather_noise(Observer* observer, int64_t position, double left) noexcept nogil:
    """Take a sample whose lift is `left` [m] about the zero into the noise of the lift."""
    resting, zero, ring = &observer.memory.resting_lift, &observer.memory.lift_zero, observer.ring
    square = square_of_difference(
        ring[(position - 4) & MASK].needle_lift, ring[(position - 3) & MASK].needle_lift,
        ring[(position - 2) & MASK].needle_lift, ring[(position - 1) & MASK].needle_lift,
        ring[position & MASK].needle_lift, DIFFERENCE_GAIN * resting.lift_variance * resting.lift_count,
        resting.lift_count, 1.0
    )
    resting.lift_count += 1
    share = 1.0 / min(resting.lift_count, LIFT_MEMORY)
    resting.lift_variance += share * (square / DIFFERENCE_GAIN - resting.lift_variance)
    zero.spread += share * (left * left - zero.spread)
    share = 1.0 / min(resting.lift_count, LATELY)
    zero.variance_lately += share * (square / DIFFERENCE_GAIN - zero.variance_lately)
    if resting.lift_count >= ENOUGH_SAMPLES:
        resting.lift_variance = min(resting.lift_variance, FALLEN * zero.variance_lately)
