# Follows the zero of a shut needle's lift, which is no motion.
#
# Of a zero that moves on too fast for a mean, as hum lets it, level and slope are those of a mean and its mean.

cdef enum:
    EDGE = 3  # samples in which a lift steps
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
cdef double CALM = 0.7e6  # Pa, rms of a line pressure in which no injection rings
cdef double AS_CALM = 1.5  # times the mean square before: a calm line rings no more than that
cdef double FALLEN = 4.0


cdef inline void take_out_zero(Observer* observer, int64_t position) noexcept nogil:
    """Work out the lift of all samples known at `position`: the recorded one without what a shut needle shows.

    Not when they are received: how many come at once must not matter.
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
    """At the first samples, up to `end`: what was known before them of the lift is a start.

    Forgotten where it would make a needle open that else is shut. The line's mean is that of the rail until it is
    known: it may ring, or fill.
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
    """Take the lift at `position` into its zero, its noise and its crosstalk, if the needle is shut and at rest.

    Else into what is known of its stop.
    """
    cdef bint has_begun
    memory = observer.memory
    needle, zero, resting = &memory.needle, &memory.lift_zero, &memory.resting_lift
    regression, band = &memory.crosstalk, &memory.dead_band
    interval = observer.constants.interval
    row = &observer.ring[position & MASK]
    shut_for = row.index - needle.shut_index
    if needle.is_open:
        _move_on(observer, position)
        follow_opening(observer, position)
        forget_step(observer, position)
        return
    if memory.stop.highest > 0.0:
        take_opening(observer)
    if shut_for <= observer.constants.timing.bounce:
        _move_on(observer, position)
        return
    has_begun = zero.count >= _BEGINNING
    if row.interpolated or (has_begun and row.index % 2):
        return
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
    clip = CLIP * band.lift_on
    # what was known of the crosstalk before these samples moves no zero until they confirm it
    added = resting.crosstalk * swing if regression.count >= CROSSTALK_SAMPLES else 0.0
    left = min(max(lift - added, -clip), clip)
    _follow(observer, position, resting.zero + left, share)
    pressed = abs(swing) * observer.constants.pressure_scale
    if pressed > LEAST_SWING and abs(lift) < band.lift_on + MOST_CROSSTALK * pressed:
        regression.swing_squares += swing * swing - FADE * regression.swing_squares
        regression.swing_lifts += swing * lift - FADE * regression.swing_lifts
        regression.squares_lately += swing * swing - FADE_LATELY * regression.squares_lately
        regression.lifts_lately += swing * lift - FADE_LATELY * regression.lifts_lately
        regression.count += 1
    if shut_for > observer.constants.timing.bounce + 4 and (zero.count % 2 == 0 or not has_begun):
        _gather_noise(observer, position, left)
    if zero.count % _LOOK == 0:
        opens = opening_band(sqrt(max(resting.lift_variance, zero.spread)))
        if resting.lift_count >= ENOUGH_SAMPLES or opens > band.lift_on:
            band.lift_on, band.lift_off = opens, 0.5 * opens
        expect_steps(observer)
        _find_crosstalk(observer)


cdef inline void _follow(Observer* observer, int64_t position, double lift, double share) noexcept nogil:
    """The zero after a shut needle's lift [m], taken into its mean by a share: the mean, or where it moves to."""
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
    """The zero at a sample that does not show it."""
    zero = &observer.memory.lift_zero
    if zero.slope != 0.0 and (position - zero.followed) * observer.constants.interval < MOVES_ON:
        shift_zero(observer, zero.lifted, zero.slope)


