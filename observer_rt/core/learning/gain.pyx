"""The Riccati equation: gains and covariance of the identification system, sample by sample."""

from libc.math cimport NAN, fabs, sqrt
from libc.stdint cimport int64_t

from numpy import array, empty

from observer_rt.core.learning.matrices cimport propagate

# Largest difference of two mirrored elements of a covariance, as a share of the product of their standard deviations.
cdef double ASYMMETRIC = 1e-3


cdef double _product(const double[:, ::1] matrix, const double[::1] vector, int64_t row) noexcept nogil:
    """A row of a matrix times a vector."""
    cdef double total = 0.0
    cdef int64_t k
    for k in range(vector.shape[0]):
        total += matrix[row, k] * vector[k]
    return total


def solve_riccati(
    double[:, ::1] transition,
    const double[:, ::1] process,
    double measurement,
    const double[::1] shown,
    const double[::1] shown_before,
    const double[:, ::1] covariance,
    double[:, ::1] gains,
    bint mends,
) -> float:
    """Fill `gains` (samples, corrected), starting from `covariance` (m, m); returns the last innovation variance.

    The measurement is the sum of `shown` times the state and `shown_before` times the state a sample before, both
    (m,). States beyond the columns of `gains` are not corrected. Rounding errors make the covariance asymmetric, and
    they grow where a mean is measured with little noise: the result is NaN then. `mends` makes the covariance
    symmetric at every sample instead.
    """
    cdef int64_t m = covariance.shape[0], corrected = gains.shape[1], i, j, k
    cdef double[:, ::1] moved = empty((m, m)), scratch = empty((m, m)), now = array(covariance)
    cdef double[::1] column = empty(m), row = empty(m)
    cdef double variance = measurement, earlier, before
    if not (m == transition.shape[0] == transition.shape[1] == process.shape[0] == process.shape[1] == shown.shape[0]):
        raise ValueError("matrices do not fit each other")
    if shown_before.shape[0] != m or covariance.shape[1] != m or corrected > m:
        raise ValueError("matrices do not fit each other")
    with nogil:
        for k in range(gains.shape[0]):
            variance = measurement
            for i in range(m):
                column[i] = _product(now, shown_before, i)
            propagate(transition, now, moved, scratch)  # moved: of the state with the one before
            for i in range(m):
                earlier = column[i]
                for j in range(m):
                    earlier += shown[j] * moved[j, i]
                variance += shown_before[i] * earlier
            for i in range(m):
                before = _product(moved, shown_before, i)
                column[i] = row[i] = before
                for j in range(m):
                    now[i, j] += process[i, j]
            for i in range(m):
                column[i] += _product(now, shown, i)
                for j in range(m):
                    row[j] += shown[i] * now[i, j]
            for i in range(m):
                variance += shown[i] * column[i]
            for i in range(corrected):
                gains[k, i] = column[i] / variance
                for j in range(m):
                    now[i, j] -= gains[k, i] * row[j]
            for i in range(corrected, m):
                for j in range(corrected):
                    now[i, j] -= column[i] * gains[k, j]
            if mends:
                for i in range(m):
                    for j in range(i):
                        now[i, j] = now[j, i] = 0.5 * (now[i, j] + now[j, i])
        for i in range(m):
            for j in range(i):
                if not fabs(now[i, j] - now[j, i]) <= ASYMMETRIC * sqrt(fabs(now[i, i] * now[j, j])):
                    variance = NAN
    return variance
