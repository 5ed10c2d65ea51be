# Multiplies small matrices, in a fixed order of their sums.

from libc.stdint cimport int64_t


cdef inline void propagate(
    double[:, ::1] transition, double[:, ::1] covariance, double[:, ::1] moved, double[:, ::1] scratch
) noexcept nogil:
    """transition @ covariance into `moved`, and that @ transition.T into `covariance`; all (m, m).

    The transition of a line of cells is nearly empty, and always on the left here.
    """
    cdef int64_t m = covariance.shape[0], i, j
    cdef double kept
    multiply(transition, covariance, moved)
    for i in range(m):
        for j in range(m):
            scratch[i, j] = moved[j, i]
    multiply(transition, scratch, covariance)
    for i in range(m):
        for j in range(i):
            kept = covariance[i, j]
            covariance[i, j] = covariance[j, i]
            covariance[j, i] = kept


cdef inline void multiply(double[:, ::1] left, double[:, ::1] right, double[:, ::1] result) noexcept nogil:
    """left @ right into `result`, another array; what is 0 in `left` costs nothing."""
    cdef int64_t i, j, k
    cdef double factor
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            result[i, j] = 0.0
        for k in range(right.shape[0]):
            factor = left[i, k]
            if factor != 0.0:
                for j in range(result.shape[1]):
                    result[i, j] += factor * right[k, j]
