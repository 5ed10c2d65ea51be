# Compensation of stated lags, sample by sample.
#
# A rail pressure that is recorded late is read from later samples, by linear interpolation between two of them. A
# sensor with the time constant tau shows a lift x as y = x - tau y', so x = y + tau y'. The derivative is a central
# difference: it is exact on ramps, and at a corner its errors on both sides cancel in the integral of the lift.


cdef double true_rail_pressure(Observer* observer, int64_t number) noexcept nogil:
    """Rail pressure at sample `number` [Pa]; beyond the ends of a stretch without gaps, that of its end."""
    positions = &observer.memory.positions
    undoing = &observer.constants.undoing
    last = positions.recorded - 1
    earlier = min(max(number + undoing.rail_late, positions.unbroken_since), last)
    later = min(max(number + undoing.rail_late + 1, positions.unbroken_since), last)
    start = observer.recorded[earlier & RECORDED_MASK].values[RAIL]
    end = observer.recorded[later & RECORDED_MASK].values[RAIL]
    return start + undoing.rail_fraction * (end - start)


cdef double true_lift(Observer* observer, int64_t number) noexcept nogil:
    """Lift at sample `number` [m]; at the ends of a stretch without gaps, by a one-sided difference."""
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
