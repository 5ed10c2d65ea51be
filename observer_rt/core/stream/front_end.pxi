# Front end from the lift, measured or by commands, to the seat area: dead band with hysteresis, look-back to
# the foot of the ramp.
#
# A lift recorded too low (`lift_offset` > 0) does not show the lowest part of a ramp, its toe: there the ramp is
# extended to where the needle leaves or meets its seat. Where samples are means over their interval, the first and the
# last one of a ramp are extended likewise, because they contain only a part of it.

cpdef enum:
    LOOK_BACK = 3  # samples before the crossing of the dead band whose raw lift counts
    CONFIRM = 2  # consecutive samples that shut the needle
    FEWEST_OPENING = 2

cdef double DEAD_BAND_SIGMAS = 5.0
cdef double DEAD_BAND_FLOOR = 2.0e-6  # m
cdef double FOOT = 0.3  # of the dead band, above which these samples are the foot of a ramp


cdef double commanded_lift(Observer* observer, int64_t position) noexcept nogil:
    """Lift [m] at a sample of a needle whose lift is not recorded, by the commands up to it and what was learned."""
    cdef NeedleStroke s
    cdef double interval = observer.constants.interval, window = max(CORNER_ROUNDING, 2.0 * interval), lift = 0.0
    cdef double pressure
    cdef int64_t number, since
    c, commands, in_force = &observer.constants, &observer.memory.commands, &observer.memory.in_force
    commands.answered = max(commands.answered, commands.count - COMMANDS)
    for number in range(commands.answered, commands.count):
        since = <int32_t> (observer.ring[position & MASK].index - commands.starts[number % COMMANDS])
        if since < 0:
            continue
        pressure = observer.ring[(position - min(since, MASK)) & MASK].rail_pressure * c.pressure_scale
        pressure = max((pressure + c.chamber_pressure) / 1e8, 0.1)
        if answers(0.0, commands.lengths[number % COMMANDS] * interval, pressure, &c.needle, in_force.needle, &s):
            lift = max(lift, rounded_lift(since * interval, window, &s))
            if since * interval >= s.closed and s.bounce > DEAD_BAND_FLOOR:
                commands.landed = max(commands.landed, position + <int64_t> (s.landed / interval) - since)
        if number == commands.answered and since * interval > lands(&s) + window:
            commands.answered += 1
    return lift


cdef double opening_band(double lift_noise) noexcept nogil:
    """Lift [m] above which the needle is open, from the lift noise [m]; below half of it it is shut again."""
    return max(DEAD_BAND_FLOOR, DEAD_BAND_SIGMAS * lift_noise)


cdef int64_t lookahead_at(Observer* observer, int64_t position) noexcept nogil:
    """How many samples after `position` are received and follow it without a break, at most the look-ahead."""
    positions = &observer.memory.positions
    count = min(positions.received - 1 - position, observer.constants.timing.lookahead)
    if positions.newest_break <= position:
        return count
    for ahead in range(count):
        if observer.ring[(position + ahead + 1) & MASK].broken != 0:
            return ahead
    return count


cdef bint opens_at(Observer* observer, int64_t position) noexcept nogil:
    """Whether the needle counts as open from `position` on, as recorded, or because its ramp begins before."""
    foot = _foot_ahead(observer, position, 0)
    if foot <= 0:
        return foot == 0
    return _ramp_lift(observer, position, foot) > 0.0


cdef void open_from(Observer* observer, int64_t position) noexcept nogil:
    """Note the ramp of a needle that opens at `position`: where it is first recorded, at which lift and slope."""
    ramp = &observer.memory.ramp
    foot = max(_foot_ahead(observer, position, 0), 0)
    ramp.foot = position + foot
    ramp.rise = _rise(observer, position + foot, lookahead_at(observer, position) - foot)
    ramp.foot_lift = _lift_before_foot(observer, position + foot, ramp.rise)
    ramp.fall = 0.0


cdef int64_t _foot_ahead(Observer* observer, int64_t position, int64_t nearest) noexcept nogil:
    """Samples from `position` to the first recorded as open, from `nearest` to a toe beyond; -1: no such sample.

    The distance is one sample more if that sample is a mean over only a part of the ramp.
    """
    ahead = lookahead_at(observer, position)
    for distance in range(nearest, min(nearest + observer.constants.timing.toe, ahead) + 1):
        if _opens_within(observer, position + distance, min(ahead - distance, _reach(observer))):
            return distance + _is_partial(observer, position + distance)
    return -1


