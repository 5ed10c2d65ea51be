"""Finds outliers in an event: a held signal, bursts of noise, and values at the end of a range."""

from libc.math cimport INFINITY, fabs
from libc.stdint cimport int64_t

from numpy import empty, zeros

# Stretches over which a signal was held.
cdef int64_t SHORTEST = 8, LONGEST = 64  # samples
cdef double BETTER = 40.0  # chi2 by which a constant must fit better than the model
cdef double JUMP = 5.0  # standard deviations by which the value jumps when it is let go
cdef int64_t LONG = 24  # samples from which on a stretch need not end with a jump
cdef double MUCH_BETTER = 300.0  # chi2 by which a constant must then fit better
cdef double MOST_OF_A_HELD_ONE = 6.0  # standard deviations that one sample may add: a single large one is a spike
# Largest chi2 of a constant over LONG samples, less their number: four standard deviations.
cdef double FLAT_STRETCH = 28.0
cdef int64_t RECOVERY = 20  # samples after a stretch until the innovations are normal again

# Bursts of noise.
cdef int64_t LENGTH = 48  # samples over which the loudness is averaged
cdef double LOUD = 3.0  # times the variance at rest: that of white noise stays below 2 in 1e4 events
cdef double MOST_OF_ONE = 9.0  # times that variance, which one sample may add: a spike is no burst
cdef double OF_DIFFERENCE = 70.0  # variance of the fourth difference of white noise of unit variance

# Ends of a range.
cdef int64_t SMOOTHED = 5  # samples of the mean that is compared with a level
cdef double AT_LEVEL = 1.5  # standard deviations of one sample that the mean may lie below its level
cdef int64_t REFINEMENTS = 3  # of the level, whose first value is too high
cdef int64_t FEWEST = 6  # samples at a level, below which nothing is concluded
cdef double MOVING = 10.0  # standard deviations that the signal must span: at rest it reaches no end

globals().update(BETTER=BETTER, LENGTH=LENGTH, AT_LEVEL=AT_LEVEL, FEWEST=FEWEST)


cdef struct Sums:
    const double* of_values  # of y - y[0], up to each sample
    const double* of_squares
    double variance


cdef inline double _chi2_of_constant(const Sums* sums, int64_t start, int64_t end) noexcept nogil:
    cdef double total = sums.of_values[end] - sums.of_values[start]
    cdef double mean_square = total * total / <double> (end - start)
    return (sums.of_squares[end] - sums.of_squares[start] - mean_square) / sums.variance


