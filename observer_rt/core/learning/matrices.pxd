# Multiplies and inverts small matrices, in a fixed order of their sums.

from libc.math cimport INFINITY, NAN, log
from libc.stdint cimport int64_t

from observer_rt.core.model.records cimport WIDTH, Columns


cdef inline int64_t whole(int64_t columns) noexcept nogil:
    """Columns of the least whole number of vectors."""
    return (columns + WIDTH - 1) // WIDTH * WIDTH


cdef inline void propagate(
    double[:, ::1] transition, double[:, ::1] covariance, double[:, ::1] moved, double[:, ::1] scratch
) noexcept nogil:
    """transition @ covariance into `moved`, and that @ transition.T, symmetric, into `covariance`; all (m, m).

    The transition of a line of cells is nearly empty, and always on the left here.
    """
    cdef int64_t m = covariance.shape[0], i, j
    multiply(transition, covariance, moved)
    for i in range(m):
        for j in range(m):
            scratch[i, j] = moved[j, i]
    multiply(transition, scratch, covariance)


cdef inline void multiply(double[:, ::1] left, double[:, ::1] right, double[:, ::1] result) noexcept nogil:
    """left @ right into `result`, another array; zeros in `left` cost nothing."""
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


cdef inline void add_moved(
    double factor, const double[:, ::1] matrix, const double[::1] values, double[::1] result
) noexcept nogil:
    """Add a factor times a symmetric matrix @ values (m,) to the result (m,); rows of the matrix may be longer."""
    cdef int64_t m = values.shape[0], i, j
    cdef double scaled
    for j in range(m):
        scaled = factor * values[j]
        for i in range(m):
            result[i] += scaled * matrix[j, i]


cdef inline double invert(double[:, ::1] matrix, double[::1] row, int64_t m) noexcept nogil:
    """Inverse of a symmetric, positive definite matrix (m, m) in its place, whose rows are whole vectors, as `row` is.

    By sweeps of its upper half (Goodnight 1979, Am. Stat. 33, 149). Returns half the logarithm of its determinant,
    NaN: it is not positive definite, or not finite.
    """
    cdef int64_t parts = matrix.shape[1] // WIDTH, i, j, k
    cdef Columns* values = <Columns*> &matrix[0, 0]
    cdef const Columns* of_row = <const Columns*> &row[0]
    cdef double pivot, share, factor, half_log = 0.0
    row[m:] = 0.0
    for k in range(m):
        pivot = matrix[k, k]
        if not 0.0 < pivot < INFINITY:
            return NAN
        half_log += 0.5 * log(pivot)
        share = 1.0 / pivot
        for j in range(k):
            row[j] = matrix[j, k]
        for j in range(k, m):
            row[j] = matrix[k, j]
        for i in range(m):
            factor = share * row[i]
            if i != k:
                for j in range(i // WIDTH, parts):
                    values[i * parts + j] = values[i * parts + j] - factor * of_row[j]
            if i < k:
                matrix[i, k] = factor
            else:
                matrix[k, i] = factor
        matrix[k, k] = -share
    for i in range(m):
        for j in range(i, m):
            matrix[i, j] = matrix[j, i] = -matrix[i, j]
    return half_log