cdef int64_t _is_partial(Observer* observer, int64_t position) noexcept nogil:
    """1 where a ramp begins within the mean that `position`, recorded as open, is; else 0."""
    cdef bint is_first
    if not observer.constants.means:
        return 0
    is_first = position <= observer.memory.positions.segment_start
    return is_first or not _opens_within(observer, position - 1, _reach(observer))


cdef inline int64_t _reach(Observer* observer) noexcept nogil:
    """Samples that must be known beyond the first recorded as open (`samples_ahead` of engine.stream.state)."""
    return LOOK_BACK + observer.constants.timing.confirm - 1


cdef bint _opens_within(Observer* observer, int64_t position, int64_t samples) noexcept nogil:
    """Whether the lift is recorded as open at `position`: it crosses the dead band there or in the next `samples`.

    Up to LOOK_BACK samples before the crossing belong to the opening while they stand out of the noise.
    """
    threshold = observer.memory.dead_band.lift_on
    run = 0
    for ahead in range(samples + 1):
        lift = observer.ring[(position + ahead) & MASK].lift
        if lift > threshold:
            run += 1
            if run == observer.constants.timing.confirm:
                return True
        elif run > 0 or lift < FOOT * threshold:
            return False
    return False


cdef double _recorded_lift(Observer* observer, int64_t position) noexcept nogil:
    """True lift [m] of an open needle, from the recorded one."""
    inputs = &observer.constants.inputs
    return inputs.lift_factor * observer.ring[position & MASK].lift + inputs.lift_shift


cdef double _slope_of_means(Observer* observer, int64_t outermost, int64_t inwards, double slope) noexcept nogil:
    """Slope of the ramp whose outermost sample is `outermost`; the next one is `inwards` (1 or -1) of it."""
    factor = observer.constants.inputs.lift_factor
    partial = factor * observer.ring[outermost & MASK].lift
    full = factor * observer.ring[(outermost + inwards) & MASK].lift
    return slope_of_means(partial, full, slope, observer.memory.dead_band.lift_off)


cdef double _rise(Observer* observer, int64_t foot, int64_t ahead) noexcept nogil:
    """Slope [m a sample] of the ramp whose first recorded sample is at `foot`; its first interval may be cut."""
    length = min(observer.constants.timing.ramp, ahead)
    first = 1 if length > 1 else 0
    if length == 0:
        return 0.0
    rise = _recorded_lift(observer, foot + length) - _recorded_lift(observer, foot + first)
    rise = max(rise / (length - first), 0.0)
    if observer.constants.means:
        return _slope_of_means(observer, foot - 1, 1, rise)
    return rise


cdef double _lift_before_foot(Observer* observer, int64_t foot, double rise) noexcept nogil:
    """Lift [m] one sample before the first recorded one; at most the shift of the lift, or it would be recorded.

    Where samples are means, the sample before was recorded, and the limit does not apply.
    """
    if observer.constants.means:
        return _recorded_lift(observer, foot) - rise
    return min(_recorded_lift(observer, foot) - rise, observer.constants.inputs.lift_shift)


cdef double _ramp_lift(Observer* observer, int64_t position, int64_t foot) noexcept nogil:
    """Lift [m] at `position`, `foot` samples before the first recorded as open (0: the recorded one)."""
    if foot <= 0:
        return _recorded_lift(observer, position)
    rise = _rise(observer, position + foot, lookahead_at(observer, position) - foot)
    if rise == 0.0:
        return 0.0
    return _lift_before_foot(observer, position + foot, rise) - (foot - 1) * rise


cdef bint is_recorded_shut(Observer* observer, int64_t position) noexcept nogil:
    """Whether an open needle is recorded as shut from `position` on; never before its ramp has begun."""
    if position < max(observer.memory.ramp.foot, observer.memory.commands.landed):
        return False
    if observer.constants.means and _ends_within(observer, position):
        return _lift_before_end(observer, position) <= 0.0
    return _no_lift_from(observer, position)


cdef bint _no_lift_from(Observer* observer, int64_t position) noexcept nogil:
    """Whether the lift of an open needle is within the dead band from `position` on."""
    band = &observer.memory.dead_band
    # The end of a ramp without its toe is abrupt, so a lift below the dead band is noise.
    threshold = band.lift_on if observer.constants.timing.toe > 0 else band.lift_off
    ahead = lookahead_at(observer, position)
    for distance in range(min(ahead + 1, CONFIRM)):
        if observer.ring[(position + distance) & MASK].lift > threshold:
            return False
    return not _opens_within(observer, position, min(ahead, _reach(observer)))


