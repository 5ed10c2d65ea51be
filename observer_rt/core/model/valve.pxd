# The pilot valve of a servo injector, which drains the control chamber, and so the line, while it is open: from before
# the needle leaves its seat to before it begins to fall. Both are taken from the seat area that the lift opens; or from
# the injector's command, where that is known.

from libc.math cimport INFINITY, isinf, log, pow, tanh
from libc.stdint cimport int64_t

cdef enum:
    VALVE_START, VALVE_END, VALVE_HOLD, VALVE_EXPONENT, VALVE_NUMBERS  # numbers of `Valve` that are learned

cdef extern from *:
    """
    #define LEAST_EDGE 0.6
    #define VALVE_TAIL 6.0
    #define LIFT_OFF 15e-6
    #define STOP_EDGE 0.3
    #define STAYS_AT_STOP 0.14e-3
    """
    const double LEAST_EDGE  # samples: shorter ones would alias
    const double VALVE_TAIL  # half widths from its middle, beyond which an edge has begun or is over
    const double LIFT_OFF  # m, of a needle that has left its seat, or, below it, its highest lift
    const double STOP_EDGE  # of `LIFT_OFF`, half width of the stop's edge
    const double STAYS_AT_STOP  # s, at least


cdef struct Valve:
    double start  # s before the needle leaves its seat, at 100 MPa
    double end  # s before it begins to fall
    double hold  # share by which the flow is larger while the needle is at its stop
    double exponent  # of both times with one over the rail pressure
    double edge  # s, half width of its opening and its shutting
    double commanded  # 1: start and end count back from those of the command, whatever the rail pressure; else 0


# An opening of the needle, or the command for it, in samples; `falls` is infinite as long as it is not known.
cdef struct Stroke:
    double lifts
    double falls
    double pressure  # of the rail at its beginning, over 100 MPa; of a command 1


# How the valve stands: G (1 + h s), and its derivatives by the numbers of `Valve`; speed: of the needle, m/s.
cdef struct Servo:
    double opening
    double[VALVE_NUMBERS] by_number
    double speed


# Strokes in normalised seat areas that come one by one.
cdef struct Strokes:
    bint is_lifted
    Stroke before
    Stroke last
    double edge  # `lifts` or `falls` that the last sample showed, or showed to be none
    double highest  # area of this one
    double falls_below  # area of a lift `LIFT_OFF` lower
    int64_t last_above  # position at which it was above that last
    double stays_at  # highest area when it last rose by more than `LIFT_OFF`
    int64_t stays_since  # position at which that was
    double stop  # `falls_below` of the last stroke that stayed above it for long, 0 where none did
    double stop_edge  # area


cdef inline double valve_edge(const Valve* valve, double interval) noexcept nogil:
    """Half width [samples] of the valve's opening and shutting."""
    return max(valve.edge / interval, LEAST_EDGE)


cdef inline double valve_begins(const Stroke* stroke, const Valve* valve, double interval) noexcept nogil:
    """Position from which on the valve opens for a stroke."""
    return stroke.lifts - valve.start * pow(stroke.pressure, -valve.exponent) / interval


cdef inline double valve_ends(const Stroke* stroke, const Valve* valve, double interval) noexcept nogil:
    """Position at which it shuts."""
    return stroke.falls - valve.end * pow(stroke.pressure, -valve.exponent) / interval


cdef inline void join_valve(
    Servo* servo, double position, const Stroke* stroke, const Valve* valve, double interval, double edge
) noexcept nogil:
    """Have the valve open for one more stroke: it is one valve, and open where any of them opens it."""
    cdef double first = valve_begins(stroke, valve, interval), last = valve_ends(stroke, valve, interval)
    cdef double earlier, logarithm, up, down, opening, other, by_start, by_end
    if position < first - VALVE_TAIL * edge or position > last + VALVE_TAIL * edge:
        return
    earlier, logarithm = pow(stroke.pressure, -valve.exponent), log(stroke.pressure)
    up, down = tanh((position - first) / edge), 1.0 if isinf(last) else tanh((last - position) / edge)
    opening, other = 0.25 * (1.0 + up) * (1.0 + down), 1.0 - servo.opening
    by_start = 0.25 * (1.0 - up * up) * (1.0 + down) * earlier / (edge * interval)
    by_end = -0.25 * (1.0 - down * down) * (1.0 + up) * earlier / (edge * interval)
    servo.by_number[VALVE_START] = servo.by_number[VALVE_START] * (1.0 - opening) + other * by_start
    servo.by_number[VALVE_END] = servo.by_number[VALVE_END] * (1.0 - opening) + other * by_end
    servo.by_number[VALVE_EXPONENT] = servo.by_number[VALVE_EXPONENT] * (1.0 - opening) - other * logarithm * (
        valve.start * by_start + valve.end * by_end
    )
    servo.opening += other * opening


cdef inline void hold_valve(Servo* servo, double at_stop, const Valve* valve) noexcept nogil:
    """Change the flow while the needle is at its stop, by a share 0..1 of the change."""
    cdef double factor = 1.0 + valve.hold * at_stop
    servo.by_number[VALVE_HOLD] = servo.opening * at_stop
    servo.opening *= factor
    servo.by_number[VALVE_START] *= factor
    servo.by_number[VALVE_END] *= factor
    servo.by_number[VALVE_EXPONENT] *= factor


cdef inline double stop_share(double area, const Strokes* strokes) noexcept nogil:
    """How far a needle that opens an area is at its stop, 0..1."""
    if strokes.stop <= 0.0 or area <= 0.0:
        return 0.0
    return 0.5 * (1.0 + tanh((area - strokes.stop) / strokes.stop_edge))
