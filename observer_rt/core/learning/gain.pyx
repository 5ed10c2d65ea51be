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
    double[:, ::1] transition, const double[:, ::1] process, double measurement, const double[::1] shown,
    const double[::1] shown_before, const double[:, ::1] start, double[:, ::1] gains, bint symmetrises
) -> float:
    """Fill `gains` (samples, corrected) of a Kalman filter from the covariance `start` (m, m) on.

    They are wanted sample by sample, where solvers of the algebraic equation give the steady gain only. transition,
    process (m, m): the state over a sample, and its noise. The measurement is the sum of `shown` times the state and
    `shown_before` times the state a sample before, both (m,), with a noise of the variance `measurement`. States
    beyond the columns of `gains` are not corrected. Returns the last innovation's variance. Rounding errors make the
    covariance asymmetric, and grow where a mean is measured with little noise: then it is NaN, unless `symmetrises`
    has it made symmetric at every sample.
    """
    cdef int64_t m = start.shape[0], corrected = gains.shape[1], i, j, k
    cdef double[:, ::1] covariance = array(start), with_before = empty((m, m)), scratch = empty((m, m))
    cdef double[::1] column = empty(m), row = empty(m)  # covariance of state and measurement, as rounding leaves both
    cdef double variance = measurement, earlier, limit
    if not (m == transition.shape[0] == transition.shape[1] == process.shape[0] == process.shape[1] == shown.shape[0]):
        raise ValueError("matrices do not fit each other")
    if shown_before.shape[0] != m or start.shape[1] != m or corrected > m:
        raise ValueError("matrices do not fit each other")
    with nogil:
        for k in range(gains.shape[0]):
            variance = measurement
            for i in range(m):
                column[i] = _product(covariance, shown_before, i)
            propagate(transition, covariance, with_before, scratch)  # of the state with that a sample before
            for i in range(m):
                earlier = column[i]
                for j in range(m):
                    earlier += shown[j] * with_before[j, i]
                variance += shown_before[i] * earlier
            for i in range(m):
                column[i] = row[i] = _product(with_before, shown_before, i)
                for j in range(m):
                    covariance[i, j] += process[i, j]
            for i in range(m):
                column[i] += _product(covariance, shown, i)
                for j in range(m):
                    row[j] += shown[i] * covariance[i, j]
            for i in range(m):
                variance += shown[i] * column[i]
            for i in range(corrected):
                gains[k, i] = column[i] / variance
                for j in range(m):
                    covariance[i, j] -= gains[k, i] * row[j]
            for i in range(corrected, m):
                for j in range(corrected):
                    covariance[i, j] -= column[i] * gains[k, j]
            for i in range(m if symmetrises else 0):
                for j in range(i):
                    covariance[i, j] = covariance[j, i] = 0.5 * (covariance[i, j] + covariance[j, i])
        for i in range(m):
            for j in range(i):
                limit = ASYMMETRIC * sqrt(fabs(covariance[i, i] * covariance[j, j]))
                if not fabs(covariance[i, j] - covariance[j, i]) <= limit:
                    variance = NAN
    return variance
