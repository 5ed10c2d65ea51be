# One sample of the pair, identification system x~ and observer x^: predicted, corrected by the innovation.

cdef double OFFSET_FOLLOWS = 5e-3  # s of standstill in which the offset of x~ follows its innovations: samples of a slow rail
cdef double FURTHEST_OFFSET = 1.5e6  # from the learned one: what moves further is no offset of a good sensor


cdef void start_pair(Observer* observer, int64_t position) noexcept nogil:
    """Begin x~, and x^ with it, anew: p_L = y, Q_L = 0, empty sac."""
    memory = observer.memory
    pair = &memory.pair
    row = &observer.ring[position & MASK]
    pair.offset = memory.in_force.learned_offset
    row.indicated = (row.line_pressure - pair.offset) / (1.0 + memory.in_force.sensor[SENSOR_GAIN])
    row.innovation = 0.0
    memory.outliers.accepted_innovation = 0.0
    memory.monitor.normalised_innovation_squared = 0.0
    memory.monitor.watched = position
    observer.step(observer.stepper, STEPPING_START, position)
    pair.since_start = 0
    memory.synchronisation.closed_since_start = 0


cdef bint _is_measured(Observer* observer, int64_t position) noexcept nogil:
    """Whether the line pressure of a sample, which may be recorded late or early, is in the ring, and no outlier."""
    late = observer.constants.sensor.late
    if (observer.ring[(position + late) & MASK].bridged >> LINE) & 1:
        return False
    if late == 0:
        return True
    if late > 0:
        return lookahead_at(observer, position) >= late
    return position + late >= observer.memory.positions.segment_start


cdef void _watch_up_to(Observer* observer, int64_t position) noexcept nogil:
    """Watch the innovations up to a sample; with control flow they are final when the lift has shown the valve."""
    cdef bint was_contradicted
    monitor = &observer.memory.monitor
    for k in range(monitor.watched + 1, position + 1):
        row = &observer.ring[k & MASK]
        monitor.watched = k
        if row.innovation == 0.0:
            continue
        was_contradicted = monitor.contradicted
        watch(observer, row.innovation, row.doubt)
        if monitor.contradicted:
            end_contradiction(observer, row.resting, not was_contradicted)
            count_falls(observer, row, not was_contradicted)


cdef bint step_pair(Observer* observer, int64_t position) noexcept nogil:
    """Step both systems from the previous sample to this one; False when a state is no longer finite."""
    cdef bint is_finite
    constants, memory, row = &observer.constants, observer.memory, &observer.ring[position & MASK]
    pair = &memory.pair
    shown = observer.step(observer.stepper, STEPPING_PREDICT, position)
    row.innovation = 0.0
    if _is_measured(observer, position):
        y = observer.ring[(position + constants.sensor.late) & MASK].line_pressure
        innovation = y - pair.offset - shown
        if accepted(memory, min(constants.timing.bridge, SHORT * constants.timing.confirm), innovation):
            row.innovation = innovation
    _watch_up_to(observer, position - memory.in_force.watch_later)
    is_finite = not isnan(observer.step(observer.stepper, STEPPING_CORRECT, position))
    pair.since_start += 1
    if row.resting:
        _follow_offset(observer, row.innovation)
    return is_finite


cdef void _follow_offset(Observer* observer, double innovation) noexcept nogil:
    """Have the offset of x~ follow what the standstill shows between events: sensors drift, or their gains differ.

    It stays where the noise is coloured, whose slow part has a mean at rest that the next opening does not keep.
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
