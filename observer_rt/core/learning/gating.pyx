"""Best subset of scalars, by one Cholesky factor grown and cut for all subsets."""

from libc.math cimport INFINITY, sqrt
from libc.stdint cimport int64_t

from numpy import array, zeros


def search_subsets(
    const double[:, :] information,
    const double[::1] vector,
    const int64_t[::1] order,
    int64_t free,
    const double[::1] lowest,
    const double[::1] prices,
    double[::1] best,
) -> int:
    """The best subset as a bit mask over the gated columns, its parameters into `best` (m,); < 0: singular.

    order (m,): the columns, first the free ones, so many, then the gated ones. All subsets share the Cholesky
    factor's rows of the free ones; the likelihood is half the sum of squares of what is left of the vector by it.
    """
    cdef int64_t m = order.shape[0], subset
    cdef double[:, ::1] factor = zeros((m, m))
    cdef double[::1] left = zeros(m), solution = zeros(m)
    cdef int64_t[::1] columns = array(order)
    if not (information.shape[0] == information.shape[1] == vector.shape[0] == best.shape[0] == m):
        raise ValueError("information, vector and columns do not fit each other")
    if lowest.shape[0] != m - free or prices.shape[0] != m - free:
        raise ValueError("a limit and a price are wanted of every gated column")
    with nogil:
        subset = _search(information, vector, order, free, lowest, prices, factor, left, solution, columns, best)
    return subset


cdef int64_t _search(
    const double[:, :] information, const double[::1] vector, const int64_t[::1] order, int64_t free,
    const double[::1] lowest, const double[::1] prices, double[:, ::1] factor, double[::1] left,
    double[::1] solution, int64_t[::1] columns, double[::1] best
) noexcept nogil:
    """`search_subsets` in memory that is there: a factor (m, m), what is left of the vector, a solution, columns."""
    cdef int64_t m = order.shape[0], size, subset, best_subset = 0, place, i
    cdef double likelihood = 0.0, best_value = -INFINITY, value
    cdef bint admissible
    for size in range(free):
        if not _extend(factor, left, information, vector, columns, size):
            return -1
        likelihood += left[size] * left[size]
    for subset in range(<int64_t> 1 << (m - free)):
        size, value = free, likelihood
        for i in range(m - free):
            if subset >> i & 1:
                columns[size] = order[free + i]
                if not _extend(factor, left, information, vector, columns, size):
                    return -1
                value += left[size] * left[size] - prices[i]
                size += 1
        if not value > best_value:
            continue
        _solve_back(factor, left, solution, size, free)
        admissible, place = True, free
        for i in range(m - free):
            if subset >> i & 1:
                admissible = admissible and solution[place] >= lowest[i]
                place += 1
        if admissible:
            best_value, best_subset = value, subset
            _solve_back(factor, left, solution, size, 0)
            best[:] = 0.0
            for i in range(size):
                best[columns[i]] = solution[i]
    return best_subset


cdef bint _extend(
    double[:, ::1] factor, double[::1] left, const double[:, :] information, const double[::1] vector,
    const int64_t[::1] columns, int64_t size
) noexcept nogil:
    """One more row of a Cholesky factor, for the column in that place, and what it leaves of the vector.

    False: the matrix is singular.
    """
    cdef int64_t column = columns[size], i, j
    cdef double pivot = information[column, column], rest = vector[column], entry
    for i in range(size):
        entry = information[column, columns[i]]
        for j in range(i):
            entry -= factor[size, j] * factor[i, j]
        entry /= factor[i, i]
        factor[size, i] = entry
        pivot -= entry * entry
        rest -= entry * left[i]
    if not pivot > 0.0:
        return False
    factor[size, size] = sqrt(pivot)
    left[size] = rest / factor[size, size]
    return True


cdef void _solve_back(
    const double[:, ::1] factor, const double[::1] left, double[::1] solution, int64_t size, int64_t first
) noexcept nogil:
    """The parameters from place `first` on, of so many."""
    cdef int64_t i, j
    cdef double total
    for i in range(size - 1, first - 1, -1):
        total = left[i]
        for j in range(i + 1, size):
            total -= factor[j, i] * solution[j]
        solution[i] = total / factor[i, i]
