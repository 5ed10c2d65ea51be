# Events (openings closer than the event gap), their injections, and the queue of events to be judged.


cdef inline void shut_needle(Observer* observer, int64_t index) noexcept nogil:
    """Shut the needle from the sample `index` on."""
    observer.memory.needle.is_open = False
    observer.memory.needle.shut_index = index


cdef void begin_injection(Observer* observer, int64_t position) noexcept nogil:
    """Begin an injection with the needle that opens at `position`, and an event unless one is under way."""
    memory = observer.memory
    counts, start, row = &memory.counts, memory.positions.segment_start, &observer.ring[position & MASK]
    memory.needle.is_open, memory.needle.opening_position = True, position
    memory.monitor.falls = 0
    if not memory.event.in_event:
        _begin_event(memory, position)
    if counts.injections_begun - counts.injections_reported == INJECTIONS:
        counts.injections_reported += 1
    injection = &observer.injections[counts.injections_begun % INJECTIONS]
    counts.injections_begun += 1
    injection.number, injection.event = counts.injections_begun, memory.event.number
    injection.start_position = max(position - observer.constants.timing.window_lead, start)
    injection.end_position = -1
    injection.start_index = observer.ring[injection.start_position & MASK].index
    injection.opening_index, injection.opening_seen = row.index, position > start
    injection.rail_pressure = row.rail_pressure
    injection.known_from, injection.known_to = memory.in_force.rail_from, memory.in_force.rail_to


cdef inline void _begin_event(ObserverMemory* memory, int64_t position) noexcept nogil:
    """Begin an event with the opening at `position`."""
    under_way = &memory.event
    under_way.in_event = True
    under_way.number += 1
    under_way.opening_position = position
    under_way.learnable = memory.synchronisation.synchronised
    under_way.fault = 0


cdef void part_events(Observer* observer, int64_t position) noexcept nogil:
    """End an event that has lasted its gap before the shut needle opens at `position`.

    The sac must be empty, so the needle must have been shut long enough for x^ to follow x~. An event without such a
    pause ends when it is too long to be learned from. The first events, before which nothing is valid, need not last:
    of openings every 4 ms three would be an event, and the learning would wait for it.
    """
    cdef bint is_at_rest, is_first, is_over
    memory = observer.memory
    under_way = &memory.event
    timing = &observer.constants.timing
    lasted = position - under_way.opening_position
    is_at_rest = observer.ring[position & MASK].index - memory.needle.shut_index > timing.settle
    is_first = memory.counts.events_closed < observer.constants.events_required
    is_over = is_at_rest and (is_first or lasted >= timing.event_gap)
    if under_way.in_event and (lasted > MAX_EVENT or is_over):
        close_event(observer, position - 1)


cdef void forget_opening(Observer* observer) noexcept nogil:
    """Take back the opening under way, and its event if it has no other; else that event teaches nothing."""
    memory = observer.memory
    under_way = &memory.event
    memory.counts.injections_begun -= 1
    if memory.needle.opening_position == under_way.opening_position:
        under_way.number -= 1
        under_way.in_event = False
    else:
        under_way.learnable = False


cdef void follow_injection(Observer* observer, int64_t position) noexcept nogil:
    """At a processed sample: end the injection's window when its tail is over, the event when its gap is."""
    memory = observer.memory
    needle, counts = &memory.needle, &memory.counts
    timing = &observer.constants.timing
    if not memory.event.in_event:
        return
    if needle.is_open:
        _part_injections(observer, position)
        return
    shut_for = observer.ring[position & MASK].index - needle.shut_index
    if shut_for >= timing.window_tail:
        _end_window(observer, counts.injections_begun - 1, position)
    if shut_for >= timing.event_gap:
        close_event(observer, position)


cdef void _part_injections(Observer* observer, int64_t position) noexcept nogil:
    """End an injection whose tail reaches into the next opening at the least flow, where the next one begins.

    So every sample belongs to one injection, and their masses sum to what was injected.
    """
    cdef int64_t number = observer.memory.counts.injections_begun - 2, meet, k
    if number < 0 or observer.injections[number % INJECTIONS].end_position >= 0:
        return
    injection = &observer.injections[(number + 1) % INJECTIONS]
    ring = observer.ring
    meet = max(injection.start_position, position - (ring[position & MASK].index - observer.memory.needle.shut_index))
    for k in range(meet + 1, position + 1):
        if ring[k & MASK].injection_rate < ring[meet & MASK].injection_rate:
            meet = k
    injection.start_position, injection.start_index = meet, ring[meet & MASK].index
    _end_window(observer, number, meet)


