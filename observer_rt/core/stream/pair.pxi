# One sample of the pair, identification system x~ and observer x^: the innovation, and what it says.
#
# Watches the running mean of normalised innovations squared (NIS) against a limit, at every sample.

cdef enum:
    SWINGS_FOR = 3  # times the gap between events, after the needle has shut
    INJECTIONS_UNSEEN = 2  # in a row, from which on the lift is dead
    SHORT = 2  # times what an opening takes to be one: leaps of the innovation that last longer contradict the model

cdef double NIS_MEMORY = 16.0  # samples the running mean square remembers; its own standard deviation for white noise is .25
cdef double LARGEST = 20.0  # variances a single square counts for: three spikes are no contradiction
cdef double LIMIT = 5.0  # of the mean square; no injector of `tools/bench accuracy` that is valid shows more than 3
cdef double CALM_NIS = 2.5  # of the mean square: noise, four standard deviations at most
cdef double FALL = 3e6  # Pa by which an injection lets the line pressure fall at least
cdef double OFFSET_FOLLOWS = 5e-3
cdef double FURTHEST_OFFSET = 1.5e6  # from the learned one: what moves further is no offset of a good sensor


cdef inline void watch(Observer* observer, double innovation, int64_t doubt) noexcept nogil:
    """Take in an innovation of x~ [p_0]; what contradicts the model stays so until an event after it has passed.

    doubt: `Doubt` of its sample; one that is not to be trusted contradicts nothing. Squares, for the line swings:
    innovations of both signs would make up for each other.
    """
    cdef bint is_beyond
    memory = observer.memory
    monitor, under_way = &memory.monitor, &memory.event
    if doubt != DOUBT_NONE or memory.input_fault != REASON_NONE:
        monitor.normalised_innovation_squared = 0.0
        return
    square = min(innovation * innovation * memory.innovation_noise.weight, LARGEST)
    monitor.normalised_innovation_squared += (square - monitor.normalised_innovation_squared) / NIS_MEMORY
    is_beyond = monitor.normalised_innovation_squared > LIMIT
    if is_beyond and memory.synchronisation.synchronised and not monitor.contradicted:
        contradict(observer, under_way.number if under_way.in_event else under_way.number + 1)


cdef inline void contradict(Observer* observer, int64_t event) noexcept nogil:
    """The model is contradicted, and no event before that number can tell otherwise."""
    monitor = &observer.memory.monitor
    monitor.contradicted, monitor.alarm_at_standstill = True, False
    monitor.contradicted_in = event


cdef void end_contradiction(Observer* observer, bint is_resting, bint is_new) noexcept nogil:
    """A contradiction that came with the needle long shut is a channel's, and over when that is well again.

    is_new: it came with this sample. One that lasts until an opening lasts until an event has passed.
    """
    monitor = &observer.memory.monitor
    if is_new:
        monitor.alarm_at_standstill = is_resting
        monitor.calm = 0
    monitor.alarm_at_standstill = monitor.alarm_at_standstill and is_resting
    monitor.calm = monitor.calm + 1 if monitor.normalised_innovation_squared < CALM_NIS else 0
    if monitor.alarm_at_standstill and monitor.calm >= observer.constants.timing.good:
        monitor.contradicted = False


cdef inline void count_falls(Observer* observer, Sample* row, bint is_new) noexcept nogil:
    """At a contradiction with the needle long shut: whether the line pressure fell and came back, as by an injection.

    is_new: it came with this sample. Not while the line still swings from an opening.
    """
    memory = observer.memory
    monitor = &memory.monitor
    if row.index - memory.needle.shut_since < SWINGS_FOR * observer.constants.timing.event_gap:
        return
    drop = row.line_pressure - row.rail_pressure
    monitor.lowest_line = drop if is_new else min(monitor.lowest_line, drop)
    if not monitor.contradicted and -monitor.lowest_line * observer.constants.pressure_scale > FALL:
        monitor.falls += 1
# s of standstill in which the offset of x~ follows its innovations: some samples of a rail pressure of 1 kHz


cdef void start_pair(Observer* observer, int64_t position) noexcept nogil:
    """x~ (and x^ with it) begins anew: p_L = y, Q_L = 0, empty sac."""
    memory = observer.memory
    pair = &memory.pair
    row = &observer.ring[position & MASK]
    pair.offset = memory.in_force.learned_offset
    row.indicated = row.line_pressure - pair.offset
    row.innovation = 0.0
    memory.outliers.accepted_innovation = 0.0
    memory.monitor.normalised_innovation_squared = 0.0
    observer.step(observer.stepper, STEPPING_START, position)
    pair.since_start = 0
    memory.synchronisation.closed_since_start = 0


cdef bint _is_measured(Observer* observer, int64_t position) noexcept nogil:
    """Whether the line pressure that belongs to a sample is in the ring, for it may be recorded late or early.

    And is one: an outlier is none.
    """
    late = observer.constants.sensor.late
    if (observer.ring[(position + late) & MASK].bridged >> LINE) & 1:
        return False
    if late == 0:
        return True
    if late > 0:
        return known(observer, position) >= late
    return position + late >= observer.memory.positions.segment_start


cdef bint step_pair(Observer* observer, int64_t position) noexcept nogil:
    """Both systems from the previous sample to this one; False when a state is no longer finite."""
    cdef bint was_contradicted, is_finite
    constants, memory, row = &observer.constants, observer.memory, &observer.ring[position & MASK]
    pair, monitor = &memory.pair, &memory.monitor
    shown = observer.step(observer.stepper, STEPPING_PREDICT, position)
    row.innovation = 0.0
    if _is_measured(observer, position):
        y = observer.ring[(position + constants.sensor.late) & MASK].line_pressure
        innovation = y - pair.offset - shown
        if accepted(memory, min(constants.timing.bridge, SHORT * constants.timing.confirm), innovation):
            row.innovation = innovation
            was_contradicted = monitor.contradicted
            watch(observer, innovation, row.doubt)
            if monitor.contradicted:
                end_contradiction(observer, row.resting, not was_contradicted)
                count_falls(observer, row, not was_contradicted)
    is_finite = not isnan(observer.step(observer.stepper, STEPPING_CORRECT, position))
    pair.since_start += 1
    if row.resting:
        _follow_offset(observer, row.innovation)
    return is_finite


cdef void _follow_offset(Observer* observer, double innovation) noexcept nogil:
    """Between events, too, the offset of x~ is what the standstill shows: sensors drift, or their gains differ.

    Not where the noise is coloured: its slow part has a mean at rest that the next opening does not keep.
    """
    cdef bint is_settled
    memory = observer.memory
    pair, in_force = &memory.pair, &memory.in_force
    furthest = FURTHEST_OFFSET / observer.constants.pressure_scale
    is_settled = pair.since_start > observer.constants.timing.settle
    if not (memory.judgement.offset_moves and is_settled and isfinite(innovation)):
        return
    moved = pair.offset - in_force.learned_offset + innovation * observer.constants.interval / OFFSET_FOLLOWS
    pair.offset = in_force.learned_offset + min(max(moved, -furthest), furthest)
