# The closed end of a staggered line: its last cell and the sac, stepped together and implicitly.
#
# p_L by the midpoint rule, p_S by backward Euler over each half step. So a sac of any volume will do; one that relaxes
# far faster than the step is where its flows balance, its filling included.

cdef enum:
    MOST_ITERATIONS = 40

cdef double CLOSE = 1e-9  # of p_0: pressures this close solve the step at the closed end
cdef double SPARE = 0.1  # of p_0, by which p_S may leave the range of the pressures round it


cdef void move_end(
    double* x, Inputs mean, Inputs end, double step, const Coefficients* c, const Network* network, Tangent* t
) noexcept nogil:
    """Move the end cell's pressure and p_S by a step [s], its inflow held; mean, end: inputs over and at its end."""
    line = &c.line.wave
    cdef double half = 0.5 * step, before = x[0], soft = stiffness(x[0], &line.softness), sac = 0.0, middle
    cdef double[3] solved
    cdef int64_t j
    if is_at_rest(x, mean) and end.area <= 0.0:
        middle = before + half * soft * line.a1 * (x[1] - line.outflow)
        middle -= half * soft * drained(before, &line.softness, &line.drain, mean)
        middle /= 1.0 + half * soft * line.leak
    else:
        middle = _solve_end(x, mean, half, half * soft, c, network, &sac)
    solved[0], solved[1], solved[2] = middle, x[1], sac
    if t != NULL:
        _end_rows(t, x, solved, mean, half, half, c, network)
    x[0], x[SAC] = middle, sac
    if c.is_mean:  # the integral of p_L; p_L is that in the step's middle
        x[c.states - 1] += step * x[0]
        if t != NULL:
            for j in range(t.m):
                t.by[(t.n - 1) * t.m + j] += step * t.by[j]
    if t != NULL:
        _beyond_middle(t)
    x[0] = 2.0 * middle - before
    if is_at_rest(x, end):
        return
    _solve_end(x, end, half, 0.0, c, network, &sac)
    if t != NULL:
        solved[0], solved[1], solved[2] = x[0], x[1], sac
        _end_rows(t, x, solved, end, half, 0.0, c, network)
    x[SAC] = sac


cdef double _solve_end(
    const double* x, Inputs u, double sac_step, double line_step, const Coefficients* c, const Network* network,
    double* solved_sac
) noexcept nogil:
    """p_L and p_S after implicit steps [s] at the inputs u; a line_step of 0 leaves p_L where it is.

    Newton's method. A step out of the range in which p_S must lie goes half the way to its end instead; one after an
    error that grew is shorter, for where the nozzle's flow falls with its pressure they may go in circles.
    """
    line, sac = &c.line.wave, &c.sac
    cdef double[3] solved  # p_L, Q_L, p_S
    cdef double lowest = min(x[SAC], x[0], 0.0) - SPARE, highest = max(x[SAC], x[0], 0.0) + SPARE
    cdef double inflow = line.a1 * (x[1] - line.outflow), fill, soften, line_error, sac_error, pp, ps, sp, ss, whole
    cdef double middle, by_p, by_s, error, share = 1.0, error_before = INFINITY
    cdef FlowSlopes flows
    cdef int64_t iteration
    memcpy(solved, x, sizeof(solved))
    inflow -= drained(x[0], &line.softness, &line.drain, u)  # explicit: the root hardly moves
    for iteration in range(<int64_t> MOST_ITERATIONS):
        flow_slopes(solved, &u, c, network, &flows)
        middle = 0.5 * (x[SAC] + solved[SAC])
        fill = sac_step * sac_stiffness(middle, sac)
        soften = 0.5 * sac_step * bent_slope(middle, sac.stiffness_slope, sac.stiffness_bend)
        soften *= sac_rate(flows.q_h, flows.q_s, sac)
        line_error = solved[0] - x[0] - line_step * (
            inflow - line.leak * solved[0] - line.a2_nozzle * flows.q_h - line.a2_seat * flows.q_s
        )
        sac_error = solved[SAC] - x[SAC] - fill * sac_rate(flows.q_h, flows.q_s, sac)
        pp = 1.0 + line_step * (line.leak + line.a2_seat * flows.s_x[0])
        ps = line_step * (line.a2_nozzle * flows.h_x[SAC] + line.a2_seat * flows.s_x[SAC])
        sp = -fill * sac.a5 * flows.s_x[0]
        ss = 1.0 + fill * (sac.a6 * flows.h_x[SAC] - sac.a5 * flows.s_x[SAC]) - soften
        error = fabs(line_error) + fabs(sac_error)
        share = 0.5 * share if error > error_before else min(2.0 * share, 1.0)
        error_before = error
        whole = pp * ss - ps * sp
        by_p = share * (ps * sac_error - ss * line_error) / whole
        by_s = share * (sp * line_error - pp * sac_error) / whole
        if solved[SAC] + by_s < lowest:
            by_s = 0.5 * (lowest - solved[SAC])
        elif solved[SAC] + by_s > highest:
            by_s = 0.5 * (highest - solved[SAC])
        solved[0] += by_p
        solved[SAC] += by_s
        if fabs(by_p) + fabs(by_s) < CLOSE:
            break
    solved_sac[0] = solved[SAC]
    return solved[0]


