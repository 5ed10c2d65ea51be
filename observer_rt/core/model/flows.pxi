# The network part of phi, N = W sigma(V z) + b, and the flows through seat and nozzle with it, with their slopes. The
# neurons along a direction add up to a curve of cubic pieces (`model/network.py`), of which one is looked up.

cdef double[NOZZLE_NUMBERS] NOTHING_LEARNED  # zeros
cdef enum:
    NEXT = MOST_NEURONS // WIDTH  # from a coefficient of neurons to the next

cdef double[INPUTS] REACH = [2.0, 1.5, 3e-3, 2.0, 1.2]  # of an input, from 0 on: in p_0, A_0, s; beyond it curves are level
cdef double[INPUTS] PER_PIECE = [0.5 * PIECES / reach for reach in REACH]
# Inputs of each curve: it goes by the mean of both, as shares of their reach.
cdef int[CURVES][2] ALONG = [
    [NOZZLE_DROP, NOZZLE_DROP], [NEEDLE_AREA, NEEDLE_AREA], [NEEDLE_TIME, NEEDLE_TIME], [RAIL_PRESSURE, RAIL_PRESSURE],
    [NOZZLE_DROP, NEEDLE_TIME], [NOZZLE_DROP, RAIL_PRESSURE], [RAIL_PRESSURE, NEEDLE_TIME],
    [NEEDLE_AREA, NOZZLE_DROP], [NEEDLE_AREA, RAIL_PRESSURE], [NEEDLE_AREA, NEEDLE_TIME],
    [NEEDLE_AREA, NEEDLE_AREA], [SEAT_DROP, SEAT_DROP], [NEEDLE_AREA, SEAT_DROP],
]


cdef inline int64_t piece_at(int curve, const double* z, double* within) noexcept nogil:
    """Number, among the pieces of all curves, of that at the inputs; within: share of it passed (0..1)."""
    cdef int first = ALONG[curve][0], second = ALONG[curve][1]
    cdef double place = min(max(z[first] * PER_PIECE[first] + z[second] * PER_PIECE[second], 0.0), <double> PIECES)
    cdef int64_t piece = min(<int64_t> place, <int64_t> PIECES - 1)
    within[0] = place - piece
    return PIECES * curve + piece


cdef inline double curve_at(int curve, const double* z, const double* curves, double* slopes) noexcept nogil:
    """A curve at the inputs; adds its slopes by them. One that begins at 0 has no weights."""
    cdef double t, slope
    cdef int64_t piece
    cdef const double* cubic
    cdef int number, which
    if curves[4 * PIECES * curve] == 0.0:
        return 0.0
    piece = piece_at(curve, z, &t)
    cubic = curves + 4 * piece
    if 0.0 < t + <double> (piece - PIECES * curve) < PIECES:  # beyond its ends it is level
        slope = cubic[1] + t * (2.0 * cubic[2] + t * 3.0 * cubic[3])
        for number in range(2):
            which = ALONG[curve][number]
            slopes[which] = slopes[which] + slope * PER_PIECE[which]
    return cubic[0] + t * (cubic[1] + t * (cubic[2] + t * cubic[3]))


cdef inline double change_of(bint is_seat, const double* z, const Network* network, double* slopes) noexcept nogil:
    """N_H or N_S, a row of W sigma(V z) + b (7), at the inputs z (INPUTS,), and its slopes by them."""
    cdef double change = network.bias[is_seat]
    cdef int first = FIRST_OF_SEAT if is_seat else 0, end = CURVES if is_seat else FIRST_OF_SEAT, curve
    memset(slopes, 0, INPUTS * sizeof(double))
    if network.curves != NULL:
        for curve in range(first, end):
            change = change + curve_at(curve, z, network.curves, slopes)
    return change


