# Applies the verdict on an event to the samples after it.

cdef double SLOW_PEAK = 5.0  # times its own mean square: with the watch's limit, five standard deviations


cdef bint judge_event(Observer* observer) noexcept nogil:
    """Judge the oldest closed event by the verdict posted on it; False, with nothing done, where there is none."""
    memory = observer.memory
    number = memory.judgement.events_taken
    verdict = &observer.verdicts[number % SLOTS]
    event = &observer.events[number % PENDING_EVENTS]
    if verdict.learned.number == number + 1:
        event.taken = TAKEN_LEARNED
        _put_learned_into_force(observer, number % SLOTS, verdict.learned.is_coloured)
        _note(observer, event, &verdict.learned)
    elif verdict.examined.number == number + 1:
        event.taken = TAKEN_EXAMINED
        if verdict.earlier == number + 1:
            _put_learned_into_force(observer, SLOTS + number % SLOTS, verdict.examined.is_coloured)
        _note(observer, event, &verdict.examined)
    else:
        return False
    _count(observer)
    look_at_learned_range(observer, memory.positions.processed, memory.needle.is_open)
    return True


cdef double RAIL_BIN = 0.08  # p_0
# Standard deviation up to which a rate is known, as a share: of itself, of the mean since the opening, or of half the full
# one, for a rate that begins need not be known to 1 % of itself.
cdef double SHARP = 0.01, LEAST_SHARE = 0.5
cdef double SEEN_AFTER = 0.3e-3  # s of flow, after which the line pressure shows that of a needle without a recorded lift


cdef void look_at_learned_range(Observer* observer, int64_t position, bint flows) noexcept nogil:
    """Look up for how long the flow is known at the rail pressure of a sample, and begin its sums anew."""
    cdef int64_t place = <int64_t> (observer.ring[position & MASK].rail_pressure / RAIL_BIN)
    point = &observer.memory.operating_point
    place = min(max(place, <int64_t> 0), <int64_t> RAIL_BINS - 1)
    point.known_from = observer.memory.in_force.known_from[place]
    point.known_until = observer.memory.in_force.known_until[place]
    point.in_learned_range = not flows or point.known_until > 0.0
    point.widest, point.up_until = 0.0, 0.0
    point.flow, point.flowing = 0.0, 0


cdef void follow_flow(Observer* observer, int64_t position) noexcept nogil:
    """Add up the flow, and note whether it leaves the learned range; a needle that falls shows nothing new."""
    memory = observer.memory
    point, row = &memory.operating_point, &observer.ring[position & MASK]
    if memory.needle.is_open:
        if row.opened_since > point.known_until and row.seat_area >= observer.ring[(position - 1) & MASK].seat_area:
            point.in_learned_range = False
        point.widest = max(point.widest, row.seat_area)
        if not falls(point, row):
            point.up_until = row.opened_since
        point.flow += row.injection_rate
        point.flowing += 1


cdef bint is_flow_known(const Observer* observer, int64_t position) noexcept nogil:
    """Whether the flow, if there is any, is known well enough at a sample: sharply by the bank that follows it.

    Where none follows, or nothing flows, events must have shown it; as they must for a needle of an injector as
    believed that falls, at whose flank the rate is as uncertain as the times of samples. There a flow that was often
    another one than believed is not known.
    """
    cdef bint shown
    point, row = &observer.memory.operating_point, &observer.ring[position & MASK]
    shown = is_shown(point, row)
    if not row.rate_sigma > 0.0:  # NaN is not, either
        return shown
    if shown and row.as_believed > BELIEVED and falls(point, row):
        return observer.memory.in_force.flow_spread < SHARP
    rate = max(point.flow / max(point.flowing, <int64_t> 1), row.injection_rate)
    return row.rate_sigma <= SHARP * max(rate, LEAST_SHARE * point.full_rate)


cdef bint is_seen(const Observer* observer, int64_t position) noexcept nogil:
    """Whether the line pressure has shown the flow of a needle without a recorded lift, which is open, and stays so."""
    point, row = &observer.memory.operating_point, &observer.ring[position & MASK]
    if not observer.memory.needle.is_open or isnan(row.rate_sigma) or falls(point, row):
        return False
    return point.flowing * observer.constants.interval > SEEN_AFTER


