# Recognises channel faults sample by sample: spikes, frozen and clipped stretches, dropouts.
#
# A value that must not be used is marked in `bridged` of its sample. For a line pressure x~ then goes on by the model,
# without correction, and what is learned leaves it out; a rail pressure or lift is replaced by its neighbours or held.

cpdef enum:
    REACH = 3  # samples of the longest spike
    FEWEST_REPEATS = 4  # that are a frozen value: so many samples wait for their look-ahead
    FEWEST_AFTER_LEAP = 2
    MOST_SAMPLES = RING  # more than ever may be bridged
    WELL_KNOWN = 1000  # samples from which on the share of equal neighbours is known
    STAYED = 6  # samples of a lift that may have been held before it leaps
    LET_GO = 4  # samples after which it has not come back: no spike
    ENOUGH_OPENINGS = 3  # that tell the stop

# Standard deviations from one sample to the next, by which a spike goes away and comes back. Noise alone does so once in
# six seconds at 100 kHz, which harms nothing; to be counted as a spike it must go further, as noise does once in days.
cdef double STEP = 5.5
cdef double CERTAIN = 1.4  # times the step
cdef double STRAIGHT = 4.0  # the same; more may an open lift's steps beside a spike not differ from the line across it
cdef double AWAY = 10.0  # the same; the least by which a spike leaves that line: a turning needle does not get so far
cdef double RESTLESS = 4.9  # the same, of a channel's mean change; white noise alone stays below
cdef double CHANGE_MEMORY = 64.0  # samples over which that mean is taken
cdef double CLOSE = 0.7  # of these: it comes back so near to where it was, and the channel was so steady before
cdef double UNLIKELY = log(1e-8)  # probability a sample of so many equal values by chance
cdef double UNLIKELY_AFTER_LEAP = log(1e-4)
cdef double COARSE = 0.2  # share of equal neighbours, from which on they are no noise: a needle on its seat, a held value
cdef double DROPOUT = 30.0  # standard deviations by which a value that then stays is a dropout
cdef double BACK = 0.5  # of the leap: less is left after a spike
cdef double WIDE = 0.5  # of the lift at the stop, above which the seat is so wide that a lift held there changes no flow
cdef double LEAP = 10.0  # of e~ from one sample to the next; a wrong model's grows over several


cdef inline int64_t inspect(Observer* observer, int64_t position) noexcept nogil:
    """Look for faults that a sample shows, also of the samples before it; returns the sample's `Doubt`."""
    cdef bint is_fast
    channels = observer.channels
    row = &observer.ring[position & MASK]
    doubt = DOUBT_NONE
    if not row.interpolated and row.broken == 0:
        if _is_odd(&channels[LINE], position, row.line_pressure, RESTLESS):
            doubt = _look(observer, position, LINE, row.line_pressure)
        if _is_odd(&channels[LIFT], position, row.needle_lift, 0.0):
            doubt = max(doubt, _look(observer, position, LIFT, row.needle_lift))
        # most values of a slower rail pressure are interpolated
        is_fast = observer.constants.rail_every <= 1.0
        if is_fast and _is_odd(&channels[RAIL], position, row.rail_pressure, RESTLESS):
            doubt = max(doubt, _look(observer, position, RAIL, row.rail_pressure))
    return doubt


cdef inline bint _is_odd(Channel* channel, int64_t position, double value, double restless) noexcept nogil:
    """Take in a value of a channel; whether it must be examined because it repeats, steps, or follows such a value.

    restless: multiple of the channel's mean change that is no step either, 0 for a lift.
    """
    last = channel.last
    channel.last = value
    if value == last:
        channel.run += 1
        return channel.run == 1 or channel.run >= channel.needed or position < channel.until
    if channel.run > 0:
        if channel.run < channel.needed:
            channel.repeats += channel.run
        channel.run = 0
    if value > channel.held:
        channel.went_above = True
    else:
        channel.went_below = True
    step = abs(value - last)
    limit = max(STEP * channel.noise, restless * channel.change)
    channel.change += ((step if step < limit else limit) - channel.change) / CHANGE_MEMORY  # NaN counts as the limit
    if step > limit:
        channel.until = max(channel.until, position + 2)
        return True
    return position < channel.until


