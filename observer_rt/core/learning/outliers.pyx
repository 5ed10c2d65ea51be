"""Finds stretches of an event over which the line pressure is held, as at the end of a range, or loud."""

from libc.math cimport fabs, log, sqrt
from libc.stdint cimport int64_t

from numpy import empty, zeros

cdef double PRICE = 25.0  # nats of a stretch: where it begins and ends, its level, and one in 100 events
cdef int64_t SHORTEST = 8, LONGEST = 256  # samples of a held one
cdef double FLAT = 4.0  # standard deviations of a constant's chi2, up to which it is one
cdef int64_t LENGTH = 48  # samples over which the loudness is averaged
cdef double LOUD = 3.0  # times the variance at rest: that of white noise stays below 2 in 1e4 events
cdef double MOST_OF_ONE = 9.0  # times that variance, which one sample may add: a spike is no burst
cdef double OF_DIFFERENCE = 70.0  # variance of the fourth difference of white noise of unit variance

globals().update(PRICE=PRICE, LENGTH=LENGTH)


def find_held(const double[:] y, const double[:] deviates, masked, double noise, int64_t first) -> NDArray[np.float64]:
    """Stretches (k, 3) over which y stays while the model moves: start, end, nats of so many samples as a constant.

    y, deviates, masked (n,): line pressure, innovations in standard deviations, and marks; noise: standard deviation of
    y. Samples before `first`, and those masked, are in none. A constant is compared with the innovations about their
    mean, for a model that is off there is no held value. The best of all ways to part the event, by dynamic programming
    (Bellman 1961, Commun. ACM 4, 284).
    """
    cdef int64_t n = y.shape[0], count = 0, end, start
    cdef const unsigned char[:] is_masked = masked.view("u1")
    cdef double[:, ::1] of_y = zeros((2, n + 1)), of_model = zeros((2, n + 1))
    cdef double[::1] best = zeros(n + 1), constants = zeros(n + 1)
    cdef int64_t[::1] begins = zeros(n + 1, "i8")
    cdef double height, half, length, worth, longest = 0.5 * LONGEST + FLAT * sqrt(0.5 * LONGEST)
    if deviates.shape[0] != n or is_masked.shape[0] != n or first < 0:
        raise ValueError("y, innovations and marks do not fit each other")
    with nogil:
        for end in range(1, n + 1):
            height = (y[end - 1] - y[0]) / noise
            of_y[0, end], of_y[1, end] = of_y[0, end - 1] + height, of_y[1, end - 1] + height * height
            height = deviates[end - 1]
            of_model[0, end], of_model[1, end] = of_model[0, end - 1] + height, of_model[1, end - 1] + height * height
            best[end], begins[end] = best[end - 1], end
            for start in range(end - 1, max(first, end - LONGEST) - 1, -1):
                if is_masked[start]:
                    break
                length = <double> (end - start)
                half = _half_chi2(of_y, start, end)
                if half > longest:
                    break
                worth = best[start] + _half_chi2(of_model, start, end) - half - PRICE
                if length >= SHORTEST and half < 0.5 * length + FLAT * sqrt(0.5 * length) and worth > best[end]:
                    best[end], begins[end], constants[end] = worth, start, half
    spans = empty((n // SHORTEST + 1, 3))
    cdef double[:, ::1] found = spans
    end = n
    while end > 0:
        if begins[end] == end:
            end -= 1
            continue
        found[count, 0], found[count, 1], found[count, 2] = begins[end], end, constants[end] + PRICE
        count, end = count + 1, begins[end]
    return spans[:count]


cdef inline double _half_chi2(double[:, ::1] sums, int64_t start, int64_t end) noexcept nogil:
    """Half the sum of squares about the mean, by sums of values and of squares up to each sample."""
    cdef double total = sums[0, end] - sums[0, start]
    return 0.5 * (sums[1, end] - sums[1, start] - total * total / <double> (end - start))


def find_loud(const double[:] y, double noise) -> NDArray[np.float64]:
    """Stretches (k, 3) of y (n,) in which its noise is loud: start, end, nats of so many samples as such."""
    cdef int64_t n = y.shape[0], count = 0, k, first, end, start = 0
    cdef double[::1] sums = zeros(n + 1)
    cdef double variance = OF_DIFFERENCE * noise * noise, square, difference, length
    cdef bint was_loud = False, is_loud
    spans = empty((n // LENGTH + 2, 3))
    cdef double[:, ::1] found = spans
    for k in range(n):
        square = 1.0
        if 2 <= k < n - 2:
            difference = y[k - 2] - 4.0 * y[k - 1] + 6.0 * y[k] - 4.0 * y[k + 1] + y[k + 2]
            square = min(difference * difference / variance, MOST_OF_ONE)
        sums[k + 1] = sums[k] + square
    for k in range(n + 1):
        first, end = max(k - LENGTH // 2, <int64_t> 0), min(k - LENGTH // 2 + LENGTH, n)
        is_loud = k < n and sums[end] - sums[first] > LOUD * <double> (end - first)
        if is_loud and not was_loud:
            start = k
        if was_loud and not is_loud and count < spans.shape[0]:
            length = <double> (k - start)
            found[count, 0], found[count, 1] = start, k
            found[count, 2] = 0.5 * length * (1.0 + log((sums[k] - sums[start]) / length)) + PRICE
            count += 1
        was_loud = is_loud
    return spans[:count]
