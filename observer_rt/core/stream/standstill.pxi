# Estimates at standstill: noise levels, and the offset between line and rail pressure.

cpdef enum:
    ENOUGH_SAMPLES = 256  # of standstill, before measured noise may replace the stated
    NOISE_MEMORY = 16_384  # squares of which the mean is formed at least; beyond twice as many the older count half
    LIFT_MEMORY = 4_096  # squares the running mean of the lift remembers
    _ORDER = 4  # differences: order 4 leaves the ringing of the line below the noise even at 20 kHz
    _TRUSTED = 200  # squares, from which on their mean tells a spike
    _REPEATED = 16  # samples

cdef double CONTRADICTED = 5.0  # standard deviations of a measured level's logarithm, from which on it is another
cdef double SPREAD = 1.3  # n times the variance of that logarithm: neighbouring differences share samples
cdef double DIFFERENCE_GAIN = 70.0  # sum of squares of 1 4 6 4 1
cdef double _NEXT = -56.0  # sum of products of neighbours in 1 -4 6 -4 1
cdef double _NEXT_BUT_ONE = 28.0  # and of those beyond them
cdef double _SPIKE = 36.0  # times the mean square: six sigma


cdef void gather(Observer* observer, int64_t position) noexcept nogil:
    """Take the sample at `position` into the statistics of the standstill."""
    cdef bint is_finite
    memory = observer.memory
    rest, standstill, differences = &memory.rest, &memory.standstill, &memory.standstill.differences
    row = &observer.ring[position & MASK]
    is_finite = memory.synchronisation.unsynchronised_by != REASON_NUMERICAL
    if not row.resting or row.interpolated or row.bridged != 0 or not is_finite:
        rest.run = 0
        rest.at_highest = 0
        rest.highest_line = max(rest.highest_line, row.line_pressure)
        return
    if _note_clipping(observer, position):
        rest.run = 0
        return
    rest.run += 1
    standstill.rest_count += 1
    standstill.offset_sum += row.line_pressure - observer.constants.sensor.offset - row.rail_pressure
    if rest.run > _ORDER:
        a = &observer.ring[(position - 4) & MASK]
        b = &observer.ring[(position - 3) & MASK]
        c = &observer.ring[(position - 2) & MASK]
        d = &observer.ring[(position - 1) & MASK]
        count = differences.count
        undone = observer.constants.undoing.rail_fraction if observer.constants.rail_every <= 1.0 else 0.0
        differences.rail_squares += square_of_difference(
            a.rail_pressure, b.rail_pressure, c.rail_pressure, d.rail_pressure, row.rail_pressure,
            differences.rail_squares, count, smoothing(row.rail_share, undone)
        )
        differences.line_squares += square_of_difference(
            a.line_pressure, b.line_pressure, c.line_pressure, d.line_pressure, row.line_pressure,
            differences.line_squares, count, 1.0
        )
        differences.count += 1
        if differences.count == 2 * NOISE_MEMORY:
            _halve(observer)


cdef bint _note_clipping(Observer* observer, int64_t position) noexcept nogil:
    """Count samples at the line pressure's highest value while the rail pressure moves, and say whether it is clipped."""
    cdef bint moves
    rest, row = &observer.memory.rest, &observer.ring[position & MASK]
    moves = row.rail_pressure != observer.ring[(position - 1) & MASK].rail_pressure
    rest.at_highest = rest.at_highest + 1 if moves and row.line_pressure == rest.highest_line else 0
    rest.highest_line = max(rest.highest_line, row.line_pressure)
    return rest.at_highest >= _REPEATED


cdef void _halve(Observer* observer) noexcept nogil:
    """Have the sums so far count half."""
    differences, before = &observer.memory.standstill.differences, &observer.memory.rest.before
    differences.count = NOISE_MEMORY
    before.count //= 2
    differences.rail_squares *= 0.5
    differences.line_squares *= 0.5
    before.rail_squares *= 0.5
    before.line_squares *= 0.5


cdef bint _differ(double a, double b, double factor) noexcept nogil:
    """Whether either exceeds the other by more than a factor."""
    return a > factor * b or b > factor * a


cdef void forget_other_noise(Observer* observer) noexcept nogil:
    """At the end of an event, forget the sums before it if the noise has become another since."""
    differences, before = &observer.memory.standstill.differences, &observer.memory.rest.before
    since = differences.count - before.count
    if min(before.count, since) >= ENOUGH_SAMPLES:
        rail = differences.rail_squares - before.rail_squares
        line = differences.line_squares - before.line_squares
        within = exp(CONTRADICTED * sqrt(4.0 * SPREAD * (1.0 / before.count + 1.0 / since)))
        share = <double> since / before.count
        if _differ(rail, share * before.rail_squares, within) or _differ(line, share * before.line_squares, within):
            differences.count, differences.rail_squares, differences.line_squares = since, rail, line
    observer.memory.rest.before = observer.memory.standstill.differences


cdef double smoothing(double share, double again) noexcept nogil:
    """Factor on the square of a fourth difference by two interpolations, with these shares of the later neighbour.

    To the line, which follows slowly, an interpolated pressure is as noisy as its neighbours are.
    """
    first = (1.0 - share) * (1.0 - again)
    second = share * (1.0 - again) + (1.0 - share) * again
    third = share * again
    squares = first * first + second * second + third * third
    beside = 2.0 * (first * second + second * third)
    return squares + (beside * _NEXT + 2.0 * first * third * _NEXT_BUT_ONE) / DIFFERENCE_GAIN


cdef double square_of_difference(
    double a, double b, double c, double d, double e, double total, int64_t count, double smoothed
) noexcept nogil:
    """Square of the fourth difference, a spike limited by the `count` before; smoothed: by interpolation."""
    square = (a - 4 * (b + d) + 6 * c + e) ** 2 / smoothed
    if count < _TRUSTED:
        return square
    return min(square, _SPIKE * total / count)