cdef bint give_up_event(Observer* observer) noexcept nogil:
    """Give up the oldest closed event, which is due; False, with nothing done, if a verdict may still come.

    An event that only the next window of the source showed to be over, long due, has until two more have closed.
    """
    memory = observer.memory
    judgement = &memory.judgement
    event = &observer.events[judgement.events_taken % PENDING_EVENTS]
    if event.closed_index > event.due_index and memory.counts.events_closed - judgement.events_taken <= 2:
        return False
    event.taken = TAKEN_NOTHING
    _note_reason(observer, event, REASON_NOT_JUDGED)
    _count(observer)
    return True


cdef void _count(Observer* observer) noexcept nogil:
    """Count an event as taken."""
    judgement = &observer.memory.judgement
    judgement.waiting = False
    judgement.events_judged += 1
    judgement.events_taken += 1


cdef void _note(Observer* observer, Event* event, Finding* finding) noexcept nogil:
    """Apply what was found of an event."""
    observer.memory.judgement.offset_moves = not finding.is_coloured
    _note_reason(observer, event, finding.reason)
    if not isnan(finding.at_rest):
        expect(observer, finding.at_rest)


cdef void _note_reason(Observer* observer, Event* event, int64_t reason) noexcept nogil:
    """Apply the reason for which an event did not pass, 0 if it did.

    An event of faulty samples, or without a test, makes nothing valid; a second one in a row without a test, though
    its samples were good, ends what was known. A contradiction is over with an event that passed, or with the event
    it came in, if that was of faulty samples.
    """
    cdef bint is_faulty, is_untested, is_passed, is_explained
    judgement, monitor = &observer.memory.judgement, &observer.memory.monitor
    is_faulty = event.fault != REASON_NONE
    is_untested = reason == REASON_NOT_JUDGED
    if is_faulty or is_untested:
        judgement.doubtful_events += 1
    if not is_untested:
        judgement.untested = 0
        judgement.reason = reason
    elif not is_faulty:
        judgement.untested += 1
        if judgement.untested > 1:
            judgement.reason = reason
    is_passed = reason == REASON_NONE and event.number >= monitor.contradicted_in
    is_explained = is_faulty and event.number == monitor.contradicted_in
    if is_passed or is_explained:
        monitor.contradicted = False
    if reason == REASON_NONE and event.number >= judgement.halted_in:
        judgement.halted_in = 0


cdef void _put_learned_into_force(Observer* observer, int64_t slot, bint is_coloured) noexcept nogil:
    """Put what was learned into force, but for the offset in use where it is near, which the standstill may have moved.

    Under coloured noise the standstill moves none.
    """
    cdef bint is_near
    memory = observer.memory
    pair = &memory.pair
    verdict = &observer.verdicts[slot]
    memory.innovation_noise.sigma = verdict.innovation_sigma
    expect(observer, 0.0)
    offset = pair.offset
    carry_on(observer, slot)
    furthest = FURTHEST_OFFSET / observer.constants.pressure_scale
    is_near = abs(offset - memory.in_force.learned_offset) < furthest
    if is_near and not is_coloured:
        pair.offset = offset
    if verdict.is_adopted:
        memory.judgement.phi_version += 1


cdef void carry_on(Observer* observer, int64_t slot) noexcept nogil:
    """Carry the theta, gains and noise of a slot from here on."""
    memory = observer.memory
    verdict = &observer.verdicts[slot]
    copy_numbers(observer.verdict_theta + slot * observer.parameters, observer.theta, observer.parameters)
    memory.in_force = verdict.carried
    memory.pair.offset = memory.in_force.learned_offset
    for channel in range(3):
        observer.channels[channel].noise = verdict.noise[channel]
    size = observer.gain_rows * observer.states
    copy_numbers(observer.verdict_gains + slot * size, observer.gains, size)


cdef void expect(Observer* observer, double at_rest) noexcept nogil:
    """Set the mean square that is expected of innovations; at_rest: that of coloured ones, needle shut [p_0^2].

    Slow noise does not average out in the watch's mean of squares: it may be SLOW_PEAK times its own mean.
    """
    memory = observer.memory
    noise = &memory.innovation_noise
    white = noise.sigma**2 * memory.prior.healthy_variance
    noise.weight = 1.0 / (white + SLOW_PEAK * max(at_rest - white, 0.0))
