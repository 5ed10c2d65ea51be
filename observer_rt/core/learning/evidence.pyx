"""Marginal likelihoods for Gaussian priors of a cost that is a parabola, in closed form."""

from libc.math cimport fabs, fmax, fmin, isnan
from libc.stdint cimport int64_t

from numpy import empty, zeros
from numpy.linalg import LinAlgError

from observer_rt.core.learning.matrices cimport add_moved, invert, whole


def integrate_cost(cost, limits, priors) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Integrate a `Linearisation` over priors, k `Belief`s: where it is likeliest after each (k, m), and three numbers.

    (k, 3): what a prior pays for its width, the least sum of cost and distance from it, and the least that is within
    `Limits` and reach of the slopes, all in nats. Raises numpy.linalg.LinAlgError when singular.
    """
    cdef const double[::1] centre = cost.theta, slope = cost.gradient, mean
    cdef const double[:, ::1] curve = cost.information, before
    cdef const double[::1] lowest = limits.lowest, highest = limits.highest, longest = limits.longest_step
    cdef int64_t m = centre.shape[0], i, j, number
    cdef double[:, ::1] after = zeros((whole(m), whole(m)))
    cdef double[::1] nothing = zeros(m), row = empty(whole(m)), gradient = empty(m), step = empty(m), away = empty(m), theta
    likeliest, nats = empty((len(priors), m)), empty((len(priors), 3))
    cdef double[:, ::1] thetas = likeliest, found = nats
    cdef double value = cost.value, width, least, reach, total
    for number, prior in enumerate(priors):
        mean, theta = prior.mean, thetas[number]
        before, width = prior.inverse
        for i in range(m):
            for j in range(m):
                after[i, j] = before[i, j] + curve[i, j]
        width += invert(after, row, m)
        if isnan(width):
            raise LinAlgError("matrix is not positive definite")
        least = _expected(value, slope, curve, centre, mean, away, gradient)
        reach, theta[:] = 1.0, mean
        add_moved(-1.0, after, gradient, theta)
        for i in range(m):
            least += 0.5 * gradient[i] * (theta[i] - mean[i])
            reach = fmax(reach, fabs(theta[i] - centre[i]) / longest[i])
        for i in range(m):
            step[i] = fmin(fmax(centre[i] + (theta[i] - centre[i]) / reach, lowest[i]), highest[i])
        total = _expected(value, slope, curve, centre, step, away, gradient)
        total += _expected(0.0, nothing, before, mean, step, away, gradient)
        found[number, 0], found[number, 1] = width, least
        found[number, 2] = fmin(total, value + _expected(0.0, nothing, before, mean, centre, away, gradient))
    return likeliest, nats


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
