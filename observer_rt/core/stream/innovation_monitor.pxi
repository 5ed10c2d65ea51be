# Innovation monitor: watches the running mean of normalised innovations squared (NIS) against a limit, at every sample.

cdef enum:
    SWINGS_FOR = 3  # times the gap between events, after the needle has shut
    INJECTIONS_UNSEEN = 2  # in a row, from which on the lift is dead
    SHORT = 2  # times what an opening takes to be one: leaps of the innovation that last longer contradict the model

cdef double NIS_MEMORY = 16.0  # samples the running mean square remembers; its own standard deviation for white noise is .25
cdef double LARGEST = 20.0  # variances a single square counts for: three spikes are no contradiction
cdef double LIMIT = 5.0  # of the mean square; no injector of `tools/bench accuracy` that is valid shows more than 3
cdef double CALM_NIS = 2.5  # of the mean square: white noise, six of its standard deviations at most
cdef double FALL = 3e6  # Pa by which an injection lets the line pressure fall at least


cdef inline void watch(Observer* observer, double innovation, int64_t doubt) noexcept nogil:
    """Take in an innovation of x~ [p_0]; what contradicts the model stays so until a later event passes, or standstill is calm.

    doubt: `Doubt` of its sample; a sample with a doubt contradicts nothing. Squares are watched, because in a line
    that swings innovations of both signs would make up for each other.
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
    """Note that the model is contradicted, which no event before that number can refute."""
    monitor = &observer.memory.monitor
    monitor.contradicted, monitor.alarm_at_standstill = True, False
    monitor.contradicted_in = event


cdef void end_contradiction(Observer* observer, bint is_resting, bint is_new) noexcept nogil:
    """End a contradiction that came with the needle long shut, a channel's, when the channel is well again.

    is_new: it came with this sample. A contradiction at an opening lasts until an event has passed.
    """
    monitor = &observer.memory.monitor
    if is_new:
        monitor.alarm_at_standstill, monitor.calm = is_resting, 0
    monitor.alarm_at_standstill = monitor.alarm_at_standstill and is_resting
    monitor.calm = monitor.calm + 1 if monitor.normalised_innovation_squared < CALM_NIS else 0
    if monitor.alarm_at_standstill and monitor.calm >= observer.constants.timing.good:
        monitor.contradicted = False


cdef inline void count_falls(Observer* observer, Sample* row, bint is_new) noexcept nogil:
    """Count falls of the line pressure that came back, as by an injection, with the needle long shut.

    is_new: the contradiction came with this sample. Nothing is counted while the line still swings from an opening.
    """
    memory = observer.memory
    monitor = &memory.monitor
    if row.index - memory.needle.shut_index < SWINGS_FOR * observer.constants.timing.event_gap:
        return
    drop = row.line_pressure - row.rail_pressure
    monitor.lowest_drop = drop if is_new else min(monitor.lowest_drop, drop)
    if not monitor.contradicted and -monitor.lowest_drop * observer.constants.pressure_scale > FALL:
        monitor.falls += 1
        memory.counts.unseen_injections += 1
