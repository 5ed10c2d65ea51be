# Clock of a device by the receive stamps: a straight line under the stamps of its frames.
#
# A frame is never received before it was sent, so the delays of frames are positive, and the least of them are the
# same again and again: the line through the lowest stamps of many short windows (the lower convex hull, as used for
# one-way delays in packet networks: Moon, Skelly, Towsley, INFOCOM 1999) gives offset and drift of the clock, whatever
# jitter lies above it. How far these lowest stamps scatter about the line is what is not known of the clock.

from libc.math cimport INFINITY
from libc.stdint cimport int64_t

from observer_rt.core.frames.records cimport POINTS, Clock

cdef enum:
    ENOUGH_POINTS = 4  # from which on the line is trusted

cdef extern from *:
    """
    #define WINDOW 0.2e9
    #define MAX_DRIFT 500e-6
    #define CLOCK_STEP 1e6
    #define PROMPT 2e3
    #define FEW_PROMPT (1.0 / 3.0)
    #define LEAST_OF_DELAYS 0.75
    #define USUAL_GAIN 0.25
    #define FEW_TOGETHER 0.1
    """
    const double WINDOW  # ns
    const double MAX_DRIFT  # of any clock worth the name; more is a wrong sample rate in the bench file
    const double CLOCK_STEP  # ns that the lowest stamps of a window may leave the line by before the clock counts as set anew
    const double PROMPT  # ns of delay, within which a frame came without waiting
    const double FEW_PROMPT  # share of such frames, below which it is not sure that any did
    # Share of the mean delay that even the quickest frame of a window may have waited, where few frames are prompt; added
    # to `residual`. Batches that beat with the cycle come so.
    const double LEAST_OF_DELAYS
    const double USUAL_GAIN  # weight of a window's greatest delay in the usual one
    const double FEW_TOGETHER  # share of frames closer than a bus can carry them, above which they came in batches


cdef inline void forget(Clock* clock) noexcept nogil:
    """Begin anew: the index or the stamps no longer continue those before."""
    clock.begun, clock.points, clock.residual = False, 0, INFINITY
    clock.offset = clock.drift = clock.spread = clock.latest = clock.usual = clock.raised = 0.0


cdef inline double excess(Clock* clock, int64_t index, int64_t stamp) noexcept nogil:
    """ns by which a stamp lies after the nominal time of the sample `index`."""
    return (stamp - clock.first_stamp) - (index - clock.first_index) * clock.interval


cdef inline double delay_of(Clock* clock, int64_t index, int64_t stamp) noexcept nogil:
    """ns by which a stamp lies above the line; 0 for the first one."""
    if not clock.begun:
        return 0.0
    line = clock.offset + clock.drift * (index - clock.first_index)
    return excess(clock, index, stamp) - line


cdef inline bint take_stamp(Clock* clock, int64_t index, int64_t stamp) noexcept nogil:
    """Note that the frame with last sample `index` came at `stamp` [ns]; True if it ended a window: a new line."""
    if not clock.begun:
        clock.begun, clock.first_index, clock.first_stamp = True, index, stamp
        _open_window(clock, 0.0)
    place = <double> (index - clock.first_index)
    above = excess(clock, index, stamp)
    delay = above - clock.offset - clock.drift * place
    if clock.points < ENOUGH_POINTS and delay < 0.0:
        clock.offset += delay  # the lowest stamp so far
        delay = 0.0
    elif clock.points >= ENOUGH_POINTS:
        clock.delays += 1
        clock.delay_sum += delay
        clock.delay_squares += delay * delay
        clock.delay_max = max(clock.delay_max, delay)
    clock.latest = max(clock.latest, delay)
    clock.waited += delay
    clock.prompt += delay < PROMPT
    clock.frames += 1
    if clock.frames > 1 and stamp - clock.last_stamp < clock.shortest:
        clock.together += 1
    clock.last_stamp = stamp
    if above < clock.lowest:
        clock.lowest, clock.lowest_at = above, place
    now = <double> (stamp - clock.first_stamp)
    if now < clock.window_end:
        return False
    _close_window(clock, now)
    return True


