"""Marginal likelihoods for Gaussian priors of a cost that is a parabola, in closed form."""

from libc.math cimport INFINITY, NAN, fabs, fmax, fmin, isfinite, isnan, log
from libc.stdint cimport int64_t

from numpy import array, empty, zeros
from numpy.linalg import LinAlgError

from observer_rt.core.learning.matrices cimport add_moved, invert, whole
from observer_rt.core.model.records cimport WIDTH, Columns


def integrate_cost(
    cost, limits, prior, const int64_t[::1] columns, double beyond
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Integrate the cost of an `EventRun` over a prior, a `Belief` of some columns (m,) of theta; the others stay.

    Returns logarithm, mean (m,) and covariance (m, m) after it. The least sum of cost and distance from the prior is
    lower by `beyond` [nats] at most than it is within `Limits` and reach of the slopes. Raises
    numpy.linalg.LinAlgError when singular.
    """
    cdef const double[::1] of_theta = cost.theta, slopes = cost.gradient, mean = prior.mean
    cdef const double[:, ::1] information = cost.information, before
    cdef const double[::1] lowest = limits.lowest, highest = limits.highest, longest = limits.longest_step
    cdef int64_t m = columns.shape[0], i, j
    cdef double[:, ::1] after = zeros((whole(m), whole(m))), curve = empty((m, m))
    cdef double[::1] nothing = zeros(m), row = empty(whole(m)), gradient = empty(m), step = empty(m), away = empty(m)
    cdef double[::1] theta = array(mean), centre = empty(m), slope = empty(m)
    cdef double value = cost.value, width, least, reach = 1.0, total
    if mean.shape[0] != m or information.shape[0] != of_theta.shape[0]:
        raise ValueError("the columns do not fit prior and cost")
    for i in range(m):
        centre[i], slope[i] = of_theta[columns[i]], slopes[columns[i]]
        for j in range(m):
            curve[i, j] = information[columns[i], columns[j]]
    before, width = prior.inverse
    for i in range(m):
        for j in range(m):
            after[i, j] = before[i, j] + curve[i, j]
    width += invert(after, row, m)
    if isnan(width):
        raise LinAlgError("matrix is not positive definite")
    least = _expected(value, slope, curve, centre, mean, away, gradient)
    add_moved(-1.0, after, gradient, theta)
    for i in range(m):
        least += 0.5 * gradient[i] * (theta[i] - mean[i])
        reach = fmax(reach, fabs(theta[i] - centre[i]) / longest[columns[i]])
    for i in range(m):
        step[i] = fmin(fmax(centre[i] + (theta[i] - centre[i]) / reach, lowest[columns[i]]), highest[columns[i]])
    total = _expected(value, slope, curve, centre, step, away, gradient)
    total += _expected(0.0, nothing, before, mean, step, away, gradient)
    total = fmin(total, value + _expected(0.0, nothing, before, mean, centre, away, gradient))
    return -max(least, total - beyond) - width, array(theta), array(after[:m, :m])


def weigh_scales(
    const double[::1] mean, const double[:, ::1] covariance, const int64_t[::1] weights, const double[::1] sizes,
    const int64_t[::1] ends, const double[::1] noises, double[::1] logs
) -> NDArray[np.float64]:
    """Add to logs (k^g,) how likely weights are to be 0 by a mean (m,) and a covariance (m, m), for all noises of groups.

    ends (g + 1,): of the weights that always have the first noise, then of the groups, of which the last changes its
    noise fastest; noises (k,). weights (w,): columns of theta; sizes (w,): of their priors, in whose units noises are
    variances. Returns the mean (m,) once they were measured to be 0 with the likeliest noises. Raises
    numpy.linalg.LinAlgError when not positive definite.
    """
    cdef int64_t w = weights.shape[0], k = noises.shape[0], groups = ends.shape[0], leaves = logs.shape[0] // k, size = w + 1
    cdef int64_t i, j, group, begin, left, leaf, alike, lane, best = 0, numbers = size * size
    cdef double number
    for group in range(groups - 1):
        numbers += (size - ends[group]) ** 2
    cdef double[::1] tables = empty(numbers * WIDTH)
    cdef double[:, ::1] densities = zeros((groups + 1, WIDTH))
    cdef double[WIDTH] of_lanes
    # for each group a table of the weights that are left: upper half of their covariance, beside it their mean, in units
    # of the sizes; every number as often as a register has lanes, each of which has another noise of the first group
    cdef double* table = &tables[0]
    cdef double* last_table = table
    moved = array(mean)
    cdef double[::1] result = moved
    if not 0 < k <= WIDTH:
        raise ValueError("there are more noises than lanes")
    for i in range(w):
        for j in range(i, size):
            number = covariance[weights[i], weights[j]] / (sizes[i] * sizes[j]) if j < w else mean[weights[i]] / sizes[i]
            for lane in range(WIDTH):
                table[(i * size + j) * WIDTH + lane] = number
    with nogil:
        _eliminate(table, size, 0, ends[0], &noises[0], 0, &densities[0, 0], &densities[1, 0])
        for leaf in range(leaves):
            alike, begin, table = leaves, 0, &tables[0]
            for group in range(1, groups):
                last_table, left = table, size - begin
                table, begin = table + left * left * WIDTH, ends[group - 1]
                if group > 1:
                    alike //= k
                if leaf % alike == 0:  # else it has the noise that it had
                    _take_corner(last_table, left, table, size - begin)
                    _eliminate(
                        table, size - begin, 0, ends[group] - begin, &noises[0 if group == 1 else leaf // alike % k],
                        k - 1 if group == 1 else 0, &densities[group, 0], &densities[group + 1, 0]
                    )
            for lane in range(k):
                logs[lane * leaves + leaf] += densities[groups, lane]
    for i in range(logs.shape[0]):
        if not isfinite(logs[i]):
            raise LinAlgError("matrix is not positive definite")
        if logs[i] > logs[best]:
            best = i
    table = &tables[0]
    for group in range(groups - 1, 0, -1):
        for i in range(ends[group - 1], ends[group]):
            table[(i * size + i) * WIDTH] += noises[best % k]
        best //= k
    of_lanes[0] = 0.0
    _eliminate(table, size, ends[0], w, of_lanes, 0, &densities[0, 0], &densities[1, 0])
    for i in range(w - 1, -1, -1):
        for j in range(i + 1, w):
            table[(i * size + w) * WIDTH] -= table[(i * size + j) * WIDTH] * table[(j * size + w) * WIDTH]
        table[(i * size + w) * WIDTH] /= table[(i * size + i) * WIDTH]
        for j in range(result.shape[0]):
            result[j] -= table[(i * size + w) * WIDTH] / sizes[i] * covariance[weights[i], j]
    return moved


cdef void _take_corner(const double* before, int64_t before_size, double* lanes, int64_t size) noexcept nogil:
    """The upper half of the last rows and columns of a larger table."""
    cdef const Columns* larger = <const Columns*> before + (before_size - size) * (before_size + 1)
    cdef Columns* table = <Columns*> lanes
    cdef int64_t i, j
    for i in range(size - 1):
        for j in range(i, size):
            table[i * size + j] = larger[i * before_size + j]


cdef void _eliminate(
    double* lanes, int64_t size, int64_t first, int64_t last, const double* noises, int64_t last_noise, const double* before,
    double* densities
) noexcept nogil:
    """Eliminate columns first .. last of a table (size, size), in place, in each lane with its noise on their diagonal.

    noises: of the lanes, the last one in those left, too. Adds to the densities before: logarithms of how likely the
    last column is by these; NaN: not positive definite.
    """
    cdef Columns* values = <Columns*> lanes
    cdef double[WIDTH] of_pivots, of_squares, of_ones
    cdef Columns* pivots = <Columns*> of_pivots
    cdef Columns* squares = <Columns*> of_squares
    cdef const Columns* ones = <const Columns*> of_ones
    cdef Columns share, factor
    cdef int64_t i, j, k, lane
    for lane in range(WIDTH):
        of_pivots[lane], of_squares[lane], of_ones[lane] = 1.0, 0.0, 1.0
        for k in range(first, last):
            lanes[(k * size + k) * WIDTH + lane] += noises[min(lane, last_noise)]
    for k in range(first, last):
        for lane in range(WIDTH):
            if not lanes[(k * size + k) * WIDTH + lane] > 0.0:
                of_squares[lane] = NAN
        share = ones[0] / values[k * size + k]
        for i in range(k + 1, size - 1):
            factor = share * values[k * size + i]
            for j in range(i, size):
                values[i * size + j] = values[i * size + j] - factor * values[k * size + j]
        pivots[0] = pivots[0] * values[k * size + k]
        squares[0] = squares[0] + share * values[k * size + size - 1] * values[k * size + size - 1]
    for lane in range(WIDTH):
        densities[lane] = before[lane] - 0.5 * (log(of_pivots[lane]) + of_squares[lane])


cdef double _expected(
    double value, const double[::1] slope, const double[:, ::1] curve, const double[::1] centre, const double[::1] theta,
    double[::1] away, double[::1] gradient
) noexcept nogil:
    """A parabola at theta (m,), and its gradient there."""
    cdef int64_t m = theta.shape[0], i
    for i in range(m):
        away[i], gradient[i] = theta[i] - centre[i], slope[i]
    add_moved(1.0, curve, away, gradient)
    for i in range(m):
        value += 0.5 * away[i] * (slope[i] + gradient[i])
    return value
