# The step of the observer: all operations for one sample of the stream, in their order.

cdef enum:
    _RESTLESS = MAX_EVENT + RING // 8  # samples without standstill; a needle open beyond MAX_EVENT is stuck


cdef void take_recorded(Observer* observer, int64_t end, int64_t doubt) noexcept nogil:
    """Take the recorded samples up to the number `end`; doubt: why they cannot be trusted (Doubt)."""
    positions = &observer.memory.positions
    ahead = observer.constants.undoing.ahead
    while positions.recorded < end:
        number = positions.recorded
        sample = &observer.recorded[number & RECORDED_MASK]
        if sample.broken != BREAK_NONE:
            _release(observer, number)  # nothing follows what waits
            positions.unbroken_since = number
        sample.doubt = doubt
        positions.recorded += 1
        if doubt != DOUBT_NONE:
            for earlier in range(positions.released, number):
                observer.recorded[earlier & RECORDED_MASK].doubt = doubt
        _release(observer, positions.recorded - ahead)


cdef void _release(Observer* observer, int64_t end) noexcept nogil:
    """Append the recorded samples up to the number `end`, corrected for stated delays and lags."""
    cdef bint is_stated
    positions = &observer.memory.positions
    is_stated = observer.constants.undoing.stated
    while positions.released < end:
        number = positions.released
        sample = &observer.recorded[number & RECORDED_MASK]
        rail_pressure = true_rail_pressure(observer, number) if is_stated else sample.values[RAIL]
        lift = true_lift(observer, number) if is_stated else sample.values[LIFT]
        _append(observer, sample, rail_pressure, lift)
        positions.released += 1


cdef inline void _append(
    Observer* observer, Recorded* sample, double rail_pressure, double needle_lift
) noexcept nogil:
    """Normalise a sample and append it to the ring."""
    c = &observer.constants
    inputs = &observer.constants.inputs
    positions = &observer.memory.positions
    row = &observer.ring[positions.received & MASK]
    row.index = sample.index
    at_rail = inputs.rail_factor * rail_pressure + inputs.rail_shift
    row.rail_pressure = (at_rail - c.chamber_pressure) / c.pressure_scale
    row.needle_lift = needle_lift
    row.line_pressure = (sample.values[LINE] - c.chamber_pressure) / c.pressure_scale
    row.lift_after, row.rail_share = sample.shares[LIFT], sample.shares[RAIL]
    row.interpolated, row.broken = sample.interpolated, sample.broken
    row.bridged, row.doubt = 0, sample.doubt
    if sample.doubt != DOUBT_NONE:  # it may have begun with samples that still wait for their look-ahead
        first = max(positions.processed, positions.received - observer.constants.timing.lookahead)
        for position in range(first, positions.received):
            observer.ring[position & MASK].doubt = sample.doubt
    if sample.broken != BREAK_NONE:
        positions.newest_break = positions.received
    positions.received += 1
    if sample.interpolated:
        positions.interpolated += 1


cdef bint advance_stream(Observer* observer) noexcept nogil:
    """Process every sample whose look-ahead is complete; True if an event must be judged first (`waiting`)."""
    positions, mode = &observer.memory.positions, &observer.memory.mode
    if mode.draining:
        _release(observer, positions.recorded)
    while positions.processed < positions.received:
        position = positions.processed
        if (
            not mode.draining
            and lookahead_at(observer, position) < observer.constants.timing.lookahead
            and not _cut_short(observer, position)
        ):
            break
        _inspect_ahead(observer, position)
        if not _process(observer, position):
            return True
        positions.processed += 1
    if mode.draining:
        _finish(observer)
    return observer.memory.judgement.waiting


cdef inline void _inspect_ahead(Observer* observer, int64_t position) noexcept nogil:
    """Look for outliers among the samples that must be known at `position`.

    Samples beyond are not inspected yet, because the result depends on the judgements before, and how many samples
    have come by then depends on how many a frame carries.
    """
    positions = &observer.memory.positions
    for k in range(positions.inspected, position + lookahead_at(observer, position) + 1):
        row = &observer.ring[k & MASK]
        if observer.constants.needle.stop > 0.0:
            row.needle_lift = commanded_lift(observer, k)
        outlier = inspect(observer, k)
        if row.doubt == DOUBT_NONE:
            row.doubt = outlier
        positions.inspected = k + 1