cdef void close_event(Observer* observer, int64_t position) noexcept nogil:
    """End the event with `position` as the last sample of its learning window, and have it wait to be judged."""
    memory = observer.memory
    counts, under_way, needle = &memory.counts, &memory.event, &memory.needle
    timing = &observer.constants.timing
    _end_window(observer, counts.injections_begun - 1, position)
    forget_other_noise(observer)
    under_way.in_event = False
    event = &observer.events[counts.events_closed % PENDING_EVENTS]
    event.number = under_way.number
    shut_at = min(needle.shut_index + timing.event_gap, observer.ring[position & MASK].index)
    event.due_index = shut_at + timing.learning_delay
    event.opening_position = under_way.opening_position
    event.start_position = max(under_way.opening_position - timing.learning_lead, memory.positions.segment_start)
    event.end_position = position
    event.learnable = (
        under_way.learnable
        and not needle.is_open
        and position - under_way.opening_position >= timing.learning_lead
        and position - event.start_position < MAX_EVENT
    )
    event.fault = under_way.fault
    event.closed_index = observer.ring[position & MASK].index
    event.judged_before, event.injections = memory.judgement.events_judged, counts.injections_begun
    event.standstill, event.resting_lift = memory.standstill, memory.resting_lift
    counts.events_closed += 1  # last: from here on others may read it


cdef void break_event(Observer* observer, int64_t position) noexcept nogil:
    """End an event under way where the stream breaks after `position`; it is unlearnable if the needle was open."""
    memory = observer.memory
    under_way = &memory.event
    if not under_way.in_event:
        return
    if memory.needle.is_open:
        under_way.learnable = False
        shut_needle(observer, observer.ring[position & MASK].index + 1)
    close_event(observer, position)


cdef void note_closed_late(Observer* observer, int64_t index) noexcept nogil:
    """Note that only the sample `index` showed that the last event was over."""
    observer.events[(observer.memory.counts.events_closed - 1) % PENDING_EVENTS].closed_index = index


cdef void make_all_due(Observer* observer) noexcept nogil:
    """Make the waiting events due at once: the index they were due at will not come, or no sample will."""
    memory = observer.memory
    for i in range(memory.judgement.events_taken, memory.counts.events_closed):
        observer.events[i % PENDING_EVENTS].due_index = -1


cdef bint judgement_due(Observer* observer, int64_t index) noexcept nogil:
    """Whether the oldest closed event must be judged before the sample `index`, at which the needle does not open.

    A verdict must change no flow that is being integrated: it is due outside events, and where x^ follows x~ or is
    missing.
    """
    memory = observer.memory
    needle = &memory.needle
    if memory.event.in_event and memory.synchronisation.synchronised:
        if needle.is_open or index - needle.shut_index <= observer.constants.timing.settle:  # it is not at rest
            return False
    return observer.events[memory.judgement.events_taken % PENDING_EVENTS].due_index <= index


cdef void _end_window(Observer* observer, int64_t number, int64_t position) noexcept nogil:
    """End the window of the injection that follows `number` others at the sample `position`, unless it has ended."""
    if number < 0 or observer.injections[number % INJECTIONS].end_position >= 0:
        return
    injection, row = &observer.injections[number % INJECTIONS], &observer.ring[position & MASK]
    injection.end_position, injection.end_index = position, row.index
    injection.phi_version, injection.state = observer.memory.judgement.phi_version, row.state
    place = ((injection.start_position + position) // 2) & MASK
    copy_numbers(observer.x_hat + place * observer.states, injection.middle_x, 3)
    injection.middle_u[0] = observer.ring[place].rail_pressure
    injection.middle_u[1] = observer.ring[place].seat_area
    _integrate(observer, injection)


cdef void _integrate(Observer* observer, Injection* injection) noexcept nogil:
    """Integrate an injection's rates over its window by the trapezoidal rule; note their peak and why it is not valid.

    Its first samples may be known less sharply than its mass: what counts is the flow at its end, and the mean.
    """
    cdef int64_t reason = REASON_NONE
    volume = predicted = peak = unknown = 0.0
    for k in range(max(injection.start_position, injection.end_position - MAX_EVENT), injection.end_position + 1):
        row = &observer.ring[k & MASK]
        if reason == REASON_NONE and row.reason != REASON_OUTSIDE_LEARNED_RANGE:
            reason = row.reason
        unknown += max(0.0, row.rate_sigma)  # in this order, which leaves out NaN
        peak = max(peak, row.injection_rate)
        if k > injection.start_position:
            previous = &observer.ring[(k - 1) & MASK]
            volume += 0.5 * (previous.injection_rate + row.injection_rate)
            predicted += 0.5 * (previous.open_loop_rate + row.open_loop_rate)
    if reason == REASON_NONE:
        reason = REASON_OUTSIDE_LEARNED_RANGE if unknown > SHARP * volume else row.reason
    injection.volume = volume * observer.constants.interval
    injection.predicted_volume = predicted * observer.constants.interval
    injection.peak_rate = NAN if isnan(volume) else peak
    injection.reason, injection.valid = reason, reason == REASON_NONE