cdef inline bint accepted(ObserverMemory* memory, int64_t longest, double innovation) noexcept nogil:
    """Whether an innovation of x~ [p_0] may correct it: not where it leaps, for `longest` samples at most."""
    cdef bint is_leap
    outliers = &memory.outliers
    leap = innovation - outliers.accepted_innovation
    is_leap = INFINITY > leap * leap * memory.innovation_noise.weight > LEAP * LEAP
    if is_leap and memory.synchronisation.synchronised and outliers.leaping < longest:
        outliers.leaping += 1
    else:
        outliers.accepted_innovation = innovation
        outliers.leaping = 0
    return outliers.leaping == 0


cdef int64_t _look(Observer* observer, int64_t position, int64_t number, double value) noexcept nogil:
    """Examine a channel whose value at a position is odd, bridge or mend what is wrong; returns its `Doubt`."""
    channel = &observer.channels[number]
    if channel.run > 0:
        _follow_run(observer, position, number, value)
    elif channel.bridged > 0:
        channel.bridged -= 1
    if channel.bridged > 0:
        channel.until = max(channel.until, position + 2)
    if number == LIFT and (_was_held(observer, value) or _was_let_go(observer, position)):
        return DOUBT_FROZEN
    if number == LIFT:
        _mend_open_lift(observer, position)
    else:
        _mend(observer, position, number)
    return _doubt(channel, number, observer.constants.timing.bridge)


cdef bint _was_held(Observer* observer, double value) noexcept nogil:
    """Whether a lift that moves again had moved while its value was held: a needle's motion cannot be bridged."""
    cdef bint has_moved
    memory = observer.memory
    channel = &observer.channels[LIFT]
    if channel.run > 0 or not channel.is_held:
        return False
    channel.is_held = False
    has_moved = abs(value - channel.held) > DROPOUT * channel.noise
    return has_moved and not channel.is_dropout and not _is_wide_open(memory, min(value, channel.held))


cdef bint _is_wide_open(ObserverMemory* memory, double lift) noexcept nogil:
    """Whether the seat is so wide open at a recorded lift [m] that it limits no flow."""
    return memory.stop.openings >= ENOUGH_OPENINGS and lift - memory.resting_lift.zero > WIDE * memory.stop.lift


cdef bint _was_let_go(Observer* observer, int64_t position) noexcept nogil:
    """Whether the lift leapt for good before a position, quicker than a needle, as one that noise was added to."""
    cdef bint is_repeated
    memory = observer.memory
    band = &memory.dead_band
    quickest = observer.constants.quickest + band.lift_on
    if abs(_lift_over(observer, position - 1, position)) > quickest:
        channel = &observer.channels[LIFT]
        channel.until = max(channel.until, position + LET_GO + 1)
    last = position - LET_GO - 1
    if not _follows(observer, position, LET_GO + 1 + STAYED):
        return False
    leap = _lift_over(observer, last, last + 1)
    if _lift(observer, last) < band.lift_on:
        quickest += OFF_SEAT
    if not abs(leap) > quickest or _is_wide_open(memory, _lowest(observer, last)):
        return False
    for k in range(1, STAYED):
        if not abs(_lift_over(observer, last, last - k)) < band.lift_on:
            return False
    for k in range(2, LET_GO + 2):
        is_repeated = _lift_over(observer, last + k - 1, last + k) == 0.0  # a dropout
        if is_repeated or not _lift_over(observer, last, last + k) / leap > BACK:
            return False
    return True


cdef inline double _lowest(Observer* observer, int64_t position) noexcept nogil:
    """The lower of the recorded lifts [m] at a position and the one after it."""
    ring = observer.ring
    return min(ring[position & MASK].needle_lift, ring[(position + 1) & MASK].needle_lift)