cdef bint _cut_short(Observer* observer, int64_t position) noexcept nogil:
    """Whether the look-ahead at `position` can no longer grow, because a break of the stream ends it."""
    following = position + lookahead_at(observer, position) + 1
    return following < observer.memory.positions.received


cdef void _finish(Observer* observer) noexcept nogil:
    """The stream has ended: close the event under way, and have every closed event judged."""
    memory = observer.memory
    judgement, counts = &memory.judgement, &memory.counts
    break_event(observer, memory.positions.processed - 1)
    make_all_due(observer)
    while judgement.events_taken < counts.events_closed and judge_event(observer):
        pass
    judgement.waiting = judgement.events_taken < counts.events_closed


cdef bint _process(Observer* observer, int64_t position) noexcept nogil:
    """Process one sample; False if an event must be judged first, and the sample comes again: it is not marked yet."""
    cdef bint opens
    needle, row = &observer.memory.needle, &observer.ring[position & MASK]
    if row.broken != BREAK_NONE:
        _end_segment(observer, position)
    take_out_zero(observer, position)
    opens = not needle.is_open and opens_at(observer, position) and not stays_low(observer, position, LOWEST)
    if not (opens or _judge_due_events(observer, row.index)):
        return False
    if row.broken != BREAK_NONE:
        _begin_segment(observer, position)
    _move_needle(observer, position, opens)
    look_for_false_opening(observer, position)
    row.resting = not needle.is_open and row.index - needle.shut_index > observer.constants.timing.settle
    if row.broken != BREAK_NONE:
        start_pair(observer, position)
    elif not step_pair(observer, position):
        _recover(observer, position)
    _settle(observer, position)
    _mark(observer, position)
    gather(observer, position)
    follow_lift(observer, position)
    follow_injection(observer, position)
    return True


cdef inline bint _judge_due_events(Observer* observer, int64_t index) noexcept nogil:
    """Judge the events due before the sample `index`, or give them up; False if a verdict must be waited for."""
    memory = observer.memory
    judgement = &memory.judgement
    while judgement.events_taken < memory.counts.events_closed and judgement_due(observer, index):
        if judge_event(observer):
            continue
        if memory.mode.waits_for_verdicts:
            judgement.waiting = True
            return False
        if not give_up_event(observer):
            break
    return True


cdef void _end_segment(Observer* observer, int64_t position) noexcept nogil:
    """Finish the event under way where the stream broke before `position`; harmless when done twice."""
    row = &observer.ring[position & MASK]
    if position > 0 and observer.memory.event.in_event:
        break_event(observer, position - 1)
        note_closed_late(observer, row.index)
    if row.broken == BREAK_RESTART:
        make_all_due(observer)


cdef void _begin_segment(Observer* observer, int64_t position) noexcept nogil:
    """Begin a stretch of samples that follow each other; nothing is valid before x~ has settled."""
    memory = observer.memory
    synchronisation = &memory.synchronisation
    row = &observer.ring[position & MASK]
    if row.broken != BREAK_JUMP:
        # the needle may have moved meanwhile: nothing is known of the sac
        shut_needle(observer, row.index)
    if row.broken == BREAK_RESTART:
        memory.commands.answered = memory.commands.count  # their indices are of another count
    memory.positions.segment_start = position
    synchronisation.rested = position
    synchronisation.synchronised, synchronisation.unsynchronised_by = False, row.broken


