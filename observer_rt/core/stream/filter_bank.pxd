# A bank of Kalman filters on what differs in a running injection, one for each explanation of it.
#
# Every filter has the same numbers, theta: what the nozzle passes more, in the present stretch of time and in those
# before, and how that grows from a stretch to the next, what the seat passes more, line friction and stiffness, lag and
# offset of the line-pressure sensor, delay of the lift. Theta is 0 where the injector is as believed. Filters differ in
# how far each number may go, and weigh by the likelihood of the innovations since the opening. Their mean is that of a
# mixture, as is their covariance.

from libc.math cimport exp, log
from libc.stdint cimport int64_t
from libc.string cimport memset

cdef enum:
    OF_SEAT = 0  # columns of theta
    OF_FRICTION = 1
    OF_STIFFNESS = 2
    OF_LAG = 3
    OF_OFFSET = 4
    OF_DELAY = 5  # of the lift; of the opening, where the needle answers commands
    FURTHER = 6  # numbers so far
    OF_CLOSING = 6  # delay of the closing, where the needle answers commands
    UNUSED = 7  # column of derivatives that nobody reads
    OF_SLOPE = 8  # of the nozzle's flow, from a stretch to the next; no derivative goes by it
    OF_NOZZLE = 9  # column of the oldest stretch of time
    STRETCHES = 7
    NUMBERS = 16
    EXPLANATIONS = 7


# How far the numbers may go by an explanation.
cdef struct Widths:
    double nozzle  # standard deviations at the opening: of the nozzle's flow, as a share
    double walk  # .. of its change from a stretch to the next, beyond the slope
    double slope  # .. of the slope
    double bend  # .. of the slope's change from a stretch to the next
    double[FURTHER] further  # .. of the other numbers, in the order of their columns
    double odds  # before the opening


cdef struct Filter:
    double[NUMBERS] mean
    double[NUMBERS][NUMBERS] covariance
    double log_weight
    double weight


cdef struct FilterBank:
    Filter[EXPLANATIONS] filters
    double[EXPLANATIONS] walks
    double[EXPLANATIONS] bends
    int64_t stretches  # of the nozzle's flow, the newest being the present one
    double[NUMBERS] mean  # of the mixture, when it was formed last
    double[NUMBERS][NUMBERS] covariance


cdef inline int64_t newest_of(const FilterBank* bank) noexcept nogil:
    """Column of what the nozzle passes more at present."""
    return OF_NOZZLE + bank.stretches - 1


cdef inline void begin_bank(FilterBank* bank, const Widths* explanations, double spread) noexcept nogil:
    """Begin the filters of all explanations (EXPLANATIONS,), with one stretch.

    spread: standard deviation of the nozzle's flow, as a share, and of its change in a stretch, that all have at least.
    """
    cdef int64_t i, k
    bank.stretches = 1
    for i in range(<int64_t> EXPLANATIONS):
        filter, explanation = &bank.filters[i], &explanations[i]
        memset(filter.mean, 0, sizeof(filter.mean))
        memset(filter.covariance, 0, sizeof(filter.covariance))
        filter.covariance[OF_NOZZLE][OF_NOZZLE] = max(explanation.nozzle, spread) ** 2
        for k in range(<int64_t> FURTHER):
            filter.covariance[k][k] = explanation.further[k] * explanation.further[k]
        filter.covariance[OF_SLOPE][OF_SLOPE] = explanation.slope * explanation.slope
        filter.log_weight, bank.walks[i] = log(explanation.odds), max(explanation.walk, spread)
        bank.bends[i] = explanation.bend


cdef inline void mix_filters(FilterBank* bank) noexcept nogil:
    """Weigh the filters by their likelihoods, and form mean and covariance of their mixture."""
    cdef double largest = bank.filters[0].log_weight, total = 0.0
    cdef double[NUMBERS] away
    cdef int64_t i, j, k
    for i in range(1, <int64_t> EXPLANATIONS):
        largest = max(largest, bank.filters[i].log_weight)
    for i in range(<int64_t> EXPLANATIONS):
        bank.filters[i].log_weight -= largest
        bank.filters[i].weight = exp(bank.filters[i].log_weight)
        total += bank.filters[i].weight
    memset(bank.mean, 0, sizeof(bank.mean))
    memset(bank.covariance, 0, sizeof(bank.covariance))
    for i in range(<int64_t> EXPLANATIONS):
        bank.filters[i].weight /= total
        for j in range(<int64_t> NUMBERS):
            bank.mean[j] += bank.filters[i].weight * bank.filters[i].mean[j]
    for i in range(<int64_t> EXPLANATIONS):
        filter = &bank.filters[i]
        for j in range(<int64_t> NUMBERS):
            away[j] = filter.mean[j] - bank.mean[j]
        for j in range(<int64_t> NUMBERS):
            for k in range(<int64_t> NUMBERS):
                bank.covariance[j][k] += filter.weight * (filter.covariance[j][k] + away[j] * away[k])


