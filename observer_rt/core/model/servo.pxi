# A servo injector: the flow that its pilot valve takes out of the line, and the fuel that its needle displaces.
#
# At the closed end, c G(t) sqrt(p_L / 100 MPa) + A_d dx/dt beside nozzle and seat: none of it is injected.


cdef inline double drained(double x_1, const Softness* line, double servo, double displaced, Inputs u) noexcept nogil:
    """Outflow of the line beside nozzle and seat, as a rate of pressure [1/s] in an incompressible one."""
    cdef double total = displaced * u.servo.speed
    if servo != 0.0 and u.servo.opening != 0.0:
        total += servo * u.servo.opening * servo_root(x_1, line)
    return total


cdef inline double servo_root(double x_1, const Softness* line) noexcept nogil:
    """Root of the absolute pressure, in units of p_0, which drives the control flow: its return is nearly empty."""
    return sqrt(max(x_1 + line.chamber_pressure, LOWEST_PRESSURE))


cdef inline double drained_slope(double x_1, const Softness* line, double servo, Inputs u) noexcept nogil:
    """Derivative of `drained` with respect to x_1."""
    if servo == 0.0 or u.servo.opening == 0.0 or x_1 + line.chamber_pressure <= LOWEST_PRESSURE:
        return 0.0
    return 0.5 * servo * u.servo.opening / servo_root(x_1, line)


cdef inline void add_valve(
    double* row, double factor, double x_1, const Softness* line, double servo, Inputs u, const ByTheta* theta
) noexcept nogil:
    """Add to a row the derivatives of `drained` by the numbers of the valve, times a factor."""
    cdef double flow = factor * servo * servo_root(x_1, line) if servo != 0.0 else 0.0
    cdef int64_t number
    for number in range(<int64_t> VALVE_NUMBERS):
        row[theta.valve[number]] += flow * theta.valve_sizes[number] * u.servo.by_number[number]


cdef inline Servo between_servos(const Servo* start, const Servo* end, double share) noexcept nogil:
    """The valve at a share (0..1) of the way between two samples; the needle's speed is that of the whole interval."""
    cdef Servo result = end[0]
    cdef int64_t number
    result.opening = start.opening + share * (end.opening - start.opening)
    for number in range(<int64_t> VALVE_NUMBERS):
        result.by_number[number] = start.by_number[number] + share * (end.by_number[number] - start.by_number[number])
    return result


cdef double needle_speed(double before, double area, double interval, const Seat* seat) noexcept nogil:
    """Mean speed of the needle [m/s] from one normalised area to the next."""
    if before <= 0.0 and area <= 0.0:
        return 0.0
    return (lift_at(area, seat) - lift_at(before, seat)) / interval


cdef double above_100_mpa(double rail, const Coefficients* c) noexcept nogil:
    """A normalised rail pressure over 100 MPa, absolute."""
    return max((rail * c.pressure_scale + c.chamber_pressure) / 1e8, 0.1)


cdef bint follow_lift(
    Strokes* s, int64_t position, double before, double area, double pressure, double interval, const Seat* seat
) noexcept nogil:
    """Follow the lift to a sample; whether it shows that the valve opened or shut, or did not shut.

    before, area: normalised, of the sample before and of this one; pressure: of the rail over 100 MPa.
    """
    cdef double lifted
    cdef bint is_shown = False
    if not s.is_lifted and area <= 0.0:
        return False
    lifted = normalised_area(LIFT_OFF, seat)
    if not s.is_lifted:
        if not before < lifted <= area:
            return False
        s.is_lifted, s.before = True, s.last
        s.last.lifts, s.last.falls = position - 1 + (lifted - before) / (area - before), INFINITY
        s.last.pressure, s.shown = pressure, s.last.lifts
        s.highest = s.level = s.mark = 0.0
        is_shown = True
    if area > s.highest:
        s.highest = area
        s.level = normalised_area(lift_at(area, seat) - LIFT_OFF, seat)
        if s.level >= s.mark:
            s.mark, s.since = area, position
    if area >= s.level:
        if not isinf(s.last.falls):
            is_shown, s.shown = True, s.last.falls
        s.high, s.last.falls = position, INFINITY
    elif s.high == position - 1:
        s.last.falls = s.shown = s.high + (before - s.level) / (before - area)
        is_shown = True
        if (position - s.since) * interval >= STAYS_AT_STOP:
            s.stop, s.stop_edge = s.level, STOP_EDGE * (s.highest - s.level)
    if area < lifted:
        s.is_lifted = False
    return is_shown


cdef void begin_strokes(Strokes* s) noexcept nogil:
    """Begin before any stroke of the needle."""
    memset(s, 0, sizeof(Strokes))
    s.last.lifts = s.last.falls = s.before.lifts = s.before.falls = -INFINITY
    s.last.pressure = s.before.pressure = 1.0


cdef double valve_at(
    int64_t position, double area, const Stroke* before, const Stroke* last, const Strokes* s, const Valve* valve,
    double interval
) noexcept nogil:
    """Opening of the valve at a sample, by the last two strokes or commands as known so far."""
    cdef double edge = valve_edge(interval)
    cdef Servo servo
    memset(&servo, 0, sizeof(Servo))
    join_valve(&servo, position, before, valve, interval, edge)
    join_valve(&servo, position, last, valve, interval, edge)
    if servo.opening > 0.0:
        hold_valve(&servo, stop_share(area, s), valve)
    return servo.opening


cdef servos_over(
    const double[:, :] inputs, const double[:, :] commands, int64_t samples, const Coefficients* c, double interval
):
    """`Servo` at the first samples of a window, in rows (samples, 6); inputs (n, 2), of which n may be more.

    commands (k, 2): as of `Window`, by which the valve goes where it does.
    """
    cdef double[:, ::1] result = zeros((samples, 2 + VALVE_NUMBERS))
    cdef double edge = valve_edge(interval), first, last
    cdef Strokes s
    cdef Stroke stroke
    cdef Servo* servo
    cdef int64_t k, n = inputs.shape[0]
    cdef bint was_lifted
    strokes = []
    if c.valve.commanded != 0.0:
        strokes = [dict(lifts=first, falls=last, pressure=1.0) for first, last in asarray(commands).tolist()]
    begin_strokes(&s)
    for k in range(1, n):
        was_lifted = s.is_lifted
        follow_lift(&s, k, inputs[k - 1, 1], inputs[k, 1], above_100_mpa(inputs[k, 0], c), interval, &c.seat)
        if c.valve.commanded == 0.0 and was_lifted and (not s.is_lifted or k == n - 1):
            strokes.append(s.last)
    for stroke in strokes:
        first = max(valve_begins(&stroke, &c.valve, interval) - 6.0 * edge, 0.0)
        last = min(valve_ends(&stroke, &c.valve, interval) + 6.0 * edge, samples - 1.0)
        for k in range(<int64_t> first, <int64_t> last + 1):
            join_valve(<Servo*> &result[k, 0], k, &stroke, &c.valve, interval, edge)
    for k in range(1, samples):
        servo = <Servo*> &result[k, 0]
        if servo.opening > 0.0:
            hold_valve(servo, stop_share(inputs[k, 1], &s), &c.valve)
        servo.speed = needle_speed(inputs[k - 1, 1], inputs[k, 1], interval, &c.seat)
    return result