cdef inline double _lift_over(Observer* observer, int64_t begin, int64_t end) noexcept nogil:
    """Recorded lift [m] at a position over that at another one."""
    return observer.ring[end & MASK].needle_lift - observer.ring[begin & MASK].needle_lift


cdef inline double* _field(Sample* row, int64_t channel) noexcept nogil:
    """Where a sample has the value of a channel."""
    if channel == RAIL:
        return &row.rail_pressure
    return &row.needle_lift if channel == LIFT else &row.line_pressure


cdef inline double _value(Observer* observer, int64_t position, int64_t channel) noexcept nogil:
    """Value that a channel has at a position."""
    return _field(&observer.ring[position & MASK], channel)[0]


cdef void _replace(Sample* row, int64_t channel, double value) noexcept nogil:
    """Put another value in the place of a channel's."""
    if channel == LIFT:
        row.lift += value - row.needle_lift
    _field(row, channel)[0] = value


cdef void _follow_run(Observer* observer, int64_t position, int64_t number, double value) noexcept nogil:
    """Bridge a channel that repeats the value of the sample before, once so many repeats are no chance."""
    cdef bint longest, is_again
    channel = &observer.channels[number]
    longest = observer.constants.timing.bridge
    if channel.run == 1:
        _note_run(observer, position, number, value)
    if channel.run < channel.needed or channel.needed > longest:
        return
    if channel.run == channel.needed:
        is_again = value == channel.held
        channel.is_clipped = is_again and not channel.is_dropout and not (channel.went_above and channel.went_below)
        if not is_again:
            channel.went_above = channel.went_below = False
        channel.held = value
        channel.is_held = True
        # those before may have been used by now: how many depends on what a frame carries
        repeats = channel.needed - (0 if channel.is_dropout else 1)
        for k in range(min(repeats, observer.constants.timing.lookahead)):
            _bridge(observer, position - 1 - k, number)
    _bridge(observer, position, number)
    channel.bridged = min(channel.bridged, 2 * longest + 1)


cdef void _note_run(Observer* observer, int64_t position, int64_t number, double value) noexcept nogil:
    """Note of the second of two equal values how many must follow to be no chance, and the value before both."""
    channel = &observer.channels[number]
    channel.needed = MOST_SAMPLES
    if position <= observer.memory.positions.segment_start + 1 or not isfinite(value):
        return
    channel.instead = _value(observer, position - 2, number)
    channel.is_dropout = abs(value - channel.instead) > DROPOUT * channel.noise
    channel.needed = repeats_needed(channel.repeats, position, channel.is_dropout)


cdef int64_t repeats_needed(int64_t repeats, int64_t samples, bint is_dropout) noexcept nogil:
    """How many equal neighbours in a row are no chance, by the repeats among all samples; fewer after a leap."""
    if samples < WELL_KNOWN:
        return MOST_SAMPLES
    chance = (repeats + 1.0) / (samples + 1.0)
    if chance > COARSE:
        return MOST_SAMPLES
    if is_dropout:
        return max(FEWEST_AFTER_LEAP, <int64_t> ceil(UNLIKELY_AFTER_LEAP / log(chance)))
    return max(FEWEST_REPEATS, <int64_t> ceil(UNLIKELY / log(chance)))


cdef int64_t _doubt(Channel* channel, int64_t number, int64_t longest) noexcept nogil:
    """The `Doubt` of a channel that is bridged, for longer than may be; a clipped input is wrong from the start."""
    if channel.is_clipped and number != LINE:
        longest = 0
    if channel.bridged <= longest:
        return DOUBT_NONE
    return DOUBT_CLIPPED if channel.is_clipped else DOUBT_FROZEN


cdef void _bridge(Observer* observer, int64_t position, int64_t number) noexcept nogil:
    """Mark a value as not to be used; an input keeps the value from before a dropout."""
    channel = &observer.channels[number]
    row = &observer.ring[position & MASK]
    row.bridged |= 1 << number
    channel.bridged += 1
    observer.memory.outliers.bridged += 1
    if channel.is_dropout and number != LINE:
        _replace(row, number, channel.instead)


