# The ramps of a needle lift whose samples are means.

from libc.math cimport sqrt


cdef inline double slope_of_means(double partial, double full, double slope, double tolerance) noexcept nogil:
    """Slope [m a sample] of a straight ramp from 0, of lifts [m] that are means.

    partial: over the period in which the ramp begins; full: over the next one; slope: from there on, which is the
    ramp's unless that ends too soon: then `partial` would be larger, by more than `tolerance`.
    """
    cdef double share, ratio
    if full <= 0.0:
        return max(slope, 0.0)
    if slope > 0.0:
        share = max(full / slope - 0.5, 0.0)  # of the period in which the ramp begins
        if 0.5 * slope * share * share <= partial + tolerance:
            return slope
    ratio = max(partial, 0.0) / full
    return full / (ratio + sqrt(ratio * ratio + ratio) + 0.5)