def find_held(
    const double[:] y, const double[:] innovations, masked, double innovation, double noise, int64_t first
) -> NDArray[np.float64]:
    """Stretches (k, 3) over which y was held: start, end, level. A leap of the innovations, or its length, shows one.

    y, innovations, masked (n,); innovation, noise: standard deviations of innovations and y. Samples before `first`
    do not count.
    """
    cdef int64_t n = y.shape[0], count = 0, k, end, start, length, begin = first
    cdef const unsigned char[:] is_masked = masked.view("u1")
    spans = empty((n // SHORTEST + 1, 3))
    cdef double[:, ::1] found = spans
    cdef double[::1] sums = zeros(n + 1), squares = zeros(n + 1), explained = zeros(n + 1), in_part = zeros(n + 1)
    cdef unsigned char[::1] is_leap = zeros(n + 1, "u1"), is_last = zeros(n + 1, "u1")
    cdef double height, deviate, at_most, constant, better, most, level
    cdef bint any_masked
    cdef Sums of_y
    if innovations.shape[0] != n or is_masked.shape[0] != n or first < 0:
        raise ValueError("y, innovations and marks do not fit each other")
    of_y.of_values, of_y.of_squares, of_y.variance = &sums[0], &squares[0], noise * noise
    with nogil:
        for k in range(n):
            height, deviate = y[k] - y[0], innovations[k] / innovation
            sums[k + 1] = sums[k] + height
            squares[k + 1] = squares[k] + height * height
            explained[k + 1] = explained[k] + deviate * deviate
            at_most = min(fabs(deviate), MOST_OF_A_HELD_ONE)
            in_part[k + 1] = in_part[k] + at_most * at_most
            is_leap[k] = k > 0 and fabs(innovations[k] - innovations[k - 1]) > JUMP * innovation
        for end in range(first + LONG, n):
            constant = _chi2_of_constant(&of_y, end - LONG, end)
            better = in_part[end] - in_part[end - LONG] - constant
            if constant < <double> LONG + FLAT_STRETCH and better > MUCH_BETTER:
                is_last[end - 1], is_last[end] = 0, 1
        for end in range(n):
            if not (is_leap[end] or is_last[end]):
                continue
            most, start = -INFINITY, end
            for length in range(SHORTEST, min(LONGEST, end - begin) + 1):
                better = explained[end] - explained[end - length] - _chi2_of_constant(&of_y, end - length, end)
                if better > most:
                    most, start = better, end - length
            any_masked = False
            for k in range(start, end):
                any_masked = any_masked or is_masked[k] != 0
            if most < BETTER or any_masked:
                continue
            level = (sums[end] - sums[start]) / <double> (end - start) + y[0]
            if is_last[end] or fabs(y[end] - level) >= JUMP * innovation:
                found[count, 0], found[count, 1], found[count, 2] = <double> start, <double> end, level
                count, begin = count + 1, end + RECOVERY
    return spans[:count]


def find_loud(const double[:] y, double noise, loud) -> int:
    """Mark in `loud` (n,) the samples of y in whose neighbourhood the noise is loud; returns their number."""
    cdef int64_t n = y.shape[0], before = LENGTH // 2, count = 0, k, first, end
    cdef unsigned char[::1] is_loud = loud.view("u1")
    cdef double[::1] sums = zeros(n + 1)
    cdef double variance = OF_DIFFERENCE * noise * noise, square, difference
    if is_loud.shape[0] != n:
        raise ValueError("as many marks as samples are wanted")
    with nogil:
        for k in range(n):
            square = 1.0
            if 2 <= k < n - 2:
                difference = y[k - 2] - 4.0 * y[k - 1] + 6.0 * y[k] - 4.0 * y[k + 1] + y[k + 2]
                square = min(difference * difference / variance, MOST_OF_ONE)
            sums[k + 1] = sums[k] + square
        for k in range(n):
            first, end = max(k - before, <int64_t> 0), min(k - before + LENGTH, n)
            is_loud[k] = sums[end] - sums[first] > LOUD * <double> (end - first)
            count += is_loud[k]
    return count


def find_pile(
    const double[:] y, const double[:] innovations, masked, double noise, int64_t first
) -> tuple[int, float, float, float]:
    """Samples at the highest level of y (n,): number, level, sums of squares of y and innovations about the means.

    Samples in `masked` (n,) and those before `first` do not count. A signal at rest has none.
    """
    cdef int64_t n = y.shape[0], samples = 0, k
    cdef const unsigned char[:] is_masked = masked.view("u1")
    cdef double[::1] means = empty(n)
    cdef double level = -INFINITY, least = INFINITY, lowest = 0.0, total, other = 0.0, constant = 0.0, changing = 0.0
    if innovations.shape[0] != n or is_masked.shape[0] != n:
        raise ValueError("y, innovations and marks do not fit each other")
    _smooth(y, means)
    for k in range(first, n):
        if not is_masked[k]:
            level, least = max(level, means[k]), min(least, means[k])
    if not level - least >= MOVING * noise:
        return 0, level, 0.0, 0.0
    for _ in range(REFINEMENTS):
        samples, total, other, lowest = 0, 0.0, 0.0, level - AT_LEVEL * noise
        for k in range(first, n):
            if means[k] > lowest and not is_masked[k]:
                samples, total, other = samples + 1, total + y[k], other + innovations[k]
        if samples < FEWEST:
            return samples, level, 0.0, 0.0
        level = total / <double> samples
    other /= <double> samples
    for k in range(first, n):
        if means[k] > lowest and not is_masked[k]:
            constant += (y[k] - level) * (y[k] - level)
            changing += (innovations[k] - other) * (innovations[k] - other)
    return samples, level, constant, changing


def smoothed(const double[:] y) -> NDArray[np.float64]:
    """Means (n,) over SMOOTHED neighbours, over fewer at both ends."""
    means = empty(y.shape[0])
    _smooth(y, means)
    return means


cdef void _smooth(const double[:] y, double[::1] means) noexcept nogil:
    cdef int64_t half = SMOOTHED // 2, n = y.shape[0], k, first, end, i
    cdef double total
    for k in range(n):
        first, end, total = max(k - half, <int64_t> 0), min(k + half + 1, n), 0.0
        for i in range(first, end):
            total += y[i]
        means[k] = total / <double> (end - first)