cdef inline double time_of(Clock* clock, double index, int64_t epoch) noexcept nogil:
    """Time [ns after the stamp `epoch`] at which the frame that ends in sample `index` came, had it no jitter."""
    place = index - clock.first_index
    return (clock.first_stamp - epoch) + clock.offset + place * (clock.interval + clock.drift)


cdef inline double index_at(Clock* clock, double time, int64_t epoch) noexcept nogil:
    """The inverse of `time_of`: the sample, with its fraction, at a time [ns after the stamp `epoch`]."""
    since = time - (clock.first_stamp - epoch) - clock.offset
    return clock.first_index + since / (clock.interval + clock.drift)


cdef inline void _open_window(Clock* clock, double start) noexcept nogil:
    clock.window_end, clock.lowest = start + WINDOW, INFINITY
    clock.latest = clock.waited = 0.0
    clock.frames = clock.prompt = clock.together = 0


cdef inline void _close_window(Clock* clock, double now) noexcept nogil:
    """Take the lowest stamp of the window into the line, or begin a new line when it does not belong to it."""
    off_line = clock.lowest - clock.offset - clock.drift * clock.lowest_at
    clock.raised = off_line if clock.points >= ENOUGH_POINTS else 0.0
    if clock.points >= ENOUGH_POINTS and abs(off_line) > CLOCK_STEP:
        clock.points, clock.residual = 0, INFINITY
        clock.offset, clock.drift = clock.lowest, 0.0
    row = clock.points % POINTS
    clock.places[row], clock.excesses[row] = clock.lowest_at, clock.lowest
    clock.points += 1
    clock.spread = clock.latest
    if clock.points <= ENOUGH_POINTS:
        clock.usual = max(clock.usual, clock.spread)
    else:
        clock.usual += USUAL_GAIN * (clock.spread - clock.usual)
    if clock.points >= ENOUGH_POINTS:
        _draw_line(clock)
        if clock.together > FEW_TOGETHER * clock.frames:
            # all frames of a batch carry its time: when each was sent lies somewhere within a cycle
            clock.residual += clock.samples * clock.interval
        if clock.prompt < FEW_PROMPT * clock.frames:
            clock.residual += LEAST_OF_DELAYS * clock.waited / clock.frames
    _open_window(clock, now)


cdef inline void _draw_line(Clock* clock) noexcept nogil:
    """The edge of the lower convex hull under the middle of the points, and how far the points are from it."""
    cdef double x[POINTS]
    cdef double y[POINTS]
    cdef double distances[POINTS]
    cdef int64_t order[POINTS]
    cdef int64_t hull[POINTS]
    cdef int64_t count = min(clock.points, POINTS), size = 0, edge = 0, k, a, b
    cdef double middle = 0.0
    ascending(clock.places, count, order)
    for k in range(count):
        x[k], y[k] = clock.places[order[k]], clock.excesses[order[k]]
    for k in range(count):
        while size >= 2 and _is_above(x, y, hull[size - 2], hull[size - 1], k):
            size -= 1
        hull[size] = k
        size += 1
        middle += x[k]
    middle /= count
    while edge < size - 2 and x[hull[edge + 1]] < middle:
        edge += 1
    a, b = hull[edge], hull[edge + 1]
    clock.drift = (y[b] - y[a]) / (x[b] - x[a])
    clock.offset = y[a] - clock.drift * x[a]
    clock.residual = INFINITY
    if abs(clock.drift) <= MAX_DRIFT * clock.interval:
        # not their greatest: in some windows every frame may have been late
        for k in range(count):
            distances[k] = y[k] - clock.offset - clock.drift * x[k]
        ascending(distances, count, order)
        clock.residual = distances[order[3 * count // 4]]


cdef inline void ascending(const double* values, int64_t count, int64_t* order) noexcept nogil:
    """Places of a few values in ascending order, equal ones as they come."""
    cdef int64_t k, i, place
    for k in range(count):
        place, i = k, k
        while i > 0 and values[order[i - 1]] > values[place]:
            order[i] = order[i - 1]
            i -= 1
        order[i] = place


cdef inline bint _is_above(const double* x, const double* y, int64_t a, int64_t b, int64_t c) noexcept nogil:
    """Whether point b lies on or above the straight line from a to c."""
    return (y[b] - y[a]) * (x[c] - x[a]) >= (y[c] - y[a]) * (x[b] - x[a])