cdef inline void correct_filters(
    FilterBank* bank, double innovation, const double* slopes, double variance, double least_friction
) noexcept nogil:
    """Correct all filters by an innovation with theta = 0, whose noise has a variance; slopes (NUMBERS,): by theta.

    A friction below the least one is moved up to it, with all that goes along, and its filter weighs less.
    """
    cdef double[NUMBERS] by_error
    cdef double expected, error
    cdef int64_t i, j, k
    for i in range(<int64_t> EXPLANATIONS):
        filter = &bank.filters[i]
        expected, error = variance, innovation
        for j in range(<int64_t> NUMBERS):
            by_error[j] = 0.0
            for k in range(<int64_t> NUMBERS):
                by_error[j] += filter.covariance[j][k] * slopes[k]
        for j in range(<int64_t> NUMBERS):
            expected += slopes[j] * by_error[j]
            error += slopes[j] * filter.mean[j]
        filter.log_weight -= 0.5 * (log(expected) + error * error / expected)
        for j in range(<int64_t> NUMBERS):
            filter.mean[j] -= by_error[j] / expected * error
            for k in range(<int64_t> NUMBERS):
                filter.covariance[j][k] -= by_error[j] * by_error[k] / expected
        error, expected = filter.mean[OF_FRICTION] - least_friction, filter.covariance[OF_FRICTION][OF_FRICTION]
        if error < 0.0 < expected:
            filter.log_weight -= 0.5 * error * error / expected
            for j in range(<int64_t> NUMBERS):
                filter.mean[j] -= filter.covariance[j][OF_FRICTION] / expected * error


cdef inline void begin_stretch(FilterBank* bank) noexcept nogil:
    """Begin another stretch of the nozzle's flow, along its slope from the one before; there must be a free column."""
    cdef int64_t i, k, before = newest_of(bank), newest = before + 1
    for i in range(<int64_t> EXPLANATIONS):
        filter = &bank.filters[i]
        for k in range(<int64_t> NUMBERS):
            filter.covariance[newest][k] = filter.covariance[before][k] + filter.covariance[OF_SLOPE][k]
        for k in range(<int64_t> NUMBERS):
            filter.covariance[k][newest] = filter.covariance[newest][k]
        filter.covariance[newest][newest] = filter.covariance[newest][before] + filter.covariance[newest][OF_SLOPE]
        filter.mean[newest] = filter.mean[before] + filter.mean[OF_SLOPE]
        widen_flow(filter, newest, bank.walks[i], bank.bends[i])
    bank.stretches += 1


cdef inline void forget_stretch(FilterBank* bank) noexcept nogil:
    """Forget the oldest stretch; the columns of the others move down by one."""
    cdef int64_t i, j, k, last = newest_of(bank)
    for i in range(<int64_t> EXPLANATIONS):
        filter = &bank.filters[i]
        for j in range(<int64_t> OF_NOZZLE, last):
            filter.mean[j] = filter.mean[j + 1]
            for k in range(<int64_t> NUMBERS):
                filter.covariance[j][k] = filter.covariance[j + 1][k]
        for k in range(<int64_t> NUMBERS):
            for j in range(<int64_t> OF_NOZZLE, last):
                filter.covariance[k][j] = filter.covariance[k][j + 1]
            filter.covariance[k][last] = filter.covariance[last][k] = 0.0
        filter.mean[last] = 0.0
    bank.stretches -= 1


cdef inline void widen_flow(Filter* filter, int64_t column, double change, double bend) noexcept nogil:
    """Have the nozzle's flow in a column, and its slope, go further, by standard deviations."""
    filter.covariance[column][column] += change * change
    filter.covariance[OF_SLOPE][OF_SLOPE] += bend * bend


cdef inline void widen_past_flow(Filter* filter, int64_t stretches, double sigma) noexcept nogil:
    """Have the nozzle's flow go further, alike in all stretches, and the seat's, by a standard deviation."""
    cdef int64_t j, k
    for j in range(<int64_t> OF_NOZZLE, OF_NOZZLE + stretches):
        for k in range(<int64_t> OF_NOZZLE, OF_NOZZLE + stretches):
            filter.covariance[j][k] += sigma * sigma
    filter.covariance[OF_SEAT][OF_SEAT] += sigma * sigma


cdef inline void begin_anew(FilterBank* bank, int64_t column, double sigma) noexcept nogil:
    """Have a number be unknown anew in all filters: 0, with a standard deviation."""
    cdef int64_t i, k
    for i in range(<int64_t> EXPLANATIONS):
        filter = &bank.filters[i]
        filter.mean[column] = 0.0
        for k in range(<int64_t> NUMBERS):
            filter.covariance[column][k] = filter.covariance[k][column] = 0.0
        filter.covariance[column][column] = sigma * sigma


cdef inline double moved_by(const FilterBank* bank, const double* by) noexcept nogil:
    """What the mixture adds to a quantity with derivatives (NUMBERS,) by theta."""
    cdef double result = 0.0
    cdef int64_t j
    for j in range(<int64_t> NUMBERS):
        result += by[j] * bank.mean[j]
    return result


cdef inline double variance_by(const double* covariance, const double* by) noexcept nogil:
    """Variance of a quantity with derivatives (NUMBERS,) by a theta with a covariance (NUMBERS, NUMBERS)."""
    cdef double result = 0.0, along
    cdef int64_t i, j
    for j in range(<int64_t> NUMBERS):
        along = 0.0
        for i in range(<int64_t> NUMBERS):
            along += covariance[j * NUMBERS + i] * by[i]
        result += by[j] * along
    return max(result, 0.0)
