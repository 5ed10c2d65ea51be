# Model over a sample interval, its terms and the sensor: declarations for loops of the core.

from libc.stdint cimport int64_t

from observer_rt.core.model.hydraulics cimport Seat
from observer_rt.core.model.records cimport (
    Coefficients, FlowSlopes, Forced, Forcing, Gradient, Inputs, Interval, Knot, Network, Tangent
)
from observer_rt.core.model.valve cimport Stroke, Strokes, Valve


cdef class Model:
    cdef Coefficients coefficients


cdef class Weights:
    cdef Network network
    cdef tuple lent


cdef class Terms:
    cdef Forcing forcing
    cdef tuple lent


cdef class Carried:
    cdef Tangent tangent
    cdef tuple lent


cdef void rates_at(const double* x, Inputs u, const Coefficients* c, const Network* network, double* rate) noexcept nogil
cdef double injection_rate(const double* x, Inputs u, const Coefficients* c, const Network* network) noexcept nogil
cdef double rate_and_phi(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* phi
) noexcept nogil
cdef bint rate_slopes(
    const double* x, const Forced* forced, Tangent* t, int64_t m, double scale, FlowSlopes* flows, double* by_state,
    double* by_theta
) noexcept nogil
cdef void advance_over(
    double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network, Tangent* t
) noexcept nogil
cdef void fine_step(
    double* x, Inputs start, Inputs middle, Inputs end, double step, const Coefficients* c, const Network* network
) noexcept nogil
cdef void rest_line(double* x, double pressure, const Coefficients* c) noexcept nogil
cdef double needle_speed(double before, double area, double interval, const Seat* seat) noexcept nogil
cdef double above_100_mpa(double rail, const Coefficients* c) noexcept nogil
cdef bint follow_stroke(
    Strokes* s, int64_t position, double before, double area, double pressure, double interval, const Seat* seat
) noexcept nogil
cdef void begin_strokes(Strokes* s) noexcept nogil
cdef double valve_at(
    int64_t position, double area, const Stroke* before, const Stroke* last, const Strokes* s, const Valve* valve,
    double interval
) noexcept nogil
cdef servos_over(
    const double[:, :] inputs, const double[:, :] commands, int64_t samples, const Coefficients* c, double interval
)
cdef void empty_sac(double* x, Tangent* t) noexcept nogil
cdef void empty_if_drained(double* x, double area_before, double area, Tangent* t) noexcept nogil
cdef void begin_forcing(Forcing* f, double time, double injections) noexcept nogil
cdef void under_terms(
    const double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network, Forcing* f,
    Forced* forced
) noexcept nogil
cdef double rate_after(const double* x, const Forced* forced) noexcept nogil
cdef double shown_under_terms(double shown, const Forced* forced, Forcing* f) noexcept nogil
cdef bint is_shut_under_terms(const Forcing* f) noexcept nogil
cdef double trusted_under_terms(double innovation, double interval, Forcing* f) noexcept nogil
cdef double predict(
    double* x, double* indicated, const Forced* forced, double late, const double* sensor, Gradient* gradient
) noexcept nogil
cdef void correct(double* x, double* indicated, double innovation, const double* gain, int64_t n, Gradient* g) noexcept nogil
