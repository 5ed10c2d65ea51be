# The line-pressure sensor: a first-order lag, its signal recorded late, its gain; an offset is added elsewhere. Its
# numbers, and those of the sensors of the inputs.

from libc.math cimport exp
from libc.stdint cimport int64_t

cdef enum:
    SENSOR_NUMBERS = 2  # that are learned of the sensor's law: its time constant [s], and gain over the rail sensor's
    SENSOR_GAIN = 1  # which of them that is


# Terms of true inputs: true = factor * measured + shift (the lift's only while the needle is open).
cdef struct InputTerms:
    double rail_factor
    double rail_shift  # Pa
    double lift_factor
    double lift_shift  # m
    double lift_lag  # s: time constant of a first-order sensor, undone before
    double rail_delay  # s by which it is recorded later than the other two, < 0: early


# The line-pressure sensor of the model in force, before the learned corrections. Sample k + late of what is recorded
# belongs to the time `fraction` (0 to 1) of a sample before that of sample k of the inputs.
cdef struct Sensor:
    double lag  # s
    double offset  # in units of p_0
    int64_t late  # samples, < 0: early
    double fraction


cdef struct LaggedSlopes:
    double by_indicated
    double by_start
    double by_end
    double[SENSOR_NUMBERS] by_number


cdef inline double recorded(double indicated_before, double indicated, double fraction) noexcept nogil:
    """A signal as recorded a `fraction` of a sample late, linear between samples; likewise its slopes."""
    return indicated - fraction * (indicated - indicated_before)


cdef inline double recorded_mean(
    double indicated_before, double indicated, double pressure_mean, double lag_share, double fraction
) noexcept nogil:
    """As `recorded`, of the mean over a sample interval instead of the value at its end; also of its slopes.

    pressure_mean: of the pressure; lag_share: lag over interval. The mean of a lagged signal is exactly that of the
    pressure less lag/T times its rise; a `fraction` of a sample earlier, as of the parabola through all three.
    """
    cdef double rise = indicated - indicated_before
    cdef double mean = pressure_mean - lag_share * rise
    cdef double bend = 3.0 * rise - 6.0 * (mean - indicated_before)
    return mean - fraction * rise + fraction * fraction * bend


cdef inline double lagged(
    double indicated, double pressure_start, double pressure_end, double interval, double lag
) noexcept nogil:
    """What a sensor with time constant `lag` [s] indicates an interval [s] later; exact for a linear pressure."""
    cdef double decay, ramp
    if lag < 1e-3 * interval:
        return pressure_end - lag / interval * (pressure_end - pressure_start)
    decay = exp(-interval / lag)
    ramp = 1.0 - lag / interval * (1.0 - decay)
    return decay * indicated + (1.0 - decay) * pressure_start + ramp * (pressure_end - pressure_start)


cdef inline LaggedSlopes lagged_slopes(
    double indicated, double pressure_start, double pressure_end, double interval, double lag
) noexcept nogil:
    """Derivatives of `lagged`."""
    cdef LaggedSlopes result
    cdef double rise = pressure_end - pressure_start, share, decay, ramp, decay_slope, ramp_slope
    result.by_number[SENSOR_GAIN] = 0.0  # of what is indicated; what is recorded of it grows with the gain
    if lag < 1e-3 * interval:
        share = lag / interval
        result.by_indicated, result.by_start, result.by_end = 0.0, share, 1.0 - share
        result.by_number[0] = -rise / interval
        return result
    decay = exp(-interval / lag)
    ramp = 1.0 - lag / interval * (1.0 - decay)
    decay_slope = decay * interval / (lag * lag)
    ramp_slope = -(1.0 - decay) / interval + lag / interval * decay_slope
    result.by_indicated, result.by_start, result.by_end = decay, 1.0 - decay - ramp, ramp
    result.by_number[0] = (indicated - pressure_start) * decay_slope + rise * ramp_slope
    return result
