# A needle that answers a command: when it leaves its seat, rises to its stop or turns before, is back, and bounces.

from libc.math cimport cos, exp, pi, pow, sin

cdef enum:
    # numbers that are learned; of speeds the natural logarithm
    OPENING_DELAY, OPENING_SPEED, CLOSING_DELAY, CLOSING_SPEED, BOUNCE_HEIGHT, BOUNCE_LENGTH, BOUNCE_REST
    NEEDLE_NUMBERS

cdef extern from *:
    """
    #define CORNER_ROUNDING 0.03e-3
    #define OPENING_EXPONENT 0.4
    #define CLOSING_EXPONENT 0.3
    #define NEEDLE_JITTER 30e-6
    #define SHORTEST_BOUNCE 20e-6
    """
    const double CORNER_ROUNDING  # s, window over whose mean the corners of a stroke are rounded
    const double OPENING_EXPONENT  # of the speeds with the rail pressure
    const double CLOSING_EXPONENT
    const double NEEDLE_JITTER  # s, standard deviation of a shot's delays from the learned ones
    const double SHORTEST_BOUNCE  # s


cdef struct NeedleLaw:
    double opening_delay  # s, from the start of energizing
    double opening_speed  # m/s at 100 MPa
    double closing_delay  # s, from its end
    double closing_speed
    double landing_bounce  # m, to which it lifts once more, by half a sine ..
    double bounce_length  # s, .. of this length
    double delay_exponent  # n: the opening delay goes as (rail pressure / 100 MPa)^-n
    double stop  # m


# One opening, before its corners are rounded.
cdef struct NeedleStroke:
    double opening  # s: it leaves its seat
    double top  # it reaches the stop, or, ballistic, turns
    double closing  # it leaves the stop
    double closed  # it is back on its seat
    double opening_speed  # m/s
    double closing_speed
    double bounce  # m
    double landed  # s: it has bounced
    double rebound  # s: it bounces, having rested


cdef inline bint answers(
    double start, double length, double pressure, const NeedleLaw* needle, const double* learned, NeedleStroke* s
) noexcept nogil:
    """Whether a needle lifts for a command [s], and its stroke; pressure over 100 MPa; learned (NEEDLE_NUMBERS,)."""
    s.opening = start + needle.opening_delay * pow(pressure, -needle.delay_exponent) + learned[OPENING_DELAY]
    s.closing = start + length + needle.closing_delay + learned[CLOSING_DELAY]
    s.opening_speed = needle.opening_speed * pow(pressure, OPENING_EXPONENT) * exp(learned[OPENING_SPEED])
    s.closing_speed = needle.closing_speed * pow(pressure, CLOSING_EXPONENT) * exp(learned[CLOSING_SPEED])
    s.top = min(s.closing, s.opening + needle.stop / s.opening_speed)
    s.closed = s.closing + s.opening_speed * (s.top - s.opening) / s.closing_speed
    s.bounce = max(needle.landing_bounce + learned[BOUNCE_HEIGHT], 0.0)
    s.rebound = s.closed + learned[BOUNCE_REST]
    s.landed = s.rebound + max(needle.bounce_length + learned[BOUNCE_LENGTH], SHORTEST_BOUNCE)
    return s.closing > s.opening


cdef inline double _mean_ramp(double time, double window) noexcept nogil:
    """Mean over a window of a ramp of slope 1 that begins at 0."""
    if time >= 0.5 * window:
        return time
    return 0.5 * (time + 0.5 * window) ** 2 / window if time > -0.5 * window else 0.0


cdef inline double _mean_step(double time, double window) noexcept nogil:
    """Its derivative."""
    return min(max(time / window + 0.5, 0.0), 1.0)


cdef inline double _mean_bounce(
    double time, double window, const NeedleStroke* s, double* by_time, double* by_length
) noexcept nogil:
    """Mean of a stroke's bounce over a window [s], its height 1, and its derivatives."""
    cdef double length = s.landed - s.rebound, turn = pi / length, landed = time - s.rebound
    cdef double first = turn * min(max(landed - 0.5 * window, 0.0), length)
    cdef double last = turn * min(max(landed + 0.5 * window, 0.0), length)
    by_time[0] = (sin(last) - sin(first)) / window
    by_length[0] = (cos(first) - cos(last) + first * sin(first) - last * sin(last)) / (pi * window)
    return (cos(first) - cos(last)) / (turn * window)


cdef inline double lands(const NeedleStroke* s) noexcept nogil:
    """Time [s] from which on it stays on its seat."""
    return s.landed if s.bounce > 0.0 else s.closed


cdef inline double rounded_lift(double time, double window, const NeedleStroke* s) noexcept nogil:
    """Lift [m] at a time [s], its corners rounded over a window [s]; exactly 0 outside the stroke."""
    cdef double rise, fall, lift, by_time, by_length
    if time <= s.opening - 0.5 * window or time >= lands(s) + 0.5 * window:
        return 0.0
    rise = _mean_ramp(time - s.opening, window) - _mean_ramp(time - s.top, window)
    fall = _mean_ramp(time - s.closing, window) - _mean_ramp(time - s.closed, window)
    lift = max(s.opening_speed * rise - s.closing_speed * fall, 0.0)
    return lift + s.bounce * _mean_bounce(time, window, s, &by_time, &by_length) if s.bounce > 0.0 else lift


cdef inline void lift_slopes(double time, double window, const NeedleStroke* s, double* by_number) noexcept nogil:
    """Derivatives of `rounded_lift` by the learned numbers."""
    cdef double rise = _mean_ramp(time - s.opening, window) - _mean_ramp(time - s.top, window)
    cdef double fall = _mean_ramp(time - s.closing, window) - _mean_ramp(time - s.closed, window)
    cdef double begins = _mean_step(time - s.opening, window), turns = _mean_step(time - s.top, window)
    cdef double falls = _mean_step(time - s.closing, window), ends = _mean_step(time - s.closed, window)
    cdef double up = s.opening_speed, down = s.closing_speed, peak = up * (s.top - s.opening)
    cdef double later, longer
    by_number[BOUNCE_HEIGHT] = _mean_bounce(time, window, s, &later, &longer)
    by_number[BOUNCE_LENGTH], by_number[BOUNCE_REST] = s.bounce * longer, -s.bounce * later
    ends += later * s.bounce / down  # what lands later bounces later
    by_number[CLOSING_SPEED] = ends * peak - down * fall
    if s.top < s.closing:  # it gets to its stop
        by_number[OPENING_DELAY] = -up * (begins - turns)
        by_number[OPENING_SPEED] = up * rise - turns * peak
        by_number[CLOSING_DELAY] = down * (falls - ends)
    else:
        by_number[OPENING_DELAY] = -up * (begins - ends)
        by_number[OPENING_SPEED] = up * rise - ends * peak
        by_number[CLOSING_DELAY] = up * (turns - ends) + down * (falls - ends)
