# Whether events have shown the flow of the injection under way, for as long as it lasts.

from observer_rt.core.stream.state cimport OperatingPoint, Sample

cdef extern from *:
    """
    #define FULL_LIFT 0.9
    #define AREA_NOISE 0.02
    #define BELIEVED 0.8
    """
    const double FULL_LIFT  # share of the widest seat area, below which a needle falls
    const double AREA_NOISE  # A_0, by which the lift's noise may change an area
    const double BELIEVED  # weight of the explanation that the injector is as believed, from which on it is


cdef inline bint falls(const OperatingPoint* point, const Sample* row) noexcept nogil:
    """Whether the needle is on its way down."""
    return max(row.seat_area, 0.0) < FULL_LIFT * point.widest - AREA_NOISE  # it is below 0 beside an opening


cdef inline bint is_shown(const OperatingPoint* point, const Sample* row) noexcept nogil:
    """Whether events have shown the flow at a sample; a needle that falls sooner is at a lift of its own."""
    return point.in_learned_range and (point.up_until >= point.known_from or not falls(point, row))
