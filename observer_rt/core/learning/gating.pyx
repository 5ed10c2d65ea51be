"""The best subset of scalars, of all there are."""

from libc.math cimport isnan, sqrt
from libc.stdint cimport int64_t

from numpy import empty, zeros
from numpy.linalg import LinAlgError

from observer_rt.core.learning.matrices cimport invert, whole


def search_subsets(
    const double[::1] mean,
    const double[:, :] covariance,
    const int64_t[::1] columns,
    const double[::1] lowest,
    const double[::1] prices,
    double[::1] theta,
) -> int:
    """The best subset of the gated columns (g,) as a bit mask, and the estimate with it, theta (m,).

    What a subset explains is the sum of squares of what its Cholesky factor leaves of the information's vector. Raises
    numpy.linalg.LinAlgError when singular.
    """
    cdef int64_t g = columns.shape[0], m = mean.shape[0], size = 0, best_subset = 0, subset, column, i, j
    cdef double[:, ::1] information = zeros((whole(g), whole(g))), factor = empty((g, g))
    cdef double[::1] row = empty(whole(g)), vector = zeros(g), best = zeros(g), explained = empty(g)
    cdef double[::1] solution = empty(g), worth = zeros(g + 1)
    cdef int64_t[::1] used = zeros(g, "i8")
    cdef double best_worth = 0.0, square, pull
    cdef bint admissible
    if not covariance.shape[0] == covariance.shape[1] == theta.shape[0] == m or lowest.shape[0] != g or prices.shape[0] != g:
        raise ValueError("mean, covariance, limits and prices do not fit each other")
    for i in range(g):
        for j in range(g):
            information[i, j] = covariance[columns[i], columns[j]]
    if isnan(invert(information, row, g)):  # all others are estimated with them
        raise LinAlgError("covariance is not positive definite")
    for i in range(g):
        for j in range(g):
            vector[i] += information[i, j] * mean[columns[j]]
    # Subsets are counted up in binary, and the factor has the highest column first: the next number drops only the
    # rows of the low columns, and adds one.
    for subset in range(1, <int64_t> 1 << g):
        column = 0
        while not subset >> column & 1:
            column += 1
        size -= column
        used[size], explained[size], square = column, vector[column], information[column, column]
        for i in range(size):
            factor[size, i] = information[column, used[i]]
            for j in range(i):
                factor[size, i] -= factor[size, j] * factor[i, j]
            factor[size, i] /= factor[i, i]
            square -= factor[size, i] * factor[size, i]
            explained[size] -= factor[size, i] * explained[i]
        if not square > 0.0:
            raise LinAlgError("covariance is not positive definite")
        factor[size, size] = sqrt(square)
        explained[size] /= factor[size, size]
        size += 1
        worth[size] = worth[size - 1] + explained[size - 1] * explained[size - 1] - prices[column]
        if not worth[size] > best_worth:
            continue
        admissible = True
        for i in range(size - 1, -1, -1):
            solution[i] = explained[i]
            for j in range(i + 1, size):
                solution[i] -= factor[j, i] * solution[j]
            solution[i] /= factor[i, i]
            admissible = admissible and solution[i] >= lowest[used[i]]
        if admissible:
            best_worth, best_subset = worth[size], subset
            best[:] = 0.0
            for i in range(size):
                best[used[i]] = solution[i]
    theta[:] = mean
    for i in range(g):
        pull = 0.0
        for j in range(g):
            pull += information[i, j] * (best[j] - mean[columns[j]])
        for j in range(m):
            theta[j] += pull * covariance[columns[i], j]
    for i in range(g):
        theta[columns[i]] = best[i]
    return best_subset
