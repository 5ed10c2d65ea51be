# Flows q_S of (21) and q_H of (23) with phi = G(x, u) N, where N = (N_H, N_S) = W sigma(V z) + b (7) are their relative
# changes, and the slopes of both. The neurons along a direction add up to a curve of cubic pieces (`model/network.py`).

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
    """A curve at the inputs; adds its slopes by them, unless NULL. One that begins at 0 has no weights."""
    cdef double t, slope
    cdef int64_t piece
    cdef const double* cubic
    cdef int number, which
    if curves[4 * PIECES * curve] == 0.0:
        return 0.0
    piece = piece_at(curve, z, &t)
    cubic = curves + 4 * piece
    if slopes != NULL and 0.0 < t + <double> (piece - PIECES * curve) < PIECES:  # beyond its ends it is level
        slope = cubic[1] + t * (2.0 * cubic[2] + t * 3.0 * cubic[3])
        for number in range(2):
            which = ALONG[curve][number]
            slopes[which] = slopes[which] + slope * PER_PIECE[which]
    return cubic[0] + t * (cubic[1] + t * (cubic[2] + t * cubic[3]))


cdef inline void gather_inputs(const double* x, const Inputs* u, double* z) noexcept nogil:
    """Fill z (INPUTS,) of (7), by which the network goes, with pressures and inputs."""
    z[NOZZLE_DROP], z[SEAT_DROP] = x[SAC], x[0] - x[SAC]
    z[NEEDLE_AREA], z[NEEDLE_TIME], z[RAIL_PRESSURE] = u.area, u.since, u.rail


cdef inline double change_of(bint is_seat, const double* z, const Network* network, double* slopes) noexcept nogil:
    """N_H or N_S, a row of W sigma(V z) + b (7), at the inputs z (INPUTS,); slopes: by them, NULL: not wanted."""
    cdef double change = network.bias[is_seat]
    cdef int first = FIRST_OF_SEAT if is_seat else 0, end = CURVES if is_seat else FIRST_OF_SEAT, curve
    if slopes != NULL:
        memset(slopes, 0, INPUTS * sizeof(double))
    if network.curves != NULL:
        for curve in range(first, end):
            change = change + curve_at(curve, z, network.curves, slopes)
    return change


cdef inline bint is_at_rest(const double* x, Inputs u) noexcept nogil:
    """Needle shut, no bounce asked for, sac at chamber pressure: no flow, so phi vanishes whatever the network says."""
    return u.area <= 0.0 and x[SAC] == 0.0 and u.by_needle[BOUNCE_HEIGHT] == 0.0


cdef inline void flows_without_phi(
    const double* x, Inputs u, const Coefficients* c, double* q_h, double* q_s
) noexcept nogil:
    """Normalised flows of the model alone: q_H of (23) through the nozzle, q_S of (21) through the seat."""
    q_h[0] = nozzle_law(x[SAC], u.area, NOTHING_LEARNED, &c.nozzle)
    q_s[0] = seat_law(x[0], x[SAC], u.area, &c.seat)


cdef inline void flows_with_phi(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* q_h, double* q_s
) noexcept nogil:
    """Normalised flows with phi, and with what is learned of the nozzle's law."""
    cdef double[INPUTS] z
    gather_inputs(x, &u, z)
    q_h[0] = nozzle_law(x[SAC], u.area, network.nozzle, &c.nozzle) * (1.0 + change_of(False, z, network, NULL))
    q_s[0] = seat_law(x[0], x[SAC], u.area, &c.seat) * (1.0 + change_of(True, z, network, NULL))


cdef double injection_rate(const double* x, Inputs u, const Coefficients* c, const Network* network) noexcept nogil:
    """The injection rate Q_H^ [m3/s]: the model's nozzle flow plus what phi says of it.

    Nozzle form: Q_H,model - (V_L p0/K_L) phi_1; seat form: Q_H,model - (V_S p0/K_C) phi_3 - (V_L p0/K_L) phi_1. With
    phi = G N both are Q_H,model (1 + N_H), as here.
    """
    cdef double q_h, q_s
    if is_at_rest(x, u):
        return 0.0
    flows_with_phi(x, u, c, network, &q_h, &q_s)
    return c.nozzle.flow * q_h


cdef double rate_and_phi(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* phi
) noexcept nogil:
    """The injection rate Q_H^ [m3/s]; phi: the three rows [1/s] of phi(x, u) = G(x, u) N of (2), (27)."""
    cdef double nozzle_flow, seat_flow, q_h, q_s, d_q_h, d_q_s
    phi[0] = phi[1] = phi[2] = 0.0
    if is_at_rest(x, u):
        return 0.0
    flows_without_phi(x, u, c, &nozzle_flow, &seat_flow)
    flows_with_phi(x, u, c, network, &q_h, &q_s)
    d_q_h = q_h - nozzle_flow
    d_q_s = q_s - seat_flow
    # the coefficients of the lump, which every line model has at the same place
    phi[0] = -c.line.lump.a2_nozzle * d_q_h - c.line.lump.a2_seat * d_q_s
    phi[2] = sac_rate(d_q_h, d_q_s, &c.sac)
    return c.nozzle.flow * q_h


