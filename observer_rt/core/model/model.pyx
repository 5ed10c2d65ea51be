"""The model over a sample interval: flows, lines, phi, terms and the sensor, with derivatives.

One unit, for its parts call each other at every stage of every step; a file for each of them.
"""

from libc.math cimport (
    INFINITY, NAN, ceil, copysign, cos, exp, expm1, fabs, isfinite, isinf, isnan, log, pi, pow, rint, sin, sqrt, tanh
)
from libc.stdint cimport int64_t
from libc.string cimport memcpy, memset

from observer_rt.core.model.hydraulics cimport (
    NOZZLE_NUMBERS, Nozzle, NozzleSlopes, Sac, Seat, bent, bent_slope, normalised_area, nozzle_law, nozzle_law_slopes, sac_rate,
    sac_stiffness, seat_law, seat_law_slopes
)
from observer_rt.core.model.needle cimport BOUNCE_HEIGHT, CLOSING_DELAY, NEEDLE_NUMBERS, OPENING_DELAY
from observer_rt.core.model.network cimport *
from observer_rt.core.model.records cimport *
from observer_rt.core.model.sensor cimport (
    SENSOR_GAIN, SENSOR_NUMBERS, InputTerms, LaggedSlopes, Sensor, lagged, lagged_slopes, recorded, recorded_mean
)
from observer_rt.core.model.valve cimport (
    LIFT_OFF, STAYS_AT_STOP, STOP_EDGE, VALVE_NUMBERS, VALVE_TAIL, Servo, Stroke, Strokes, Valve, hold_valve, join_valve,
    stop_share, valve_begins, valve_edge, valve_ends
)

from observer_rt.core.records import enum_of, tuple_of

cdef double EMPTY_SAC = 1e-7  # of p_0: a shut, drained sac this close to chamber pressure is at it


cdef void empty_sac(double* x, Tangent* t) noexcept nogil:
    """Set p_S to chamber pressure, whatever the parameters."""
    x[SAC] = 0.0
    if t != NULL:
        memset(t.by + SAC * t.m, 0, t.m * sizeof(double))


cdef void empty_if_drained(double* x, double area_before, double area, Tangent* t) noexcept nogil:
    """Have a sac that has drained behind a shut needle be at exactly chamber pressure."""
    if area_before <= 0.0 and area <= 0.0 and fabs(x[SAC]) < EMPTY_SAC:
        empty_sac(x, t)


include "flows.pxi"
include "interval.pxi"
include "terms.pxi"
include "forcing.pxi"
include "predict.pxi"
include "python.pxi"