cdef inline bint is_at_rest(const double* x, Inputs u) noexcept nogil:
    """Needle shut, no bounce asked for, sac at chamber pressure: no flow, so phi vanishes whatever the network says."""
    return u.area <= 0.0 and x[SAC] == 0.0 and u.by_needle[OF_BOUNCE] == 0.0


cdef inline void gather_inputs(double p_line, double p_sac, Inputs u, double* z) noexcept nogil:
    """Fill z (INPUTS,), by which the network of (7) goes, with pressures and inputs."""
    z[NOZZLE_DROP], z[SEAT_DROP] = p_sac, p_line - p_sac
    z[NEEDLE_AREA], z[NEEDLE_TIME], z[RAIL_PRESSURE] = u.area, u.since, u.rail


cdef inline void model_flows(const double* x, Inputs u, const Coefficients* c, double* q_h, double* q_s) noexcept nogil:
    """Normalised flows of the model alone: q_H of (23) through the nozzle, q_S of (21) through the seat."""
    q_h[0] = nozzle_law(x[SAC], u.area, NOTHING_LEARNED, &c.nozzle)
    q_s[0] = seat_law(x[0], x[SAC], u.area, &c.seat)


cdef inline void changed_flows(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* q_h, double* q_s
) noexcept nogil:
    """Normalised flows with phi: (N_H, N_S) = W sigma(V z) + b (7), with z = [x u since 1], are their relative changes."""
    cdef double[INPUTS] z
    cdef double[INPUTS] unused
    gather_inputs(x[0], x[SAC], u, z)
    q_h[0] = nozzle_law(x[SAC], u.area, network.nozzle, &c.nozzle) * (1.0 + change_of(False, z, network, unused))
    q_s[0] = seat_law(x[0], x[SAC], u.area, &c.seat) * (1.0 + change_of(True, z, network, unused))


cdef double injection_rate(const double* x, Inputs u, const Coefficients* c, const Network* network) noexcept nogil:
    """Q_H^ of `fault_and_rate` [m3/s]."""
    cdef double q_h, q_s
    if is_at_rest(x, u):
        return 0.0
    changed_flows(x, u, c, network, &q_h, &q_s)
    return c.nozzle.flow * q_h


cdef double fault_and_rate(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* phi
) noexcept nogil:
    """The injection rate Q_H^ [m3/s], and phi(x, u) = G(x, u) N of (2), (27), its three rows [1/s].

    Q_H^ is the model's nozzle flow plus what phi says of it. Nozzle form: Q_H,model - (V_L p0/K_L) phi_1; seat form:
    Q_H,model - (V_S p0/K_C) phi_3 - (V_L p0/K_L) phi_1. With phi = G N both are Q_H,model (1 + N_H), as here.
    """
    cdef double nozzle_flow, seat_flow, q_h, q_s, d_q_h, d_q_s
    phi[0] = phi[1] = phi[2] = 0.0
    if is_at_rest(x, u):
        return 0.0
    model_flows(x, u, c, &nozzle_flow, &seat_flow)
    changed_flows(x, u, c, network, &q_h, &q_s)
    d_q_h = q_h - nozzle_flow
    d_q_s = q_s - seat_flow
    # the coefficients of the lump, which every line model has at the same place
    phi[0] = -c.line.lump.a2_nozzle * d_q_h - c.line.lump.a2_seat * d_q_s
    phi[2] = sac_rate(d_q_h, d_q_s, &c.sac)
    return c.nozzle.flow * q_h


