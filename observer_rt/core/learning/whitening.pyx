"""Innovations made white, weighed robustly, and the sums by which their colour is found."""

from libc.math cimport fabs, sqrt
from libc.stdint cimport int64_t

from numpy import empty, zeros

from observer_rt.core.model.records cimport WIDTH, Columns

cdef int64_t LEVEL_SAMPLES = 20  # from whose mean the high pass starts: a start from 0 would ring for many samples
cdef double NO_HIGH_PASS = -1.0
cdef double HUBER = 4.0  # sigma beyond which an innovation counts linearly
cdef enum:
    ROWS = 4  # of slopes, added up before the sums are met again

globals().update(NO_HIGH_PASS=NO_HIGH_PASS, HUBER=HUBER, LEVEL_SAMPLES=LEVEL_SAMPLES)


def whiten(
    const double[:, :] values, masked, double forgetting, const double[::1] taps, double[:, ::1] result
) -> None:
    """Values (n, m) down the columns, see `noise.Whitening`; masked: (n,), or (0,).

    passed[k] = values[k] + theta passed[k - 1] - values[k - 1] is behind the high pass, of which
    expected[k] = -(a_1 passed[k - 1] + .. + a_p passed[k - p]) was to come; the result is passed - expected.
    theta: `forgetting`; a: `taps`. A masked sample is taken to have the value with which passed is as expected.
    """
    cdef int64_t n = values.shape[0], m = values.shape[1], parts = (m + WIDTH - 1) // WIDTH, i, j, k, count, unknown = 0
    cdef const unsigned char[:] is_out = masked.view("u1")
    cdef double[:, ::1] passed = zeros((n, parts * WIDTH)), lines = zeros((4, parts * WIDTH))
    cdef Columns* value = <Columns*> &lines[0, 0]
    cdef Columns* expected = <Columns*> &lines[1, 0]
    cdef Columns* last_value = <Columns*> &lines[2, 0]
    cdef Columns* zero = <Columns*> &lines[3, 0]
    cdef Columns* last_passed
    cdef Columns carried
    cdef bint is_masked
    if result.shape[0] != n or result.shape[1] != m or 0 < is_out.shape[0] < n:
        raise ValueError("values, marks and result do not fit each other")
    with nogil:
        if forgetting != NO_HIGH_PASS:
            count = min(LEVEL_SAMPLES, n - 1)
            for k in range(1, 1 + count):
                for j in range(m):
                    lines[2, j] += values[k, j] / <double> count
        # unknown: samples for which some tap still lies on an expected value
        result[:1] = 0.0
        for k in range(1, n):
            is_masked = is_out.shape[0] > 0 and is_out[k] != 0
            last_passed = <Columns*> &passed[k - 1, 0]
            for j in range(m):
                lines[0, j] = values[k, j]
            for j in range(parts):
                expected[j] = zero[j]
                for i in range(min(taps.shape[0], k - 1)):
                    expected[j] = expected[j] - taps[i] * last_passed[j - i * parts]
                if forgetting == NO_HIGH_PASS:
                    last_passed[parts + j] = expected[j] if is_masked else value[j]
                else:
                    carried = forgetting * last_passed[j] - last_value[j]
                    last_passed[parts + j] = expected[j] if is_masked else value[j] + carried
                    last_value[j] = last_passed[parts + j] - carried if is_masked else value[j]
            for j in range(m):
                result[k, j] = passed[k, j] - lines[1, j] if unknown == 0 and not is_masked else 0.0
            unknown = taps.shape[0] if is_masked else max(unknown - 1, 0)


def robust_cost(const double[:] e, int64_t first, double sigma, int64_t together=1) -> float:
    """Huber cost of e[first:] / sigma: half the square up to HUBER, linear beyond.

    together: so many samples count as one, their mean; fewer at the end do not count.
    """
    cdef double total = 0.0, spread = sigma * sqrt(<double> together), error, z
    cdef int64_t start = first, k
    with nogil:
        while start < e.shape[0] - together + 1:
            error = e[start]
            for k in range(start + 1, start + together):
                error += e[k]
            z = fabs(error) / spread
            total += 0.5 * z * z if z <= HUBER else HUBER * (z - 0.5 * HUBER)
            start += together
    return total


