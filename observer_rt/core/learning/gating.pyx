"""Best subset of scalars, of all there are."""

from libc.math cimport INFINITY
from libc.stdint cimport int64_t

from numpy import empty, zeros

from observer_rt.core.learning.matrices cimport factorise, solve_back, solve_forward


def search_subsets(
    const double[:, ::1] information,
    const double[::1] vector,
    const double[::1] lowest,
    const double[::1] prices,
    double[::1] best,
) -> int:
    """The best subset of the columns (m,) as a bit mask, its parameters into `best` (m,); < 0: singular.

    What a subset explains is the sum of squares of the vector as its Cholesky factor leaves it.
    """
    cdef int64_t m = vector.shape[0], size, subset, best_subset = 0, i, j
    cdef double[:, ::1] factor = empty((m, m))
    cdef double[::1] solution = empty(m), column = empty(m)
    cdef int64_t[::1] columns = zeros(m, "i8")
    cdef double best_value = -INFINITY, value
    cdef bint admissible
    if not (information.shape[0] == information.shape[1] == lowest.shape[0] == prices.shape[0] == best.shape[0] == m):
        raise ValueError("information, vector, limits and prices do not fit each other")
    with nogil:
        for subset in range(<int64_t> 1 << m):
            size, value = 0, 0.0
            for i in range(m):
                if subset >> i & 1:
                    columns[size], solution[size] = i, vector[i]
                    value -= prices[i]
                    for j in range(size + 1):
                        factor[size, j] = information[i, columns[j]]
                    size += 1
            if not factorise(factor, column, size):
                best_subset = -1
                break
            value += 2.0 * solve_forward(factor, solution, size)
            if not value > best_value:
                continue
            solve_back(factor, solution, size)
            admissible = True
            for i in range(size):
                admissible = admissible and solution[i] >= lowest[columns[i]]
            if admissible:
                best_value, best_subset = value, subset
                best[:] = 0.0
                for i in range(size):
                    best[columns[i]] = solution[i]
    return best_subset
