# Compensation of stated lags, sample by sample.
#
# A rail pressure that is late is taken from later samples, on a straight line between two. A lift y whose sensor has the
# time constant tau is y + tau y', by central differences: they leave ramps as straight as they are, and what they take
# from one sample beside a corner they give to the next.


cdef double true_rail_pressure(Observer* observer, int64_t number) noexcept nogil:
    """Of the `number`-th sample [Pa]; at the ends of a stretch that of its first or last sample."""
    positions = &observer.memory.positions
    undoing = &observer.constants.undoing
    last = positions.recorded - 1
    earlier = min(max(number + undoing.rail_late, positions.unbroken_since), last)
    later = min(max(number + undoing.rail_late + 1, positions.unbroken_since), last)
    start = observer.recorded[earlier & RECORDED_MASK].values[RAIL]
    end = observer.recorded[later & RECORDED_MASK].values[RAIL]
    return start + undoing.rail_fraction * (end - start)


cdef double true_lift(Observer* observer, int64_t number) noexcept nogil:
    """Of the `number`-th sample [m]; at the ends of a stretch from the one neighbour it has."""
    positions = &observer.memory.positions
    before = max(number - 1, positions.unbroken_since)
    after = min(number + 1, positions.recorded - 1)
    lift = observer.recorded[number & RECORDED_MASK].values[LIFT]
    if after == before:
        return lift
    rise = (
        observer.recorded[after & RECORDED_MASK].values[LIFT]
        - observer.recorded[before & RECORDED_MASK].values[LIFT]
    )
    return lift + observer.constants.undoing.lift_lag * rise / (after - before)