cdef void _mend(Observer* observer, int64_t position, int64_t number) noexcept nogil:
    """Put a straight line in the place of the few values before a position that leapt away from it and came back."""
    cdef bint is_spike
    if not observer.constants.timing.filtered or not _follows(observer, position, 2 * REACH + 1):
        return
    limit = max(STEP * observer.channels[number].noise, RESTLESS * observer.channels[number].change)
    here = _value(observer, position, number)
    back = abs(here - _value(observer, position - 1, number))
    if back <= limit or not isfinite(back):
        return
    for width in range(1, REACH + 1):
        last = position - width - 1
        before = _value(observer, last, number)
        away, rise = abs(_value(observer, last + 1, number) - before), here - before
        close = CLOSE * min(away, back)
        slope = 0.5 * (before - _value(observer, last - 2, number))
        is_spike = away > limit and _is_steady(observer, last, number, close)
        if is_spike and min(abs(rise), abs(rise - (width + 1) * slope)) < close:
            for k in range(1, width + 1):
                row = &observer.ring[(last + k) & MASK]
                _replace(row, number, before + rise * k / (width + 1))
                row.bridged |= 1 << number
            if min(away, back) > CERTAIN * limit:
                observer.memory.outliers.spikes += width
            return


cdef void _mend_open_lift(Observer* observer, int64_t position) noexcept nogil:
    """Put the straight line that an open needle moves on in the place of the few values that leapt away from it.

    A needle stops as suddenly as a spike begins, and turns round; but it does not go on where it would have been, nor
    leap there and back.
    """
    cdef bint is_straight, is_leap
    if not observer.constants.timing.filtered or not _follows(observer, position, REACH + 4):
        return
    memory, noise = observer.memory, observer.channels[LIFT].noise
    after, beyond = _lift(observer, position - 1), _lift(observer, position)
    back = abs(after - _lift(observer, position - 2))
    quickest, close = observer.constants.quickest + memory.dead_band.lift_on, STRAIGHT * noise
    for width in range(1, REACH + 1):
        first = position - 1 - width
        before = _lift(observer, first - 1)
        if min(before, after) < memory.dead_band.lift_on:
            continue
        slope = (after - before) / (width + 1)
        is_straight = abs(before - _lift(observer, first - 2) - slope) < close and abs(beyond - after - slope) < close
        is_leap = abs(_lift(observer, first) - before) > quickest and back > quickest
        if (is_straight or is_leap) and _least_away(observer, first, width, before, slope) > AWAY * noise:
            for k in range(width):
                row = &observer.ring[(first + k) & MASK]
                _replace(row, LIFT, before + slope * (k + 1) + memory.resting_lift.zero)
                row.bridged |= 1 << LIFT
            memory.outliers.spikes += width
            return


cdef double _least_away(Observer* observer, int64_t first, int64_t width, double before, double slope) noexcept nogil:
    """The least distance [m] by which so many lifts from `first` on all lie above a line, or all below it."""
    least, most = INFINITY, -INFINITY
    for k in range(width):
        away = _lift(observer, first + k) - before - slope * (k + 1)
        least, most = min(least, away), max(most, away)
    return max(least, -most)


cdef double _lift(Observer* observer, int64_t position) noexcept nogil:
    """The recorded lift without its zero [m]."""
    return observer.ring[position & MASK].needle_lift - observer.memory.resting_lift.zero


cdef bint _follows(Observer* observer, int64_t position, int64_t samples) noexcept nogil:
    """Whether so many samples, `position` the last of them, follow each other without a break."""
    if position < samples:
        return False
    for k in range(samples):
        if observer.ring[(position - k) & MASK].broken != BREAK_NONE:
            return False
    return True


cdef bint _is_steady(Observer* observer, int64_t position, int64_t number, double close) noexcept nogil:
    """Whether a channel changed by less than a limit at a position and at the one before it: else it rings."""
    before = _value(observer, position - 1, number)
    return not (
        abs(_value(observer, position, number) - before) >= close
        or abs(before - _value(observer, position - 2, number)) >= close
    )
