"""Marginal likelihoods for Gaussian priors of a cost that is a parabola, in closed form."""

from libc.math cimport NAN, fabs, fmax, fmin, isnan, log, sqrt
from libc.stdint cimport int64_t

from numpy import array, empty, isfinite, outer, zeros
from numpy.linalg import LinAlgError

from observer_rt.core.learning.matrices cimport add_moved, invert, whole


def integrate_cost(cost, limits, prior) -> tuple[NDArray[np.float64], NDArray[np.float64], float, float, float]:
    """Integrate a `Linearisation` over a prior, a `Belief`: mean (m,) and covariance (m, m) after it, and three numbers.

    What the prior pays for its width, the least sum of cost and distance from it, and the least that is within
    `Limits` and reach of the slopes, all in nats. Raises numpy.linalg.LinAlgError when singular.
    """
    cdef const double[::1] centre = cost.theta, slope = cost.gradient, mean = prior.mean
    cdef const double[:, ::1] curve = cost.information, before
    cdef const double[::1] lowest = limits.lowest, highest = limits.highest, longest = limits.longest_step
    cdef int64_t m = centre.shape[0], i, j
    cdef double[:, ::1] after = zeros((whole(m), whole(m)))
    cdef double[::1] nothing = zeros(m), row = empty(whole(m)), gradient = empty(m), step = empty(m), away = empty(m)
    cdef double[::1] theta = array(mean)
    cdef double value = cost.value, width, least, reach = 1.0, total
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
        reach = fmax(reach, fabs(theta[i] - centre[i]) / longest[i])
    for i in range(m):
        step[i] = fmin(fmax(centre[i] + (theta[i] - centre[i]) / reach, lowest[i]), highest[i])
    total = _expected(value, slope, curve, centre, step, away, gradient)
    total += _expected(0.0, nothing, before, mean, step, away, gradient)
    total = fmin(total, value + _expected(0.0, nothing, before, mean, centre, away, gradient))
    return array(theta), array(after[:m, :m]), width, least, total


def weigh_scales(mean, covariance, weights, sizes, int64_t first, noises) -> NDArray[np.float64]:
    """Logarithms of how likely weights are to be 0 by a mean (m,) and a covariance (m, m), for every pair of noises (k,).

    (k, k): row i by noise i of the `first` weights, those of one flow, column j by noise j of the others. weights (w,):
    columns of theta; sizes (w,): of their priors, in whose units noises are variances. Raises numpy.linalg.LinAlgError
    when not positive definite.
    """
    cdef int64_t w = len(weights), i, j
    bordered, densities = zeros((w + 1, w + 1)), empty((len(noises), len(noises)))
    bordered[:w, :w] = covariance[weights[:, None], weights] / outer(sizes, sizes)
    bordered[w, :w] = mean[weights] / sizes
    cdef double[:, ::1] rows = bordered, one = empty((w + 1, w + 1)), both = empty((w + 1, w + 1))
    cdef double by_first
    for i in range(len(noises)):
        one[:] = rows
        by_first = _eliminate(one, 0, first, noises[i])
        for j in range(len(noises)):
            both[:] = one
            densities[i, j] = by_first + _eliminate(both, first, w, noises[j])
    if not isfinite(densities).all():
        raise LinAlgError("matrix is not positive definite")
    return densities


cdef double _eliminate(double[:, ::1] rows, int64_t first, int64_t last, double noise) noexcept nogil:
    """Cholesky's factor of columns first .. last of rows (w + 1, w + 1), in place, with a noise on their diagonal.

    Returns the logarithm of how likely the last row is by these columns; NaN: not positive definite.
    """
    cdef int64_t size = rows.shape[0], i, j, k
    cdef double density = 0.0, pivot, factor
    for k in range(first, last):
        rows[k, k] += noise
    for k in range(first, last):
        if not rows[k, k] > 0.0:
            return NAN
        pivot = sqrt(rows[k, k])
        for i in range(k, size):  # the row holds the column from here on, so that both are read along their lines
            rows[k, i] = rows[i, k] = rows[i, k] / pivot
        for i in range(k + 1, size):
            factor = rows[i, k]
            for j in range(k + 1, i + 1):
                rows[i, j] -= factor * rows[k, j]
        density -= log(pivot) + 0.5 * rows[size - 1, k] * rows[size - 1, k]
    return density


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