def weigh(
    const double[:] e,
    const double[:, ::1] slopes,
    int64_t first,
    double sigma,
    int64_t together,
    double[::1] gradient,
    double[:, ::1] information,
) -> None:
    """Gradient (m,) and Gauss-Newton information (m, m) of `robust_cost`; slopes (n, m)."""
    cdef int64_t m = gradient.shape[0], parts = (m + WIDTH - 1) // WIDTH, start = first, at = 0, i, j, k
    cdef double[:, ::1] rows = zeros((ROWS, parts * WIDTH)), total = zeros((m, parts * WIDTH))
    cdef double spread = sigma * sqrt(<double> together), error, z
    cdef double[ROWS] scale, factors
    cdef double* row
    cdef Columns* sums
    cdef const Columns* parts_of = <const Columns*> &rows[0, 0]
    if slopes.shape[0] != e.shape[0] or slopes.shape[1] != m:
        raise ValueError("slopes do not fit the errors")
    if information.shape[0] != m or information.shape[1] != m:
        raise ValueError("the information does not fit the gradient")
    gradient[:] = 0.0
    scale[:] = [0.0, 0.0, 0.0, 0.0]
    with nogil:
        while start < e.shape[0] - together + 1:
            row, error = &rows[at, 0], e[start]
            for j in range(m):
                row[j] = slopes[start, j]
            for k in range(start + 1, start + together):
                error += e[k]
                for j in range(m):
                    row[j] += slopes[k, j]
            z = error / spread
            scale[at] = (1.0 if fabs(z) <= HUBER else HUBER / fabs(z)) / (spread * spread)
            for i in range(m):
                gradient[i] += scale[at] * row[i] * error
            start, at = start + together, at + 1
            if at < ROWS and start < e.shape[0] - together + 1:
                continue
            for i in range(m):
                sums = <Columns*> &total[i, 0]
                for k in range(ROWS):
                    factors[k] = scale[k] * rows[k, i]
                for j in range(i // WIDTH + 1):  # what is beyond the diagonal is alike
                    sums[j] = sums[j] + (
                        factors[0] * parts_of[j] + factors[1] * parts_of[parts + j]
                        + factors[2] * parts_of[2 * parts + j] + factors[3] * parts_of[3 * parts + j]
                    )
            scale[0] = scale[1] = scale[2] = scale[3] = 0.0
            at = 0
        for i in range(m):
            for j in range(i + 1):
                information[i, j] = information[j, i] = total[i, j]


def high_passed(const double[:] values, double forgetting) -> NDArray[np.float64]:
    """Values (n,) behind the high pass of a `Whitening`."""
    passed = empty(values.shape[0])
    _pass(values, forgetting, passed)
    return passed


cdef void _pass(const double[:] values, double forgetting, double[::1] passed) noexcept nogil:
    cdef double now = 0.0, before = 0.0
    cdef int64_t k, level = min(LEVEL_SAMPLES, values.shape[0])
    if forgetting == NO_HIGH_PASS:
        passed[:] = values
        return
    for k in range(level):
        before += values[k] / <double> level
    for k in range(values.shape[0]):
        now = values[k] + (forgetting * now - before)
        before = values[k]
        passed[k] = now


def take_in_products(
    const double[:] values, double weight, const double[::1] choices, double[:, :, ::1] products, double[:, ::1] by_lag
) -> None:
    """Add what values (n,) times a weight have in common with those before them, behind each high pass (c,).

    products (c, p + 1, p + 1): sums of products of those i and j samples before each, but for the first p; by_lag
    (c, l): n - p mean products of each with that so many samples before.
    """
    cdef int64_t n = values.shape[0], lags = by_lag.shape[1], orders = products.shape[1] - 1, choice, k, lag, i, j
    cdef double[::1] passed = empty(n), sums = empty(lags)
    cdef double total
    if not (choices.shape[0] == products.shape[0] == by_lag.shape[0]) or products.shape[2] != orders + 1:
        raise ValueError("sums are wanted of every high pass")
    if n < max(lags, orders + 1):
        raise ValueError("fewer values than lags")
    with nogil:
        for choice in range(choices.shape[0]):
            _pass(values, choices[choice], passed)
            for k in range(n):
                passed[k] = weight * passed[k]
            sums[:] = 0.0
            for k in range(n):
                for lag in range(min(lags, k + 1)):
                    sums[lag] += passed[k] * passed[k - lag]
            for lag in range(lags):
                by_lag[choice, lag] += sums[lag] / <double> (n - lag) * <double> (n - orders)
            for i in range(orders + 1):
                for j in range(i, orders + 1):
                    lag = j - i
                    total = sums[lag]
                    for k in range(lag, orders - i):
                        total -= passed[k] * passed[k - lag]
                    for k in range(n - i, n):
                        total -= passed[k] * passed[k - lag]
                    products[choice, i, j] += total
                    if j > i:
                        products[choice, j, i] += total
