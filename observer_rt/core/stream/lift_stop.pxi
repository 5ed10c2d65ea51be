# Lift stop: the lift at which long openings stay, for the scale of the sensor.

cdef enum:
    REMEMBERED = 20  # openings

cdef double NEAR = 0.1  # share by which a lift may differ from the highest so far and be that of the same stop


cdef void follow_opening(Observer* observer, int64_t position) noexcept nogil:
    """At a sample with the needle open: note where it stays, the highest such lift of the opening."""
    memory = observer.memory
    stop = &memory.stop
    lift = observer.ring[position & MASK].lift
    if not abs(lift - stop.level) <= memory.dead_band.lift_on:
        stop.level, stop.level_count = lift, 1
        return
    stop.level_count += 1
    stop.level += (lift - stop.level) / stop.level_count
    if stop.level_count >= observer.constants.timing.bounce:
        stop.highest = max(stop.highest, stop.level)


cdef void take_opening(Observer* observer) noexcept nogil:
    """The needle is shut: the highest lift at which it stayed is that of the stop, if it is not far below others."""
    stop = &observer.memory.stop
    highest = stop.highest
    stop.highest, stop.level_count = 0.0, 0
    if highest > (1.0 + NEAR) * stop.lift:
        stop.lift, stop.openings = highest, 1
    elif highest > (1.0 - NEAR) * stop.lift:
        stop.openings += 1
        stop.lift += (highest - stop.lift) / min(stop.openings, REMEMBERED)
