"""Marginal likelihoods for Gaussian priors of a cost that is a parabola, in closed form."""

from libc.math cimport fabs, fmax, fmin, log
from libc.stdint cimport int64_t

from numpy import empty, zeros

from observer_rt.core.learning.matrices cimport factorise, solve_forward, solve_back
from observer_rt.core.model.records cimport WIDTH, Columns


def integrate_cost(
    cost, limits, const double[:, ::1] means, const double[:, :, ::1] covariances, double[:, ::1] thetas,
    double[:, ::1] found
) -> bool:
    """Integrate a `Linearisation` over priors, k of m numbers; `thetas` (k, m): where it is likeliest after each.

    found (k, 3): what a prior pays for its width, the least sum of cost and distance from it, and the least that is
    within `Limits` and reach of the slopes, all in nats. False: something is not positive definite.
    """
    cdef const double[::1] centre = cost.theta, slope = cost.gradient
    cdef const double[:, ::1] curve = cost.information
    cdef const double[::1] lowest = limits.lowest, highest = limits.highest, longest = limits.longest_step
    cdef int64_t m = centre.shape[0], prior, i
    cdef int64_t width = (m + WIDTH - 1) // WIDTH * WIDTH
    cdef double[:, ::1] root = zeros((m, width)), inner = empty((m, width)), half = empty((m, width))
    cdef double[::1] gradient = empty(m), step = empty(m), away = empty(m), column = empty(m)
    cdef const double[::1] mean
    cdef double[::1] theta
    cdef double value = cost.value, least, reach, total
    cdef bint is_definite = True
    with nogil:
        for prior in range(means.shape[0]):
            mean, theta = means[prior], thetas[prior]
            root[:, :m] = covariances[prior]
            is_definite = factorise(root, column, m)
            _surround(curve, root, half, inner)
            is_definite = is_definite and factorise(inner, column, m)
            if not is_definite:
                break
            least = _expected(value, slope, curve, centre, mean, away, gradient)
            _apply(root, gradient, step, True)
            found[prior, 1] = least - solve_forward(inner, step, m)
            solve_back(inner, step, m)
            _apply(root, step, away, False)
            found[prior, 0], reach = 0.0, 1.0
            for i in range(m):
                found[prior, 0] += log(inner[i, i])
                theta[i] = mean[i] - away[i]
                reach = fmax(reach, fabs(theta[i] - centre[i]) / longest[i])
            for i in range(m):
                step[i] = fmin(fmax(centre[i] + (theta[i] - centre[i]) / reach, lowest[i]), highest[i])
            total = _expected(value, slope, curve, centre, step, away, gradient) + _distance(root, step, mean, away)
            found[prior, 2] = fmin(total, value + _distance(root, centre, mean, away))
    return is_definite


cdef void _surround(
    const double[:, ::1] matrix, double[:, ::1] root, double[:, ::1] half, double[:, ::1] result
) noexcept nogil:
    """1 + root' matrix root, its lower half; rows beside the matrix are whole vectors wide."""
    cdef int64_t m = matrix.shape[0], parts = root.shape[1] // WIDTH, i, j, k
    cdef Columns* of_root = <Columns*> &root[0, 0]
    cdef Columns* of_half = <Columns*> &half[0, 0]
    cdef Columns* of_result = <Columns*> &result[0, 0]
    cdef Columns total
    result[:, :] = 0.0
    for i in range(m):
        root[i, i + 1:] = 0.0
        result[i, i] = 1.0
    for j in range(parts):
        for i in range(m):
            total = matrix[i, j * WIDTH] * of_root[j * WIDTH * parts + j]
            for k in range(j * WIDTH + 1, m):
                total = total + matrix[i, k] * of_root[k * parts + j]
            of_half[i * parts + j] = total
        for i in range(j * WIDTH, m):
            total = of_result[i * parts + j]
            for k in range(i, m):
                total = total + root[k, i] * of_half[k * parts + j]
            of_result[i * parts + j] = total


cdef double _expected(
    double value, const double[::1] slope, const double[:, ::1] curve, const double[::1] centre, const double[::1] theta,
    double[::1] away, double[::1] gradient
) noexcept nogil:
    """The parabola at theta (m,), and its gradient there."""
    cdef int64_t m = theta.shape[0], i, j
    for i in range(m):
        away[i], gradient[i] = theta[i] - centre[i], slope[i]
    for i in range(m):
        for j in range(m):
            gradient[j] += away[i] * curve[i, j]
    for i in range(m):
        value += 0.5 * away[i] * (slope[i] + gradient[i])
    return value


cdef void _apply(const double[:, ::1] root, const double[::1] values, double[::1] result, bint transposed) noexcept nogil:
    cdef int64_t i, j
    result[:] = 0.0
    for i in range(values.shape[0]):
        for j in range(i + 1):
            if transposed:
                result[j] += root[i, j] * values[i]
            else:
                result[i] += root[i, j] * values[j]


cdef double _distance(
    const double[:, ::1] root, const double[::1] theta, const double[::1] mean, double[::1] away
) noexcept nogil:
    """Half the squared distance of theta (m,) from a prior's mean, in its standard deviations."""
    cdef int64_t i
    for i in range(theta.shape[0]):
        away[i] = theta[i] - mean[i]
    return solve_forward(root, away, theta.shape[0])
