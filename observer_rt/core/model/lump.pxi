# The feed line as one lump, (19)-(20): a flow with inertia and friction into one volume, by classical Runge-Kutta.

cdef double LOWEST_PRESSURE = 0.01  # of p_0, at which entrained air is taken to soften the line no further
cdef double LOWEST_STIFFNESS = 0.05  # of K_L, below which a pressure-dependent bulk modulus does not fall
cdef double LINE_STEP = 0.1  # radians of the line's fastest motion an RK4 step may span while nothing flows


cdef inline double _fuel_stiffness(double x_1, const Softness* line) noexcept nogil:
    """Stiffness of the fuel without air, over that of a1."""
    if line.stiffness_slope == 0.0:
        return 1.0
    return max(bent(x_1 - line.stiffness_pressure, line.stiffness_slope, line.stiffness_bend), LOWEST_STIFFNESS)


cdef inline double stiffness(double x_1, const Softness* line) noexcept nogil:
    """K_eff/K_L at the normalised pressure x_1: 1/K_eff = 1/K(p_L) + g/p_L."""
    cdef double fuel = _fuel_stiffness(x_1, line), pressure
    if line.air == 0.0:
        return fuel
    pressure = max(x_1 + line.chamber_pressure, LOWEST_PRESSURE)
    return fuel * (pressure / (pressure + fuel * line.air))


cdef inline double stiffness_slopes(double x_1, const Softness* line, double* by_air, double* by_slope) noexcept nogil:
    """Derivative of `stiffness` with respect to x_1, and those to `air` and to `stiffness_slope`."""
    cdef double fuel = _fuel_stiffness(x_1, line)
    cdef double absolute = x_1 + line.chamber_pressure
    cdef double pressure = max(absolute, LOWEST_PRESSURE)
    cdef double sum_ = pressure + fuel * line.air
    cdef double square = sum_ * sum_
    cdef double by_fuel = pressure * pressure / square if fuel > LOWEST_STIFFNESS else 0.0
    cdef double by_pressure = fuel * fuel * line.air / square if absolute > LOWEST_PRESSURE else 0.0
    by_air[0] = -fuel * fuel * pressure / square
    by_slope[0] = by_fuel * (x_1 - line.stiffness_pressure)
    return by_pressure + by_fuel * bent_slope(x_1 - line.stiffness_pressure, line.stiffness_slope, line.stiffness_bend)


cdef inline void lump_rates(
    const double* x, Inputs u, double q_h, double q_s, const Coefficients* c, double* rate, int n
) noexcept nogil:
    """p_L' of (20), Q_L' of (19) and p_S' of (22), normalised [1/s]; of a mean, p_L, whose integral is the last state."""
    line = &c.line.lump
    rate[0] = stiffness(x[0], &line.softness) * (
        line.a1 * (x[1] - line.outflow) - line.a2_nozzle * q_h - line.a2_seat * q_s - line.leak * x[0]
        - drained(x[0], &line.softness, &line.drain, u)
    )
    rate[1] = line.a3 * (u.rail - line.loss - x[0]) - line.a4 * x[1] * fabs(x[1])
    rate[SAC] = sac_stiffness(x[SAC], &c.sac) * sac_rate(q_h, q_s, &c.sac)
    if n == MEAN_STATES:
        rate[3] = x[0]