cdef void _end_rows(
    Tangent* t, const double* x, const double* solved, Inputs u, double sac_step, double line_step, const Coefficients* c,
    const Network* network
) noexcept nogil:
    """Derivatives of p_L and p_S through the implicit steps [s] from x to `solved`, by implicit differentiation."""
    line, sac = &c.line.wave, &c.sac
    cdef double* line_row = t.moved
    cdef double* sac_row = t.moved + t.m
    cdef double* kept = t.moved + 2 * t.m
    cdef double* of_line = t.by
    cdef double* of_flow = t.by + t.m
    cdef double* of_sac = t.by + SAC * t.m
    cdef double p = solved[0], flow = solved[1], soft = stiffness(x[0], &line.softness), fill = line_step * soft
    cdef double q_h = 0.0, q_s = 0.0, pp = 1.0 + fill * line.leak, ps = 0.0, sp = 0.0, ss = 1.0
    cdef double h_flow = 0.0, s_flow = 0.0, middle, line_by_h, sac_by_h, line_by_s, sac_by_s, inflow, net, by_pressure
    cdef double by_air, by_slope, soften, by_flow, sac_by_flow, share, from_sac, sac_fill = sac_step, sac_soften = 0.0
    cdef bint at_rest = is_at_rest(solved, u) and x[SAC] == 0.0
    cdef FlowSlopes flows
    cdef double* of_h = t.of_flows
    cdef double* of_s = t.of_flows + t.m
    cdef int64_t j
    memcpy(line_row, of_line, t.m * sizeof(double))
    if not at_rest:
        memcpy(sac_row, of_sac, t.m * sizeof(double))
        flow_slopes(solved, &u, c, network, &flows)
        flow_slopes_by_theta(u, &flows, t, of_h, of_s)
        q_h, q_s = flows.q_h, flows.q_s
        h_flow, s_flow = flows.h_x[1], flows.s_x[1]
        pp += fill * (line.a2_nozzle * flows.h_x[0] + line.a2_seat * flows.s_x[0])
        ps = fill * (line.a2_nozzle * flows.h_x[2] + line.a2_seat * flows.s_x[2])
        middle = 0.5 * (x[SAC] + solved[SAC])
        sac_fill = sac_step * sac_stiffness(middle, sac)
        sac_soften = 0.5 * sac_step * bent_slope(middle, sac.stiffness_slope, sac.stiffness_bend)
        sac_soften *= sac_rate(q_h, q_s, sac)
        sp = -sac_fill * (sac.a5 * flows.s_x[0] - sac.a6 * flows.h_x[0])
        ss = 1.0 - sac_fill * (sac.a5 * flows.s_x[2] - sac.a6 * flows.h_x[2]) - sac_soften
        line_by_h, sac_by_h = -fill * line.a2_nozzle, -sac_fill * sac.a6
        line_by_s, sac_by_s = -fill * line.a2_seat, sac_fill * sac.a5
        for j in range(t.m):
            line_row[j] += line_by_h * of_h[j] + line_by_s * of_s[j]
            sac_row[j] += sac_by_h * of_h[j] + sac_by_s * of_s[j] + sac_soften * of_sac[j]
    if line_step > 0.0:
        inflow = flow - line.outflow
        net = line.a1 * inflow - line.leak * p - line.a2_nozzle * q_h - line.a2_seat * q_s
        net -= drained(x[0], &line.softness, &line.drain, u)
        by_pressure = stiffness_slopes(x[0], &line.softness, &by_air, &by_slope)
        by_line = <WaveLine*> t.by_coefficient
        by_line.a1 = fill * inflow
        by_line.a2_nozzle = -fill * q_h
        by_line.a2_seat = -fill * q_s
        by_line.leak = -fill * p
        drain_slopes(&by_line.drain, -fill, x[0], &line.softness, u)
        add_valve(line_row, -fill, x[0], &line.softness, &line.drain, u, &t.theta)
        by_line.softness.air = line_step * by_air * net
        by_line.softness.stiffness_slope = line_step * by_slope * net
        add_coefficients(t, t.moved, 0, 1)  # its first row is that of the line
        soften = line_step * by_pressure * net - fill * drained_slope(x[0], &line.softness, &line.drain, u)
        by_flow = fill * (line.a1 - line.a2_nozzle * h_flow - line.a2_seat * s_flow)
        for j in range(t.m):
            line_row[j] += soften * of_line[j] + by_flow * of_flow[j]
    memcpy(kept, of_line, t.m * sizeof(double))
    sac_by_flow = sac_fill * (sac.a5 * s_flow - sac.a6 * h_flow)
    share = 1.0 / (pp * ss - ps * sp)
    if at_rest:
        for j in range(t.m):
            of_line[j] = share * line_row[j]
        return
    for j in range(t.m):
        from_sac = sac_row[j] + sac_by_flow * of_flow[j]
        of_line[j] = share * (ss * line_row[j] - ps * from_sac)
        of_sac[j] = share * (pp * from_sac - sp * line_row[j])


cdef void _beyond_middle(Tangent* t) noexcept nogil:
    """Move the derivatives of p_L from the middle of the step to its end; row 2 of the scratch: those before it."""
    cdef const double* before = t.moved + 2 * t.m
    cdef int64_t j
    for j in range(t.m):
        t.by[j] = 2.0 * t.by[j] - before[j]
