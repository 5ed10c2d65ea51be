# The lift of the needle's stop, where long openings stay. It shows the scale of the lift sensor.

cdef enum:
    EQUAL_OPENINGS = 20  # openings that the mean weighs equally; later ones replace the oldest

cdef double NEAR = 0.1  # relative difference up to which two lifts are those of the same stop


cdef void follow_opening(Observer* observer, int64_t position) noexcept nogil:
    """At a sample with the needle open: note the highest lift at which it stays during this opening."""
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
    """After the needle has shut: average the lift at which it stayed, unless it lies far below that of the stop."""
    stop = &observer.memory.stop
    highest = stop.highest
    stop.highest, stop.level_count = 0.0, 0
    if highest > (1.0 + NEAR) * stop.lift:
        stop.lift, stop.openings = highest, 1
    elif highest > (1.0 - NEAR) * stop.lift:
        stop.openings += 1
        stop.lift += (highest - stop.lift) / min(stop.openings, EQUAL_OPENINGS)