cdef void flow_slopes(
    const double* x, Inputs u, const Coefficients* c, const Network* network, FlowSlopes* result
) noexcept nogil:
    """`changed_flows` with their derivatives."""
    cdef double nozzle_flow = nozzle_law(x[SAC], u.area, network.nozzle, &c.nozzle)
    cdef NozzleSlopes of_nozzle = nozzle_law_slopes(x[SAC], u.area, network.nozzle, &c.nozzle)
    cdef double seat_flow = seat_law(x[0], x[SAC], u.area, &c.seat)
    cdef double[INPUTS] z
    cdef double[INPUTS] h_z
    cdef double[INPUTS] s_z
    gather_inputs(x[0], x[SAC], u, z)
    cdef double by_area, by_sac
    cdef double nozzle = 1.0 + change_of(False, z, network, h_z), seat = 1.0 + change_of(True, z, network, s_z)
    cdef double by_line = seat_law_slopes(x[0], x[SAC], u.area, &c.seat, &by_area, &by_sac) * seat + seat_flow * s_z[SEAT_DROP]
    cdef int64_t number
    result.q_h, result.q_s = nozzle_flow * nozzle, seat_flow * seat
    result.h_x[0], result.h_x[1], result.h_x[2] = 0.0, 0.0, nozzle_flow * h_z[NOZZLE_DROP] + of_nozzle.by_sac * nozzle
    result.s_x[0], result.s_x[1], result.s_x[2] = by_line, 0.0, by_sac * seat - seat_flow * s_z[SEAT_DROP]
    result.h_area = nozzle_flow * h_z[NEEDLE_AREA] + of_nozzle.by_area[0] * nozzle * of_nozzle.by_area[1]
    result.s_area = seat_flow * s_z[NEEDLE_AREA] + by_area * seat
    result.h_change = nozzle_flow
    result.s_change = seat_flow
    for number in range(<int64_t> NOZZLE_NUMBERS):
        result.h_number[number][0] = of_nozzle.by_number[number][0] * nozzle
        result.h_number[number][1] = of_nozzle.by_number[number][1]


cdef void flow_numbers(
    const double* x, Inputs u, const FlowSlopes* flows, const Tangent* t, double* of_h, double* of_s
) noexcept nogil:
    """Partial derivatives of q_H and q_S by the learned numbers of phi, at fixed x: into two rows (m,) by theta."""
    cdef double[INPUTS] z
    cdef double within, change
    cdef double* column = of_h + t.theta.nozzle_weight
    cdef const double* cubic
    cdef const Columns* of_neurons
    cdef Columns* result
    cdef int64_t part, number
    cdef int curve
    theta = &t.theta
    gather_inputs(x[0], x[SAC], u, z)
    of_h[theta.nozzle_bias], of_s[theta.seat_bias] = flows.h_change, flows.s_change
    for curve in range(<int> CURVES):
        change = flows.h_change if curve < FIRST_OF_SEAT else flows.s_change
        if curve == FIRST_OF_SEAT:
            column = of_s + theta.seat_weight
        if t.neurons[curve] == 0:
            continue
        cubic = t.basis + 4 * MOST_NEURONS * piece_at(curve, z, &within)
        of_neurons, result = <const Columns*> cubic, <Columns*> column
        # up to the next multiple of WIDTH; the excess is 0, and the next curve overwrites it
        for part in range(1 + (t.neurons[curve] - 1) // <int64_t> WIDTH):
            result[part] = change * (of_neurons[part] + within * (
                of_neurons[NEXT + part] + within * (of_neurons[2 * NEXT + part] + within * of_neurons[3 * NEXT + part])
            ))
        column += t.neurons[curve]
    for number in range(<int64_t> NEEDLE_NUMBERS):
        change = u.by_needle[number] * theta.needle_sizes[number]
        of_h[theta.needle[number]], of_s[theta.needle[number]] = flows.h_area * change, flows.s_area * change
    for number in range(2 * theta.shots):
        of_h[theta.first_shot + number] = of_s[theta.first_shot + number] = 0.0
    for number in range(2 if theta.shots > 0 else 0):  # both of its delays
        part = theta.first_shot + 2 * u.shot + number
        of_h[part], of_s[part] = of_h[theta.needle[2 * number]], of_s[theta.needle[2 * number]]
    for number in range(<int64_t> NOZZLE_NUMBERS):
        of_h[theta.nozzle[number]] = flows.h_number[number][0] * flows.h_number[number][1]
