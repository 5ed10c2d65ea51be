# Events (openings closer than the event gap), their injections, and the queue of events to be judged.


cdef inline void shut_needle(Observer* observer, int64_t index) noexcept nogil:
    """Shut the needle from the sample `index` on."""
    observer.memory.needle.is_open = False
    observer.memory.needle.shut_index = index


cdef void begin_injection(Observer* observer, int64_t position) noexcept nogil:
    """The needle opens at `position`: an injection begins, and an event with it unless one is under way."""
    memory = observer.memory
    needle, under_way, counts = &memory.needle, &memory.event, &memory.counts
    positions, in_force = &memory.positions, &memory.in_force
    timing = &observer.constants.timing
    row = &observer.ring[position & MASK]
    needle.is_open = True
    needle.opening_position = position
    memory.monitor.falls = 0
    if not under_way.in_event:
        under_way.in_event = True
        under_way.number += 1
        under_way.opening_position = position
        under_way.learnable = memory.synchronisation.synchronised
        under_way.fault = 0
        under_way.differs = False
    if counts.injections_begun - counts.injections_reported == INJECTIONS:
        counts.injections_reported += 1
    injection = &observer.injections[counts.injections_begun % INJECTIONS]
    counts.injections_begun += 1
    injection.number = counts.injections_begun
    injection.event = under_way.number
    injection.start_position = max(position - timing.window_lead, positions.segment_start)
    injection.end_position = -1
    injection.start_index = observer.ring[injection.start_position & MASK].index
    injection.opening_index = row.index
    injection.opening_seen = position > positions.segment_start
    injection.rail_pressure = row.rail_pressure
    injection.known_from, injection.known_to = in_force.rail_from, in_force.rail_to


cdef void part_events(Observer* observer, int64_t position) noexcept nogil:
    """The shut needle is about to open at `position`: an event that has lasted its gap ends here.

    Not while the sac may still be filled: only after a needle that was shut long enough for x^ to follow x~. One that
    goes on without such a pause ends when it is too long to be learned from. The first ones, before which nothing is
    valid, need not last: openings every 4 ms would make three of them an event, and the learning wait for it.
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
    """Take back the opening under way, and its event if it has no other; otherwise that event teaches nothing.

    The caller sets since when the needle is shut.
    """
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
    """Where the tail of the injection before reaches into this opening, one ends and the other begins at the least flow.

    So each sample belongs to one, and their masses sum to what was injected.
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
    """The event ends; `position` is the last sample of its learning window. It waits to be judged."""
    cdef bint long_enough
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
    long_enough = position - under_way.opening_position >= timing.learning_lead
    event.learnable = (
        under_way.learnable
        and not needle.is_open
        and long_enough
        and position - event.start_position < MAX_EVENT
    )
    event.fault, event.differs = under_way.fault, under_way.differs
    event.closed_index = observer.ring[position & MASK].index
    event.judged_before = memory.judgement.events_judged
    event.injections = counts.injections_begun
    event.standstill = memory.standstill
    event.resting_lift = memory.resting_lift
    counts.events_closed += 1  # last: from here on others may read it


cdef void break_event(Observer* observer, int64_t position) noexcept nogil:
    """The stream breaks after `position`: an event under way ends here, unlearnable if the needle was open."""
    memory = observer.memory
    under_way = &memory.event
    if not under_way.in_event:
        return
    if memory.needle.is_open:
        under_way.learnable = False
        shut_needle(observer, observer.ring[position & MASK].index + 1)
    close_event(observer, position)


cdef void note_closed_late(Observer* observer, int64_t index) noexcept nogil:
    """That the last event was over, only the sample `index` showed."""
    observer.events[(observer.memory.counts.events_closed - 1) % PENDING_EVENTS].closed_index = index


cdef void make_all_due(Observer* observer) noexcept nogil:
    """Judge the waiting events at once: the index they were due at will not come, or no sample will."""
    memory = observer.memory
    for i in range(memory.judgement.events_taken, memory.counts.events_closed):
        observer.events[i % PENDING_EVENTS].due_index = -1


cdef bint judgement_due(Observer* observer, int64_t index) noexcept nogil:
    """Whether the oldest closed event must be judged before the sample `index`, at which the needle does not
    open.

    Outside every event, or where x^ follows x~ or is not available: nothing that is being integrated changes.
    """
    cdef bint is_at_rest
    memory = observer.memory
    needle = &memory.needle
    is_at_rest = not needle.is_open and index - needle.shut_index > observer.constants.timing.settle
    if memory.event.in_event and memory.synchronisation.synchronised and not is_at_rest:
        return False
    return observer.events[memory.judgement.events_taken % PENDING_EVENTS].due_index <= index


cdef void _end_window(Observer* observer, int64_t injections_before, int64_t position) noexcept nogil:
    """Integrate an injection up to the processed sample `position` if its window is still open: trapezoidal rule."""
    if injections_before < 0:
        return
    injection = &observer.injections[injections_before % INJECTIONS]
    if injection.end_position >= 0:
        return
    injection.end_position = position
    injection.end_index = observer.ring[position & MASK].index
    injection.phi_version = observer.memory.judgement.phi_version
    injection.state = observer.ring[position & MASK].state
    place = ((injection.start_position + position) // 2) & MASK
    middle = &observer.ring[place]
    copy_numbers(observer.x_hat + place * observer.states, injection.middle_x, 3)
    injection.middle_u[0] = middle.rail_pressure
    injection.middle_u[1] = middle.seat_area
    volume = predicted = peak = 0.0
    reason = 0
    for k in range(max(injection.start_position, position - MAX_EVENT), position + 1):
        row = &observer.ring[k & MASK]
        if reason == 0:
            reason = row.reason
        peak = max(peak, row.injection_rate)
        if k > injection.start_position:
            previous = &observer.ring[(k - 1) & MASK]
            volume += 0.5 * (previous.injection_rate + row.injection_rate)
            predicted += 0.5 * (previous.open_loop_rate + row.open_loop_rate)
    injection.volume = volume * observer.constants.interval
    injection.predicted_volume = predicted * observer.constants.interval
    if isnan(volume):
        peak = NAN
    injection.peak_rate = peak
    injection.reason = reason
    injection.valid = reason == 0
