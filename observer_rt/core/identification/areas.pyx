"""Normalised seat areas of a recorded lift, its ramps extended to where the needle leaves its seat."""

from libc.math cimport fabs
from libc.stdint cimport int64_t

from observer_rt.core.model.hydraulics cimport Seat, normalised_area
from observer_rt.core.stream.ramps cimport slope_of_means


cdef struct Ramp:
    double lift  # m, at its outermost sample
    double slope  # m a sample


cdef struct Foot:
    double hidden  # lift [m] up to which a sensor reads nothing
    double rounding  # samples before and after a needle leaves or meets its seat


def fill_areas(
    const double[:] lift, const int64_t[:, ::1] openings, const double[:, ::1] ramps, double factor, double shift,
    double rounding, bint means, double tolerance, seat, double[::1] area
) -> None:
    """Normalised seat areas (n,): of the true lift while open, 0 while shut.

    openings: (k, 2) first and last sample; ramps: (k, 4) lift and slope of the rising ramp, of the falling one.
    means: whether samples are means, the first and last one of an opening each over a part of a ramp only, which is
    extended to it; tolerance: of `slope_of_means` then.

    A sensor that reads too little misses the foot of a ramp, which is extended to where the needle leaves its seat.
    Beside it stands the negative area the ramp comes from, see `between` in `lump.pxi`.
    """
    cdef Seat of_seat = seat._asdict()
    cdef int64_t samples = area.shape[0], first, last, i, k
    cdef Ramp rising, falling
    cdef Foot foot
    foot.hidden, foot.rounding = max(shift, 0.0), rounding
    if lift.shape[0] != samples or openings.shape[1] != 2 or ramps.shape[1] != 4:
        raise ValueError("lift, openings and ramps do not fit each other")
    if ramps.shape[0] != openings.shape[0]:
        raise ValueError("two ramps of every opening are wanted")
    for i in range(openings.shape[0]):
        if not 0 <= openings[i, 0] <= openings[i, 1] < samples:
            raise ValueError("an opening outside of the lift")
    with nogil:
        for i in range(openings.shape[0]):
            first, last = openings[i, 0], openings[i, 1]
            for k in range(first, last + 1):
                area[k] = _area(factor * lift[k] + shift, &of_seat)
            rising.lift, rising.slope, falling.lift, falling.slope = ramps[i, 0], ramps[i, 1], ramps[i, 2], ramps[i, 3]
            if means:
                rising = _ramp_of_means(lift[first], lift[min(first + 1, samples - 1)], rising, tolerance)
                falling = _ramp_of_means(lift[last], lift[max(last - 1, <int64_t> 0)], falling, tolerance)
                area[first] = _area(factor * rising.lift + shift, &of_seat)
                area[last] = _area(factor * falling.lift + shift, &of_seat)
            rising.lift, rising.slope = factor * rising.lift + shift, factor * rising.slope
            falling.lift, falling.slope = factor * falling.lift + shift, factor * falling.slope
            _extend(area, first, -1, rising, foot, &of_seat)
            _extend(area, last, 1, falling, foot, &of_seat)


cdef Ramp _ramp_of_means(double partial, double full, Ramp ramp, double tolerance) noexcept nogil:
    """A ramp at its outermost sample as laid through it, where it is long enough for that."""
    cdef Ramp laid
    laid.slope = slope_of_means(partial, full, ramp.slope, tolerance)
    laid.lift = full - laid.slope
    return ramp if laid.slope == ramp.slope else laid


cdef void _extend(
    double[::1] area, int64_t k, int64_t direction, Ramp ramp, Foot foot, const Seat* seat
) noexcept nogil:
    """Extend a ramp from its outermost sample k until it is shut; a lift above what is hidden would have been recorded.

    What is hidden of the foot is taken to be rounded over twice the rounding: a needle has mass.
    """
    cdef double bend = min(ramp.slope * foot.rounding, 4.0 * foot.hidden)  # without a jump where nothing is hidden
    cdef double lift = ramp.lift, rounded
    while ramp.slope > 0.0 and 0 < k < area.shape[0] - 1 and area[k + direction] <= 0.0:
        k += direction
        lift = min(lift - ramp.slope, foot.hidden)
        rounded = lift
        if -bend < lift < bend:
            rounded = min((lift + bend) * (lift + bend) / (4.0 * bend), foot.hidden)
        elif lift <= -bend:
            rounded = lift + bend
        area[k] = _area(rounded, seat)
        if rounded <= 0.0:
            break


cdef double _area(double lift, const Seat* seat) noexcept nogil:
    """Normalised seat area, odd in the lift."""
    cdef double area = normalised_area(fabs(lift), seat)
    return area if lift >= 0.0 else -area