cdef inline void lump_slopes(
    const double* x, Inputs u, double q_h, double q_s, const LumpLine* line, Tangent* t, double* by_state,
    double* by_flow, int n
) noexcept nogil:
    """Derivatives of `lump_rates`; of the coefficients, of those that anything changes."""
    cdef double by_air, by_slope
    cdef double soft = stiffness(x[0], &line.softness)
    cdef double by_pressure = stiffness_slopes(x[0], &line.softness, &by_air, &by_slope)
    cdef double inflow = line.a1 * (x[1] - line.outflow) - line.a2_nozzle * q_h - line.a2_seat * q_s - line.leak * x[0]
    of_pressure, of_flow = <LumpLine*> t.by_coefficient, <LumpLine*> (t.by_coefficient + t.size)
    inflow = inflow - drained(x[0], &line.softness, &line.drain, u)
    by_state[0] = by_pressure * inflow - soft * (line.leak + drained_slope(x[0], &line.softness, &line.drain, u))
    by_state[1] = soft * line.a1
    by_state[WIDTH], by_state[WIDTH + 1] = -line.a3, -2.0 * line.a4 * fabs(x[1])
    by_flow[0], by_flow[1] = -soft * line.a2_nozzle, -soft * line.a2_seat
    of_pressure.a1 = soft * (x[1] - line.outflow)
    of_pressure.a2_nozzle = -soft * q_h
    of_pressure.a2_seat = -soft * q_s
    of_pressure.leak = -soft * x[0]
    drain_slopes(&of_pressure.drain, -soft, x[0], &line.softness, u)
    of_pressure.softness.air = by_air * inflow
    of_pressure.softness.stiffness_slope = by_slope * inflow
    of_flow.a3 = u.rail - line.loss - x[0]
    of_flow.a4 = -x[1] * fabs(x[1])
    if n == MEAN_STATES:
        by_state[3 * WIDTH] = 1.0


cdef inline void right_hand_side(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* rate, int n
) noexcept nogil:
    """x' = f(x, u) + phi(x, u) of (25)-(26) [1/s].

    x = [p_L, Q_L, p_S, ..], u = [p_R, A_S], normalised by (24). phi = G(x, u) N with G the nozzle and seat flows: the
    network changes q_H and q_S by the factors 1 + N_H and 1 + N_S.
    """
    cdef double q_h = 0.0, q_s = 0.0
    if not is_at_rest(x, u):
        flows_with_phi(x, u, c, network, &q_h, &q_s)
    lump_rates(x, u, q_h, q_s, c, rate, n)


cdef inline void tangent_rates(
    const double* x, Inputs u, const Coefficients* c, const Network* network, Tangent* t, int stage, double* rate, int n
) noexcept nogil:
    """x' = f + phi and its derivatives [1/s] at a stage of a step: by the state, by flows and by the tangent's numbers.

    Of those by the numbers, which are 0 at first, only what may differ from 0 is written.
    """
    cdef FlowSlopes flows
    cdef double* by_state = t.by_state + stage * n * WIDTH
    cdef double* by_number = t.by_number + stage * n * t.m
    cdef double* by_flow = t.by_flow + stage * n * 2
    cdef double* of_flows = t.of_flows + stage * 2 * t.m
    cdef double of_pressure = 0.0, of_flow = 0.0, soft = sac_stiffness(x[SAC], &c.sac)
    cdef bint at_rest = is_at_rest(x, u)
    cdef int64_t row, i, k
    theta = &t.theta
    memset(by_state, 0, n * WIDTH * sizeof(double))
    if at_rest:
        flows.q_h = flows.q_s = 0.0
    else:
        flow_slopes(x, &u, c, network, &flows)
        flow_slopes_by_theta(u, &flows, t, of_flows, of_flows + t.m)
    lump_slopes(x, u, flows.q_h, flows.q_s, &c.line.lump, t, by_state, by_flow, n)
    if at_rest:
        memset(by_flow, 0, 2 * n * sizeof(double))
    else:
        by_flow[2 * SAC], by_flow[2 * SAC + 1] = -soft * c.sac.a6, soft * c.sac.a5
        by_state[SAC * WIDTH + SAC] = sac_rate(flows.q_h, flows.q_s, &c.sac) * bent_slope(
            x[SAC], c.sac.stiffness_slope, c.sac.stiffness_bend
        )
        for row in range(0, 3, 2):  # p_L and p_S
            for i in range(3):
                by_state[row * WIDTH + i] += by_flow[2 * row] * flows.h_x[i] + by_flow[2 * row + 1] * flows.s_x[i]
    for k in range(theta.pairs):  # each acts on the flow or on the pressure, nothing of the line on the sac
        of_pressure += t.by_coefficient[theta.coefficients[k]] * theta.slopes[k]
        of_flow += t.by_coefficient[t.size + theta.coefficients[k]] * theta.slopes[k]
        if k + 1 == theta.pairs or theta.columns[k + 1] != theta.columns[k]:
            by_number[theta.columns[k]], by_number[t.m + theta.columns[k]] = of_pressure, of_flow
            of_pressure = of_flow = 0.0
    for i in range(<int64_t> VALVE_NUMBERS):
        by_number[theta.valve[i]] = 0.0
    of_pressure = -stiffness(x[0], &c.line.lump.softness)
    add_valve(by_number, of_pressure, x[0], &c.line.lump.softness, &c.line.lump.drain, u, theta)
    lump_rates(x, u, flows.q_h, flows.q_s, c, rate, n)


