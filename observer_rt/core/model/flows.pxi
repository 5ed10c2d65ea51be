# The network part of phi, N = W tanh(V z) + b, and the flows through seat and nozzle with it, with their slopes.

cdef double[NOZZLE_NUMBERS] NOTHING_LEARNED  # zeros


cdef inline double activation(const double* x, Inputs u, const double* row) noexcept nogil:
    """Output sigma_i = tanh(v_i z) of one hidden neuron (9); row: v_i."""
    return fast_tanh(row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * u.rail + row[4] * u.area + row[5])


cdef inline bint is_at_rest(const double* x, Inputs u) noexcept nogil:
    """Needle shut and sac at chamber pressure: no flow, so phi vanishes whatever the network says."""
    return u.area <= 0.0 and x[SAC] == 0.0


cdef inline void model_flows(const double* x, Inputs u, const Coefficients* c, double* q_h, double* q_s) noexcept nogil:
    """Normalised flows of the model alone: q_H of (23) through the nozzle, q_S of (21) through the seat."""
    q_h[0] = nozzle_law(x[SAC], u.area, NOTHING_LEARNED, &c.nozzle)
    q_s[0] = seat_law(x[0], x[SAC], u.area, &c.seat)


cdef inline void changed_flows(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* q_h, double* q_s
) noexcept nogil:
    """Normalised flows with phi: (N_H, N_S) = W tanh(V z) + b (7), with z = [x u 1], are their relative changes."""
    cdef double nozzle_change = network.bias[0], seat_change = network.bias[1], sigma
    cdef int64_t neuron
    for neuron in range(network.neurons):
        sigma = activation(x, u, network.hidden + 6 * neuron)
        nozzle_change += network.output[neuron] * sigma
        seat_change += network.output[network.neurons + neuron] * sigma
    q_h[0] = nozzle_law(x[SAC], u.area, network.nozzle, &c.nozzle) * (1.0 + nozzle_change)
    q_s[0] = seat_law(x[0], x[SAC], u.area, &c.seat) * (1.0 + seat_change)


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
    Q_H,model - (V_S p0/K_C) phi_3 - (V_L p0/K_L) phi_1. Both balances give Q_H,model (1 + N_H) when phi = G N, which
    is what is computed.
    """
    cdef double nozzle_flow, seat_flow, q_h, q_s, d_q_h, d_q_s
    phi[0] = phi[1] = phi[2] = 0.0
    if is_at_rest(x, u):
        return 0.0
    model_flows(x, u, c, &nozzle_flow, &seat_flow)
    changed_flows(x, u, c, network, &q_h, &q_s)
    d_q_h = q_h - nozzle_flow
    d_q_s = q_s - seat_flow
    # of every line the same places
    phi[0] = -c.line.lump.a2_nozzle * d_q_h - c.line.lump.a2_seat * d_q_s
    phi[2] = sac_rate(d_q_h, d_q_s, &c.sac)
    return c.nozzle.flow * q_h


cdef void flow_slopes(
    const double* x, Inputs u, const Coefficients* c, const Network* network, double* sigmas, FlowSlopes* result
) noexcept nogil:
    """`changed_flows` with their derivatives; sigmas (q,) becomes the activations of the hidden neurons."""
    cdef double nozzle_flow = nozzle_law(x[SAC], u.area, network.nozzle, &c.nozzle)
    cdef NozzleSlopes of_nozzle = nozzle_law_slopes(x[SAC], u.area, network.nozzle, &c.nozzle)
    cdef double seat_flow = seat_law(x[0], x[SAC], u.area, &c.seat)
    cdef double nozzle_change = network.bias[0], seat_change = network.bias[1]
    cdef double h_1 = 0.0, h_2 = 0.0, h_3 = 0.0, h_area = 0.0, s_1 = 0.0, s_2 = 0.0, s_3 = 0.0, s_area = 0.0
    cdef double sigma, bend, to_nozzle, to_seat, by_difference, by_area
    cdef const double* row
    cdef int64_t neuron, number
    for neuron in range(network.neurons):
        row = network.hidden + 6 * neuron
        sigma = activation(x, u, row)
        sigmas[neuron] = sigma
        nozzle_change += network.output[neuron] * sigma
        seat_change += network.output[network.neurons + neuron] * sigma
        bend = 1.0 - sigma * sigma
        to_nozzle = nozzle_flow * network.output[neuron] * bend
        to_seat = seat_flow * network.output[network.neurons + neuron] * bend
        h_1 += to_nozzle * row[0]
        h_2 += to_nozzle * row[1]
        h_3 += to_nozzle * row[2]
        h_area += to_nozzle * row[4]
        s_1 += to_seat * row[0]
        s_2 += to_seat * row[1]
        s_3 += to_seat * row[2]
        s_area += to_seat * row[4]
    by_difference = seat_law_slopes(x[0], x[SAC], u.area, &c.seat, &by_area)
    by_difference *= 1.0 + seat_change
    result.q_h = nozzle_flow * (1.0 + nozzle_change)
    result.q_s = seat_flow * (1.0 + seat_change)
    result.h_x[0], result.h_x[1], result.h_x[2] = h_1, h_2, h_3 + of_nozzle.by_sac * (1.0 + nozzle_change)
    result.s_x[0], result.s_x[1], result.s_x[2] = s_1 + by_difference, s_2, s_3 - by_difference
    result.h_area = h_area + of_nozzle.by_area[0] * (1.0 + nozzle_change) * of_nozzle.by_area[1]
    result.s_area = s_area + by_area * (1.0 + seat_change)
    result.h_change = nozzle_flow
    result.s_change = seat_flow
    for number in range(<int64_t> NOZZLE_NUMBERS):
        result.h_number[number][0] = of_nozzle.by_number[number][0] * (1.0 + nozzle_change)
        result.h_number[number][1] = of_nozzle.by_number[number][1]


cdef void phi_slopes(const FlowSlopes* flows, const Tangent* t, double by_h, double by_s, double* row) noexcept nogil:
    """How what goes with q_H and q_S by these slopes goes with the numbers of phi: their columns of a row (m,)."""
    cdef int64_t neuron, number
    theta = &t.theta
    row[theta.nozzle_bias] = by_h * flows.h_change
    for neuron in range(t.neurons):
        row[theta.nozzle_weight + neuron] = by_h * flows.h_change * t.sigmas[neuron]
    row[theta.seat_bias] = by_s * flows.s_change
    for number in range(<int64_t> NOZZLE_NUMBERS):
        row[theta.nozzle[number]] = by_h * flows.h_number[number][0] * flows.h_number[number][1]
