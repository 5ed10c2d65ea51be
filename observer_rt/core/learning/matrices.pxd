# Multiplies and factorises small matrices, in a fixed order of their sums.

from libc.math cimport sqrt
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


cdef inline bint factorise(double[:, ::1] matrix, double[::1] column, int64_t m) noexcept nogil:
    """Cholesky's factor in place of the first m rows and columns, in their lower half; what is above is left.

    column (m,): scratch. False: the matrix is not positive definite.
    """
    cdef int64_t i, j, k
    cdef double factor
    for j in range(m):
        if not matrix[j, j] > 0.0:
            return False
        matrix[j, j] = sqrt(matrix[j, j])
        for i in range(j + 1, m):
            matrix[i, j] /= matrix[j, j]
            column[i] = matrix[i, j]
        for i in range(j + 1, m):
            factor = matrix[i, j]
            for k in range(j + 1, i + 1):
                matrix[i, k] -= factor * column[k]
    return True


cdef inline double solve_forward(const double[:, ::1] root, double[::1] values, int64_t m) noexcept nogil:
    """Half the sum of squares of what solves root x = values (m,), and takes their place."""
    cdef double total = 0.0
    cdef int64_t i, j
    for i in range(m):
        for j in range(i):
            values[i] -= root[i, j] * values[j]
        values[i] /= root[i, i]
        total += 0.5 * values[i] * values[i]
    return total


cdef inline void solve_back(const double[:, ::1] root, double[::1] values, int64_t m) noexcept nogil:
    """The same of root' x = values."""
    cdef int64_t i, j
    for i in range(m - 1, -1, -1):
        values[i] /= root[i, i]
        for j in range(i):
            values[j] -= root[i, j] * values[i]