cdef void shift_zero(Observer* observer, int64_t begin, double step) noexcept nogil:
    """The zero, and what it is worked out from, is another one by a step [m], within its limits.

    It was at the samples from `begin` on, too, whose lift is known already.
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
    """From a sample whose lift is `left` [m] about the zero."""
    resting, zero = &observer.memory.resting_lift, &observer.memory.lift_zero
    ring = observer.ring
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


cdef void look_at_start(Observer* observer, int64_t position) noexcept nogil:
    """A moment after the samples began: in a line at rest the needle was shut before, whatever lift it showed."""
    cdef bint has_opened
    memory = observer.memory
    under_way, needle = &memory.event, &memory.needle
    start = memory.positions.segment_start
    if observer.ring[start & MASK].broken != BREAK_START:
        return
    has_opened = under_way.number > 0
    if has_opened and not (needle.is_open and needle.opening_position == start and under_way.number == 1):
        return
    lifts, lift_squares, lines, line_squares = 0.0, 0.0, 0.0, 0.0
    count = position - start
    for k in range(start, position):
        row = &observer.ring[k & MASK]
        lifts += row.lift
        lift_squares += row.lift * row.lift
        line = row.line_pressure - observer.ring[start & MASK].line_pressure
        lines += line
        line_squares += line * line
    scale = observer.constants.pressure_scale
    if not (line_squares / count - (lines / count) ** 2) * scale**2 < CALM**2:
        return
    if has_opened:
        steady = lift_squares / count - (lifts / count) ** 2
        if not (steady < memory.dead_band.lift_on**2 and abs(lifts / count) < START_LIMIT):
            return
        forget_opening(observer)
        shift_zero(observer, start, lifts / count)
        observer.ring[position & MASK].lift_area = 0.0
        observer.ring[position & MASK].seat_area = 0.0
    shut_needle(observer, observer.ring[start & MASK].index - observer.constants.timing.settle)


cdef void look_at_opening(Observer* observer, int64_t position) noexcept nogil:
    """A while after an opening: a low lift that stepped and stays, in a line as calm as before, is of a shut needle.

    A connection that moved, or a drift that is gone: had the needle opened, the line pressure would have fallen.
    """
    cdef bint is_steady
    memory = observer.memory
    needle = &memory.needle
    opening, count = needle.opening_position, position - needle.opening_position
    if opening - count < memory.positions.segment_start:
        return
    scale = observer.constants.pressure_scale
    before = _mean_drop(observer, opening - count, opening)
    swing_before = _square_drop(observer, opening - count, opening, before) * scale**2
    swing = _square_drop(observer, opening, position, before) * scale**2
    if not swing < CALM**2 + AS_CALM * swing_before:
        return
    lifts, squares = 0.0, 0.0
    for k in range(opening + EDGE, position):
        lift = observer.ring[k & MASK].lift
        lifts += lift / (count - EDGE)
        squares += lift * lift / (count - EDGE)
    is_steady = squares - lifts**2 < memory.dead_band.lift_on**2
    if not (is_steady and abs(memory.resting_lift.zero + lifts) < FURTHEST_ZERO):
        return
    forget_opening(observer)
    shift_zero(observer, opening, lifts)
    row = &observer.ring[position & MASK]
    row.lift_area = 0.0
    row.seat_area = 0.0
    shut_needle(observer, row.index)


cdef void look_at_rest(Observer* observer, int64_t position) noexcept nogil:
    """Now and then: a low lift that has stayed is of a shut needle, if the line pressure has it so.

    Its zero stepped while it was open, or while nothing was heard of it. Of a needle that sticks just off its seat
    the line pressure is as the model has it. Where nothing is valid, time tells.
    A lift below its zero is never a motion.
    """
    cdef bint needs_time, is_steady
    memory, timing = observer.memory, &observer.constants.timing
    needle, band = &memory.needle, &memory.dead_band
    before = &observer.ring[(position - 1) & MASK]
    needs_time = needle.is_open and not memory.monitor.contradicted
    count = timing.stays if needs_time else timing.settle
    begin = position - count
    if begin < max(memory.ramp.foot, memory.positions.segment_start) or not (needle.is_open or before.resting):
        return
    if needs_time and (before.valid or not _is_line_full(observer, begin, position)):
        return
    level, squares, trend, length = 0.0, 0.0, 0.0, 0.0
    for k in range(begin, position):
        lift, along = observer.ring[k & MASK].lift, k - 0.5 * (begin + position - 1)
        level += lift / count
        squares += lift * lift / count
        trend += along * lift
        length += along * along
    is_steady = squares - level**2 < band.lift_off**2 and abs(trend / length) * count < band.lift_on
    if not (is_steady and abs(memory.resting_lift.zero + level) < FURTHEST_ZERO):
        return
    if needle.is_open:
        _shut_at_rest(observer, begin)
        shift_zero(observer, position, level)
    elif level < -band.lift_on:
        shift_zero(observer, position, level)


cdef bint _is_line_full(Observer* observer, int64_t begin, int64_t end) noexcept nogil:
    """Whether the line pressure's mean over samples [begin, end) is the rail pressure's: the line feeds nothing."""
    by_gain = observer.memory.in_force.sensor[SENSOR_GAIN] * observer.ring[(end - 1) & MASK].rail_pressure
    drop = _mean_drop(observer, begin, end) + observer.memory.pair.offset + by_gain
    return abs(drop) * observer.constants.pressure_scale < CALM


cdef void _shut_at_rest(Observer* observer, int64_t begin) noexcept nogil:
    """The needle was shut from `begin` on: what the lift showed before is forgotten.

    If nothing but time told so, an event must pass before anything is valid.
    """
    memory = observer.memory
    under_way, stop = &memory.event, &memory.stop
    if not memory.monitor.contradicted:
        memory.judgement.halted_in = under_way.number + 1
    shut_needle(observer, observer.ring[begin & MASK].index)
    under_way.learnable = False
    under_way.fault = REASON_LIFT_ZERO
    _forget_crosstalk(observer)
    stop.lift = 0.0
    stop.openings = 0


cdef double _mean_drop(Observer* observer, int64_t start, int64_t end) noexcept nogil:
    """Mean of rail less line pressure over samples [start, end)."""
    total = 0.0
    for k in range(start, end):
        total += observer.ring[k & MASK].rail_pressure - observer.ring[k & MASK].line_pressure
    return total / (end - start)


cdef double _square_drop(Observer* observer, int64_t start, int64_t end, double about) noexcept nogil:
    """Mean square of the same about a value."""
    total = 0.0
    for k in range(start, end):
        drop = observer.ring[k & MASK].rail_pressure - observer.ring[k & MASK].line_pressure - about
        total += drop * drop
    return total / (end - start)