cdef void _move_needle(Observer* observer, int64_t position, bint opens) noexcept nogil:
    """Open or shut the needle by its dead band, and work out the seat area, negative just beside an opening."""
    memory = observer.memory
    under_way, needle = &memory.event, &memory.needle
    row = &observer.ring[position & MASK]
    if opens:
        part_events(observer, position)
        open_from(observer, position)
        look_at_learned_range(observer, position, True)
        begin_injection(observer, position)
        if leaps_about(observer, position):
            contradict(observer, under_way.number)
        if stays_low(observer, position, STEPPED):
            memory.judgement.halted_in = under_way.number
    elif needle.is_open:
        if not is_recorded_shut(observer, position):
            memory.ramp.fall = 0.0
            if lingers(observer, position):
                come_to_rest(observer, position)
        elif not keep_sinking(observer, position):
            shut_needle(observer, row.index)
    row.lift_area = area_at(observer, position) if needle.is_open else shut_area(observer, position)
    row.seat_area = area_between_lifts(observer, position)


cdef void _recover(Observer* observer, int64_t position) noexcept nogil:
    """Start the pair anew where a state is not finite; it is valid again only after a standstill."""
    synchronisation = &observer.memory.synchronisation
    synchronisation.numerical_resets += 1
    synchronisation.synchronised, synchronisation.unsynchronised_by = False, REASON_NUMERICAL
    observer.memory.event.learnable = False
    start_pair(observer, position)


cdef void _settle(Observer* observer, int64_t position) noexcept nogil:
    """Note whether the pair has settled: once x~ is good and the sac at rest, until a break, or a stuck needle."""
    cdef bint is_stuck
    memory = observer.memory
    needle, synchronisation = &memory.needle, &memory.synchronisation
    if not needle.is_open:
        synchronisation.closed_since_start += 1
    if observer.ring[position & MASK].resting:
        synchronisation.rested = position
        if synchronisation.closed_since_start >= observer.constants.timing.good:
            synchronisation.synchronised, synchronisation.unsynchronised_by = True, REASON_NONE
    is_stuck = needle.is_open and position - needle.opening_position > MAX_EVENT
    if is_stuck or position - synchronisation.rested > _RESTLESS:
        synchronisation.synchronised = False
        synchronisation.unsynchronised_by = REASON_NEEDLE_STUCK if is_stuck else REASON_NO_STANDSTILL
        memory.event.learnable = False


cdef bint _is_faulty(Observer* observer, int64_t position) noexcept nogil:
    """Whether a sample cannot be trusted, for more than a lift that is held while the needle is at rest.

    Had the needle moved meanwhile, the lift would leap when it is let go, or the line would ring.
    """
    cdef bint is_at_rest
    needle, timing = &observer.memory.needle, &observer.constants.timing
    row = &observer.ring[position & MASK]
    if row.doubt == DOUBT_NONE:
        return observer.memory.input_fault != REASON_NONE
    is_at_rest = not needle.is_open and row.index - needle.shut_index > timing.bounce
    others = max(observer.channels[RAIL].bridged, observer.channels[LINE].bridged)
    return not (is_at_rest and row.doubt == DOUBT_FROZEN and others <= timing.bridge)


cdef void _mark(Observer* observer, int64_t position) noexcept nogil:
    """Note validity, reason and state of the processed sample, whose rate is missing while x~ has not settled."""
    memory = observer.memory
    synchronisation, monitor, judgement = &memory.synchronisation, &memory.monitor, &memory.judgement
    row = &observer.ring[position & MASK]
    follow_flow(observer, position)
    facts = SampleFacts(
        synchronisation.unsynchronised_by, synchronisation.synchronised, row.doubt, memory.input_fault,
        is_beyond_limit(observer), monitor.falls >= INJECTIONS_UNSEEN,
        judgement.events_judged - judgement.doubtful_events, observer.constants.events_required,
        is_flow_known(observer, position), judgement.reason, monitor.contradicted or judgement.halted_in > 0,
        judgement.phi_version > 0, observer.constants.needle.stop > 0.0 and not row.resting and not is_seen(observer, position)
    )
    row.reason = reason_of_sample(&facts)
    row.valid = row.reason == REASON_NONE
    row.state = state_of_sample(&facts, row.reason)
    if not synchronisation.synchronised:
        row.injection_rate = row.open_loop_rate = NAN
    elif row.reason == REASON_LIFT_ZERO or _is_faulty(observer, position):
        memory.event.learnable, memory.event.fault = False, row.reason