cdef inline void _rates(
    const double* x, Inputs u, const Coefficients* c, const Network* network, Tangent* t, int stage, double* rate, int n
) noexcept nogil:
    if t == NULL:
        right_hand_side(x, u, c, network, rate, n)
    else:
        tangent_rates(x, u, c, network, t, stage, rate, n)


cdef inline void _runge_kutta_step(
    double* x, Inputs start, Inputs middle, Inputs end, double step, const Coefficients* c, const Network* network,
    Tangent* t, int n
) noexcept nogil:
    """One classical RK4 step [s], x (n,) in place, with the inputs at its start, middle and end.

    t: NULL, or the tangent that moves with it.
    """
    cdef double[4] first
    cdef double[4] second
    cdef double[4] third
    cdef double[4] fourth
    cdef double[4] there
    cdef double half = 0.5 * step
    cdef int i
    _rates(x, start, c, network, t, 0, first, n)
    for i in range(n):
        there[i] = x[i] + half * first[i]
    _rates(there, middle, c, network, t, 1, second, n)
    for i in range(n):
        there[i] = x[i] + half * second[i]
    _rates(there, middle, c, network, t, 2, third, n)
    for i in range(n):
        there[i] = x[i] + step * third[i]
    _rates(there, end, c, network, t, 3, fourth, n)
    if t != NULL:
        _move_tangent(t, step, n)
    for i in range(n):
        x[i] = x[i] + step / 6.0 * ((first[i] + 2.0 * (second[i] + third[i])) + fourth[i])