cdef bint _ends_within(Observer* observer, int64_t position) noexcept nogil:
    """Whether a ramp ends within the mean at `position`, and samples before it show its slope."""
    return bool(
        position - 1 >= observer.memory.ramp.foot
        and lookahead_at(observer, position) > 0
        and not _no_lift_from(observer, position)
        and _no_lift_from(observer, position + 1)
    )


cdef double _lift_before_end(Observer* observer, int64_t position) noexcept nogil:
    """Lift [m] at `position` on the ramp that ends within it."""
    last, before = _recorded_lift(observer, position - 1), _recorded_lift(observer, position - 2)
    return last - _slope_of_means(observer, position, -1, before - last)


cdef bint keep_sinking(Observer* observer, int64_t position) noexcept nogil:
    """Move a needle recorded as shut down its ramp by a sample; whether it has still to sink to its seat."""
    ramp = &observer.memory.ramp
    if observer.constants.timing.toe == 0:
        return False
    if ramp.fall > 0.0:
        ramp.sinking_lift -= ramp.fall
    else:
        _begin_sinking(observer, position)
    if ramp.sinking_lift <= 0.0:
        ramp.fall = 0.0
    return ramp.fall != 0.0


cdef void _begin_sinking(Observer* observer, int64_t position) noexcept nogil:
    """Note slope and lift of a needle that is recorded as shut at `position`, by the ramp before."""
    ramp = &observer.memory.ramp
    beyond = 2 if observer.constants.means else 1
    last = position - beyond  # its interval may be cut, as at the foot of the opening
    length = min(observer.constants.timing.ramp, last - max(observer.memory.event.opening_position, ramp.foot))
    final = 1 if length > 1 else 0
    if length > 0:
        fall = _recorded_lift(observer, last - length) - _recorded_lift(observer, last - final)
        ramp.fall = max(fall / (length - final), 0.0)
    highest = max(_recorded_lift(observer, position), observer.constants.inputs.lift_shift)
    ramp.sinking_lift = min(_recorded_lift(observer, last) - beyond * ramp.fall, highest)


cdef double area_at(Observer* observer, int64_t position) noexcept nogil:
    """Normalised seat area of an open needle."""
    ramp = &observer.memory.ramp
    if position < ramp.foot:
        lift = ramp.foot_lift - (ramp.foot - 1 - position) * ramp.rise
    elif ramp.fall > 0.0:
        lift = ramp.sinking_lift
    elif observer.constants.means and _ends_within(observer, position):
        lift = _lift_before_end(observer, position)
    else:
        lift = _recorded_lift(observer, position)
    return normalised_area(lift, &observer.constants.seat)


cdef double shut_area(Observer* observer, int64_t position) noexcept nogil:
    """Normalised seat area of a closed needle: 0, or beside an opening the negative area its ramp comes from.

    The ramp of the two samples beyond is extrapolated, so that an area linear between samples reaches 0 where the
    needle leaves or meets its seat, and not at the sample before or after.
    """
    virtual = 0.0
    seat = &observer.constants.seat
    foot = _foot_ahead(observer, position, 1) if lookahead_at(observer, position) >= 2 else -1
    if foot > 0:
        first = _ramp_lift(observer, position + 1, foot - 1)
        if first > 0.0 or foot == 1:
            second = _ramp_lift(observer, position + 2, foot - 2)
            virtual = 2.0 * normalised_area(first, seat) - normalised_area(second, seat)
    elif position >= observer.memory.positions.segment_start + 2:
        last = observer.ring[(position - 1) & MASK].lift_area
        before = observer.ring[(position - 2) & MASK].lift_area
        if last > 0.0:
            virtual = 2.0 * last - before
    return min(virtual, 0.0)


cdef double area_between_lifts(Observer* observer, int64_t position) noexcept nogil:
    """Normalised seat area at the time of a sample, on the straight line between two areas where the lift was taken.

    The corners of the ramps stay where they were recorded. Interpolating the lift itself to the times of the samples
    would round them off.
    """
    row = &observer.ring[position & MASK]
    if row.lift_after == 0.0 or position == observer.memory.positions.segment_start:
        return row.lift_area
    before = &observer.ring[(position - 1) & MASK]
    since = 1.0 - before.lift_after
    return before.lift_area + (row.lift_area - before.lift_area) * since / (since + row.lift_after)
