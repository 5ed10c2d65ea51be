# False openings: the lift leaps as no needle can, or its zero has stepped. The next samples of the lift tell it, or
# later the line pressure, which shows that the needle is shut.

cdef int64_t EDGE = 3  # samples in which a lift steps
cdef double CALM = 0.7e6  # Pa, rms of a line pressure in which no injection rings
cdef double AS_CALM = 1.5  # times the mean square before: a calm line rings no more than that
cdef int64_t LEAPS = 3  # within the look-ahead, quicker than a needle moves: so many are noise (a spike has two)
cdef double SLOWEST_OPENING = 0.3  # m/s
cdef double LOWEST = 15e-6  # m, below which an opening needle does not stop
cdef double STEPPED = 30e-6  # m, below which an opening that stops is probably a step of the sensor's zero
cdef double OFF_SEAT = 40e-6  # m, that a lift may leap at its seat, because the sensor's offset is not that of the seat


cdef bint stays_low(Observer* observer, int64_t position, double highest) noexcept nogil:
    """Whether the lift of a needle long at rest crosses the dead band after `position`, but rises no further.

    Then the sensor's zero has stepped, because no needle stops just off its seat. highest [m]: lifts above it are not
    examined. To be called at an opening only: the search is slow.
    """
    memory, ring = observer.memory, observer.ring
    band, timing = &memory.dead_band, &observer.constants.timing
    if ring[position & MASK].index - memory.needle.shut_index <= timing.bounce:
        return False
    ahead, first = lookahead_at(observer, position), 0
    while first < ahead and not ring[(position + first) & MASK].lift > band.lift_on:
        first += 1
    last = min(first + timing.confirm - 1, ahead)
    half = (last - first + 1) // 2
    if half == 0:
        return False
    earlier, later = 0.0, 0.0
    for k in range(half):
        earlier += ring[(position + first + k) & MASK].lift / half
        later += ring[(position + last - k) & MASK].lift / half
    slowest = 0.5 * SLOWEST_OPENING * observer.constants.interval * half
    return later - earlier < min(band.lift_on, slowest) and 0.5 * (earlier + later) < highest


cdef bint leaps_about(Observer* observer, int64_t position) noexcept nogil:
    """Whether the lift from `position` on leaps as no needle can: noise in a wrong unit, a loose connection."""
    memory, ring = observer.memory, observer.ring
    quickest = observer.constants.quickest + memory.dead_band.lift_on + OFF_SEAT
    cdef int64_t leaps = 0
    for k in range(position, position + lookahead_at(observer, position) + 1):
        leaps += abs(ring[k & MASK].lift - ring[(k - 1) & MASK].lift) > quickest
    return leaps >= LEAPS


cdef inline void look_for_false_opening(Observer* observer, int64_t position) noexcept nogil:
    """Look whether the zero of the lift has stepped in place of a motion, at the samples that can tell."""
    needle, timing = &observer.memory.needle, &observer.constants.timing
    if position == observer.memory.positions.segment_start + timing.good:
        _look_at_start(observer, position)
    if needle.is_open and position == needle.opening_position + timing.good:
        _look_at_opening(observer, position)
    if (position - needle.opening_position) % timing.settle == 0:
        _look_at_rest(observer, position)


cdef void _look_at_start(Observer* observer, int64_t position) noexcept nogil:
    """A moment after the first sample, take a needle beside a line at rest for shut, whatever lift it shows."""
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
        observer.ring[position & MASK].lift_area = observer.ring[position & MASK].seat_area = 0.0
    shut_needle(observer, observer.ring[start & MASK].index - observer.constants.timing.settle)


cdef void _look_at_opening(Observer* observer, int64_t position) noexcept nogil:
    """A while after an opening, take a low lift that stepped and stays, beside a line still calm, for the zero.

    A connection has moved, or a drift has gone: had the needle opened, the line pressure would have fallen.
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
    row.lift_area = row.seat_area = 0.0
    shut_needle(observer, row.index)


cdef void _look_at_rest(Observer* observer, int64_t position) noexcept nogil:
    """Now and then, take a low lift that has stayed for the zero of a shut needle, if the line feeds nothing.

    The zero stepped while the needle was open, or while no samples came. Beside a needle that sticks off its seat the
    line pressure is as the model says. Where nothing is valid, the time for which the lift has stayed decides. A lift
    below its zero is never a motion.
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
    """Whether the means of line and rail pressure over samples [begin, end) are the same: the line feeds nothing."""
    by_gain = observer.memory.in_force.sensor[SENSOR_GAIN] * observer.ring[(end - 1) & MASK].rail_pressure
    drop = _mean_drop(observer, begin, end) + observer.memory.pair.offset + by_gain
    return abs(drop) * observer.constants.pressure_scale < CALM


cdef void _shut_at_rest(Observer* observer, int64_t begin) noexcept nogil:
    """Shut the needle from `begin` on, and forget what the lift showed before.

    If nothing but time has decided so, an event must pass before anything is valid.
    """
    memory = observer.memory
    under_way, stop = &memory.event, &memory.stop
    if not memory.monitor.contradicted:
        memory.judgement.halted_in = under_way.number + 1
    shut_needle(observer, observer.ring[begin & MASK].index)
    under_way.learnable = False
    under_way.fault = REASON_LIFT_ZERO
    _forget_crosstalk(observer)
    stop.lift, stop.openings = 0.0, 0


cdef double _mean_drop(Observer* observer, int64_t start, int64_t end) noexcept nogil:
    """Mean of rail less line pressure over samples [start, end)."""
    total = 0.0
    for k in range(start, end):
        total += observer.ring[k & MASK].rail_pressure - observer.ring[k & MASK].line_pressure
    return total / (end - start)


cdef double _square_drop(Observer* observer, int64_t start, int64_t end, double about) noexcept nogil:
    """Mean square of rail less line pressure about a value, over samples [start, end)."""
    total = 0.0
    for k in range(start, end):
        drop = observer.ring[k & MASK].rail_pressure - observer.ring[k & MASK].line_pressure - about
        total += drop * drop
    return total / (end - start)