cdef inline void flow_slopes(
    const double* x, const Inputs* u, const Coefficients* c, const Network* network, FlowSlopes* flows
) noexcept nogil:
    """Flows as of `flows_with_phi`, with their derivatives."""
    cdef NozzleSlopes nozzle = nozzle_law_slopes(x[SAC], u.area, network.nozzle, &c.nozzle)
    cdef double nozzle_flow = nozzle_law(x[SAC], u.area, network.nozzle, &c.nozzle)
    cdef double seat_flow = seat_law(x[0], x[SAC], u.area, &c.seat), by_area, by_sac, nozzle_factor, seat_factor
    cdef double by_line = seat_law_slopes(x[0], x[SAC], u.area, &c.seat, &by_area, &by_sac)
    cdef double[INPUTS] nozzle_by_z
    cdef double[INPUTS] seat_by_z
    cdef int64_t number
    gather_inputs(x, u, flows.z)
    nozzle_factor = 1.0 + change_of(False, flows.z, network, nozzle_by_z)
    seat_factor = 1.0 + change_of(True, flows.z, network, seat_by_z)
    flows.q_h, flows.q_s = nozzle_flow * nozzle_factor, seat_flow * seat_factor
    flows.h_x[0] = flows.h_x[1] = flows.s_x[1] = 0.0
    flows.h_x[SAC] = nozzle_flow * nozzle_by_z[NOZZLE_DROP] + nozzle.by_sac * nozzle_factor
    flows.s_x[0] = by_line * seat_factor + seat_flow * seat_by_z[SEAT_DROP]
    flows.s_x[SAC] = by_sac * seat_factor - seat_flow * seat_by_z[SEAT_DROP]
    flows.h_area = nozzle_flow * nozzle_by_z[NEEDLE_AREA] + nozzle.by_area[0] * nozzle_factor * nozzle.by_area[1]
    flows.s_area = seat_flow * seat_by_z[NEEDLE_AREA] + by_area * seat_factor
    flows.h_change, flows.s_change = nozzle_flow, seat_flow
    for number in range(<int64_t> NOZZLE_NUMBERS):
        flows.h_number[number][0] = nozzle.by_number[number][0] * nozzle_factor
        flows.h_number[number][1] = nozzle.by_number[number][1]


cdef void flow_slopes_by_theta(
    Inputs u, const FlowSlopes* flows, const Tangent* t, double* of_h, double* of_s
) noexcept nogil:
    """Derivatives of q_H and q_S by the learned numbers of phi, at the state of `flows`: into two rows (m,) by theta."""
    cdef int64_t number
    theta = &t.theta
    of_h[theta.nozzle_bias], of_s[theta.seat_bias] = flows.h_change, flows.s_change
    _by_weights(0, FIRST_OF_SEAT, flows.z, flows.h_change, t, of_h + theta.nozzle_weight)
    _by_weights(FIRST_OF_SEAT, CURVES, flows.z, flows.s_change, t, of_s + theta.seat_weight)
    _by_needle(u, flows.h_area, theta, of_h)
    _by_needle(u, flows.s_area, theta, of_s)
    for number in range(<int64_t> NOZZLE_NUMBERS):
        of_h[theta.nozzle[number]] = flows.h_number[number][0] * flows.h_number[number][1]


cdef bint rate_slopes(
    const double* x, const Forced* forced, Tangent* t, int64_t m, double scale, FlowSlopes* flows, double* by_state,
    double* by_theta
) noexcept nogil:
    """Derivatives of q_H, scaled, by the first states (3,) and theta (m,) at the end; False where nothing flows."""
    cdef Inputs u = forced.interval.end
    cdef int64_t i, j
    u.area = max(u.area, 0.0)
    if u.area <= 0.0 and x[SAC] == 0.0:
        return False
    flow_slopes(x, &u, &forced.coefficients, &forced.network, flows)
    flow_slopes_by_theta(u, flows, t, t.of_flows, t.of_flows + t.m)
    for i in range(3):
        by_state[i] = scale * flows.h_x[i]
    for j in range(m):
        by_theta[j] = scale * t.of_flows[j]
        for i in range(3):
            by_theta[j] += by_state[i] * t.by[i * t.m + j]
    return True


cdef inline void _by_weights(
    int first, int end, const double* z, double flow, const Tangent* t, double* row
) noexcept nogil:
    """Derivatives of a flow by the weights W of the neurons of curves first .. end - 1, into a row from its start on.

    They are written in whole vectors: the excess is 0, and the next curve overwrites it.
    """
    cdef double within
    cdef const Columns* neurons
    cdef int64_t part
    cdef int curve
    for curve in range(first, end):
        if t.neurons[curve] == 0:
            continue
        neurons = <const Columns*> (t.basis + 4 * MOST_NEURONS * piece_at(curve, z, &within))
        for part in range(1 + (t.neurons[curve] - 1) // <int64_t> WIDTH):
            (<Columns*> row)[part] = flow * (neurons[part] + within * (
                neurons[NEXT + part] + within * (neurons[2 * NEXT + part] + within * neurons[3 * NEXT + part])
            ))
        row += t.neurons[curve]


cdef inline void _by_needle(Inputs u, double by_area, const ByTheta* theta, double* row) noexcept nogil:
    """Derivatives of a flow by the numbers of a needle that answers commands, and by the delays of each shot."""
    cdef int64_t number, own = theta.first_shot + 2 * u.shot
    for number in range(<int64_t> NEEDLE_NUMBERS):
        row[theta.needle[number]] = by_area * (u.by_needle[number] * theta.needle_sizes[number])
    memset(row + theta.first_shot, 0, 2 * theta.shots * sizeof(double))
    if theta.shots > 0:
        row[own], row[own + 1] = row[theta.needle[OPENING_DELAY]], row[theta.needle[CLOSING_DELAY]]