cdef inline void _move_tangent(Tangent* t, double step, int n) noexcept nogil:
    """The derivatives over a step [s]: the derivative of an RK4 step is the RK4 step of the derivatives.

    That is linear in the derivatives before it, and in how x' goes with the numbers at its stages, so that a column
    costs a few products; those of phi act through two flows.
    """
    cdef Columns[4][4] after  # of a stage's rates, a row each
    cdef Columns[4] whole  # of the state
    cdef double[4][2][4] through  # a flow at a stage
    cdef Columns[4] start
    cdef Columns[4] result
    cdef Columns along
    cdef const Columns* by_state
    cdef double* of_row
    cdef bint flows = False
    cdef int stage, row, i, j, k
    cdef int64_t chunk, column
    memset(after[3], 0, sizeof(whole))
    memset(whole, 0, sizeof(whole))
    for row in range(n):
        (<double*> &after[3][row])[row], (<double*> &whole[row])[row] = step / 6.0, 1.0
    for stage in range(3, -1, -1):
        by_state = <const Columns*> t.by_state + stage * n
        for row in range(n):
            of_row = <double*> &after[stage][row]
            along = of_row[0] * by_state[0]
            for k in range(1, n):
                along = along + of_row[k] * by_state[k]
            whole[row] = whole[row] + along
            if stage > 0:
                after[stage - 1][row] = (step if stage == 3 else 0.5 * step) * along
                (<double*> &after[stage - 1][row])[row] += step / 6.0 if stage == 1 else step / 3.0
        flows = flows or t.by_flow[(stage * n + SAC) * 2] != 0.0
    if flows:
        for stage in range(4):
            for row in range(n):
                of_row = <double*> &after[stage][row]
                for j in range(2):
                    through[stage][j][row] = 0.0
                    for k in range(n):
                        through[stage][j][row] += of_row[k] * t.by_flow[(stage * n + k) * 2 + j]
    for chunk in range(t.m // <int64_t> WIDTH):
        part, column = t.parts[chunk], chunk * <int64_t> WIDTH
        for row in range(n):
            start[row] = (<Columns*> (t.by + row * t.m + column))[0]
        for row in range(n):
            of_row = <double*> &whole[row]
            result[row] = of_row[0] * start[0]
            for i in range(1, n):
                result[row] = result[row] + of_row[i] * start[i]
        for k in range(2):
            if not (flows and part & (BY_SEAT if k else BY_NOZZLE)):
                continue
            for stage in range(4):
                along = (<Columns*> (t.of_flows + (2 * stage + k) * t.m + column))[0]
                for row in range(n):
                    result[row] = result[row] + through[stage][k][row] * along
        if part & BY_LINE:
            for stage in range(4):
                for i in range(2):  # p_L and Q_L
                    along = (<Columns*> (t.by_number + (stage * n + i) * t.m + column))[0]
                    for row in range(n):
                        result[row] = result[row] + (<double*> &after[stage][row])[i] * along
        for row in range(n):
            (<Columns*> (t.by + row * t.m + column))[0] = result[row]


cdef inline Inputs between(Inputs start, Inputs end, double share) noexcept nogil:
    """Inputs at a share (0..1) of the way between two samples.

    A negative area is a shut seat: a sample at which the needle is shut may carry the negative area from which, or
    to which, the ramp leads, so that the seat opens and shuts between the samples where the needle does.
    """
    cdef Inputs u
    u.rail = start.rail + share * (end.rail - start.rail)
    u.area = max(start.area + share * (end.area - start.area), 0.0)
    u.servo = between_servos(&start.servo, &end.servo, share)
    u.since = start.since + share * (end.since - start.since)
    between_needles(&start, &end, share, &u)
    return u


cdef inline void between_needles(const Inputs* start, const Inputs* end, double share, Inputs* u) noexcept nogil:
    """Slopes of the area by the needle's numbers, at a share (0..1) of the way between two samples."""
    cdef int64_t number
    u.shot = max(start.shot, end.shot)
    for number in range(<int64_t> NEEDLE_NUMBERS):
        u.by_needle[number] = start.by_needle[number] + share * (end.by_needle[number] - start.by_needle[number])


cdef inline int64_t _steps_in(const double* x, const Interval* interval, const Coefficients* c) noexcept nogil:
    """RK4 steps an interval needs: `substeps` for the sac, far fewer while only the line moves."""
    cdef double fastest
    if is_at_rest(x, interval.start) and is_at_rest(x, interval.end):
        fastest = sqrt(c.line.lump.a1 * c.line.lump.a3)  # of inertia against compliance [rad/s]
        return min(interval.substeps, <int64_t> ceil(interval.length * fastest / LINE_STEP))
    return interval.substeps


cdef inline void _advance(
    double* x, const Interval* interval, const Coefficients* c, const Network* network, Tangent* t, int n
) noexcept nogil:
    """Move the state x (n,) by an interval, in place, in RK4 steps."""
    cdef int64_t steps = _steps_in(x, interval, c), i
    cdef double count = <double> steps
    for i in range(steps):
        _runge_kutta_step(
            x, between(interval.start, interval.end, i / count), between(interval.start, interval.end, (i + 0.5) / count),
            between(interval.start, interval.end, (i + 1.0) / count), interval.length / count, c, network, t, n,
        )
    empty_if_drained(x, interval.start.area, interval.end.area, t)


cdef inline void _advance_lump(
    double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network, Tangent* t, int n
) noexcept nogil:
    """Move the state up to a knot, at which the area may bend, and from it on."""
    cdef Interval part = interval[0]
    cdef Inputs bend
    cdef bint flows = interval.start.area > 0.0 or knot.area > 0.0 or interval.end.area > 0.0
    cdef double remaining = 1.0 - knot.share
    if not (0.0 < knot.share < 1.0 and flows):
        _advance(x, interval, c, network, t, n)
        return
    bend = between(interval.start, interval.end, knot.share)
    bend.area = knot.area
    part.end, part.length = bend, knot.share * interval.length
    part.substeps = <int64_t> ceil(knot.share * interval.substeps)
    _advance(x, &part, c, network, t, n)
    part.start, part.end, part.length = bend, interval.end, remaining * interval.length
    part.substeps = <int64_t> ceil(remaining * interval.substeps)
    _advance(x, &part, c, network, t, n)
