# A servo injector: the flow that its pilot valve takes out of the line, and the fuel that its needle displaces.
#
# At the closed end, G(t) (c sqrt(p_L / 100 MPa) + A_c dx_N/dt) + A_d dx_N/dt beside nozzle and seat, A_c for a needle that
# rises; none of it is injected. The opening G (1 + h s) is that of valve.pxd; strokes are followed here.


cdef inline double drained(
    double x_1, const Softness* line, const Drain* drain, Inputs u
) noexcept nogil:
    """Outflow of the line beside nozzle and seat, as a rate of pressure [1/s] in an incompressible one."""
    cdef double total = drain.displaced * u.servo.speed
    if drain.control_flow != 0.0 and u.servo.opening != 0.0:
        total += drain.control_flow * u.servo.opening * control_root(x_1, line)
        total += drain.expelled * u.servo.opening * max(u.servo.speed, 0.0)
    return total


cdef inline void drain_slopes(Drain* by, double factor, double x_1, const Softness* line, Inputs u) noexcept nogil:
    """Derivatives of `drained` by its coefficients, times a factor."""
    by.displaced, by.expelled = factor * u.servo.speed, factor * u.servo.opening * max(u.servo.speed, 0.0)
    by.control_flow = factor * u.servo.opening * control_root(x_1, line) if u.servo.opening != 0.0 else 0.0


cdef inline double control_root(double x_1, const Softness* line) noexcept nogil:
    """Root of the absolute pressure, in units of p_0, that drives the control flow: its return is nearly empty."""
    return sqrt(max(x_1 + line.chamber_pressure, LOWEST_PRESSURE))


cdef inline double drained_slope(double x_1, const Softness* line, const Drain* drain, Inputs u) noexcept nogil:
    """Derivative of `drained` with respect to x_1."""
    if drain.control_flow == 0.0 or u.servo.opening == 0.0 or x_1 + line.chamber_pressure <= LOWEST_PRESSURE:
        return 0.0
    return 0.5 * drain.control_flow * u.servo.opening / control_root(x_1, line)


cdef inline void add_valve(
    double* row, double factor, double x_1, const Softness* line, const Drain* drain, Inputs u, const ByTheta* theta
) noexcept nogil:
    """Add to a row the derivatives of `drained` by the numbers of the valve, times a factor."""
    cdef double flow
    cdef int64_t number
    if drain.control_flow == 0.0 or u.servo.opening == 0.0:
        return
    flow = factor * drain.control_flow * control_root(x_1, line) + factor * drain.expelled * max(u.servo.speed, 0.0)
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


cdef bint follow_stroke(
    Strokes* s, int64_t position, double before, double area, double pressure, double interval, const Seat* seat
) noexcept nogil:
    """Follow the strokes to a sample, by areas before and now; whether the valve opened, shut, or did not shut."""
    cdef double lifted
    cdef bint begins
    if not s.is_lifted and area <= 0.0:
        return False
    lifted = normalised_area(LIFT_OFF, seat)
    begins = not s.is_lifted
    if begins:
        if not before < lifted <= area:
            return False
        _begin_stroke(s, position - 1 + (lifted - before) / (area - before), pressure)
    if area > s.highest:
        _raise_summit(s, position, area, seat)
    if area < lifted:
        s.is_lifted = False
    return _follow_fall(s, position, before, area, interval) or begins


cdef inline void _begin_stroke(Strokes* s, double lifts, double pressure) noexcept nogil:
    """Begin a stroke that lifts at this position."""
    s.is_lifted, s.before = True, s.last
    s.last.lifts, s.last.falls, s.last.pressure = lifts, INFINITY, pressure
    s.edge = lifts
    s.highest = s.falls_below = s.stays_at = 0.0


cdef inline void _raise_summit(Strokes* s, int64_t position, double area, const Seat* seat) noexcept nogil:
    """Raise the highest area of the stroke, and with it that below which the needle falls."""
    s.highest = area
    s.falls_below = normalised_area(lift_at(area, seat) - LIFT_OFF, seat)
    if s.falls_below >= s.stays_at:
        s.stays_at, s.stays_since = area, position


cdef inline bint _follow_fall(Strokes* s, int64_t position, double before, double area, double interval) noexcept nogil:
    """Whether a sample shows that the needle begins to fall, or that a fall was none: it is up again."""
    cdef bint had_fallen
    if area >= s.falls_below:
        had_fallen = not isinf(s.last.falls)
        if had_fallen:
            s.edge = s.last.falls
        s.last_above, s.last.falls = position, INFINITY
        return had_fallen
    if s.last_above != position - 1:
        return False
    s.last.falls = s.edge = s.last_above + (before - s.falls_below) / (before - area)
    if (position - s.stays_since) * interval >= STAYS_AT_STOP:
        s.stop, s.stop_edge = s.falls_below, STOP_EDGE * (s.highest - s.falls_below)
    return True


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
    cdef double edge = valve_edge(valve, interval)
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
    """`Servo` at the first samples of a window, in rows (samples, 6), by inputs (n, 2) and commands (k, 2)."""
    cdef double[:, ::1] result = zeros((samples, 2 + VALVE_NUMBERS))
    cdef double edge = valve_edge(&c.valve, interval), first, last
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
        follow_stroke(&s, k, inputs[k - 1, 1], inputs[k, 1], above_100_mpa(inputs[k, 0], c), interval, &c.seat)
        if c.valve.commanded == 0.0 and was_lifted and (not s.is_lifted or k == n - 1):
            strokes.append(s.last)
    for stroke in strokes:
        first = max(valve_begins(&stroke, &c.valve, interval) - VALVE_TAIL * edge, 0.0)
        last = min(valve_ends(&stroke, &c.valve, interval) + VALVE_TAIL * edge, samples - 1.0)
        for k in range(<int64_t> first, <int64_t> last + 1):
            join_valve(<Servo*> &result[k, 0], k, &stroke, &c.valve, interval, edge)
    for k in range(1, samples):
        servo = <Servo*> &result[k, 0]
        if servo.opening > 0.0:
            hold_valve(servo, stop_share(inputs[k, 1], &s), &c.valve)
        servo.speed = needle_speed(inputs[k - 1, 1], inputs[k, 1], interval, &c.seat)
    return result
