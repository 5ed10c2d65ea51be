"""Inverse of a covariance for Python; the functions of small matrices are inline, in matrices.pxd."""

from libc.math cimport isnan
from libc.stdint cimport int64_t

from numpy import array, empty, zeros
from numpy.linalg import LinAlgError


def inverse_of(const double[:, :] matrix) -> tuple[NDArray[np.float64], float]:
    """Inverse of a matrix (m, m), and half its log determinant; numpy.linalg.LinAlgError if not positive definite."""
    cdef int64_t m = matrix.shape[0]
    cdef double[:, ::1] scratch = zeros((whole(m), whole(m)))
    cdef double[::1] row = empty(whole(m))
    cdef double half_log
    scratch[:m, :m] = matrix
    half_log = invert(scratch, row, m)
    if isnan(half_log):
        raise LinAlgError("matrix is not positive definite")
    return array(scratch[:m, :m]), half_log
