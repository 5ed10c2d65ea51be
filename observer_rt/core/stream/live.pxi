# The live rate: a mixture of filters beside x^ that follow the running injection by its own line pressure.
#
# Each is an extended Kalman filter on z = [p_L, Q_L, p_S, r, s, indicated pressure, delay]: r and s are what nozzle and
# seat pass more than the model with phi, as shares of the model's; 0 at an opening from rest, random walks while the
# needle is open. A needle that answers commands has another delay at each opening and closing. The filters differ in
# how far and how fast these may go, and weigh by the likelihood of the line pressure since the opening. Where no event
# has shown the flow, the first goes as far as the second. They are linearised together, at their mean. Line and sensor
# are as believed: what one of them does is taken for a flow here, and only the event's own fit tells them apart.

cdef double WALK_STEP = 1e-5  # s, for which the walks are given
cdef double[FILTERS][4] WIDTHS = [  # sd at the opening of r and s, walk of r and s in a step
    [0.003, 0.01, 3e-4, 1e-3],
    [0.3, 0.3, 2e-3, 5e-3],
    [0.3, 0.3, 2e-2, 2e-2],
]
cdef double[FILTERS] ODDS = [0.98, 0.01, 0.01]
cdef double LEAST_CHANGE = -0.9  # of r and s
cdef double WHITE = 2.5  # mean square of innovations, up to which a model leaves little of a healthy injector
cdef int64_t[VALVE_NUMBERS] SPARE = [7] * 4  # column of what is not asked for
cdef int64_t[NEEDLE_NUMBERS] DELAYS = [6, 7, 7, 7, 7, 7]  # one of both, for either edge is an area so much later
cdef double[NEEDLE_NUMBERS] DELAY_SIZES = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
cdef double[VALVE_NUMBERS] NO_SIZES  # zeros
cdef int64_t[CURVES] NO_NEURONS  # zeros


cdef void _prepare_live(Stepping* s) noexcept nogil:
    """Lend the filters their scratch, which must stay where it is."""
    live = &s.live
    t = &live.gradient.tangent
    t.n, t.m, t.size = s.coefficients.states, LIVE_COLUMNS, s.coefficients.size
    t.by, t.moved, t.by_state, t.by_number = live.by, live.moved, live.by_state, live.by_number
    t.by_flow, t.of_flows, t.by_coefficient = live.by_flow, live.of_flows, live.by_coefficient
    memset(live.parts, BY_NOZZLE | BY_SEAT, sizeof(live.parts))
    t.parts, t.neurons = live.parts, NO_NEURONS
    t.theta.nozzle_bias, t.theta.seat_bias = OF_NOZZLE, OF_SEAT
    t.theta.nozzle, t.theta.valve, t.theta.valve_sizes = SPARE, SPARE, NO_SIZES
    t.theta.needle, t.theta.needle_sizes = DELAYS, DELAY_SIZES
    g = &live.gradient
    g.offset, g.sensor = SPARE[0], live.no_numbers
    g.before, g.indicated, g.error = live.before, live.indicated, live.error
    live.network = s.network
    live.network.bias = live.bias


cdef void _begin_live(Stepping* s, int64_t position) noexcept nogil:
    """The filters at a sample at rest, at x~ there, which errs as the steady filter says."""
    cdef double gain = s.observer.gains[(s.observer.gain_rows - 1) * s.observer.states], pressure
    cdef int64_t i, k
    live, line = &s.live, &s.coefficients.line.lump
    live.states = LIVE_STATES if s.observer.constants.needle.stop > 0.0 else OF_DELAY
    live.falls = False
    live.variance = (1.0 - gain) / s.observer.memory.innovation_noise.weight
    pressure = gain * live.variance
    memset(live.mean, 0, sizeof(live.mean))
    memcpy(live.mean, _x_hat(s, position), 3 * sizeof(double))
    live.mean[SHOWN] = s.observer.ring[position & MASK].indicated
    for i in range(<int64_t> FILTERS):
        one = &live.filters[i]
        memcpy(one.mean, live.mean, sizeof(live.mean))
        memset(one.covariance, 0, sizeof(one.covariance))
        one.covariance[0][0] = one.covariance[SHOWN][SHOWN] = pressure
        one.covariance[0][SHOWN] = one.covariance[SHOWN][0] = pressure
        one.covariance[1][1] = pressure * line.a3 / line.a1
        for k in range(2):
            one.covariance[OF_NOZZLE + k][OF_NOZZLE + k] = WIDTHS[i][k] * WIDTHS[i][k]
        if live.states > OF_DELAY:
            one.covariance[OF_DELAY][OF_DELAY] = 1.0
        one.log_weight = log(ODDS[i])
    _go_on_as(s.of_live, s.of_tilde)
    live.follows, live.has_widened = True, False


cdef inline bint _tells(Stepping* s) noexcept nogil:
    """Whether innovations are white: a lump line, without coloured noise or a pilot valve seen late."""
    cdef bint is_white
    memory = s.observer.memory
    is_white = memory.judgement.offset_moves and memory.prior.healthy_variance < WHITE  # an offset under colour is held
    return is_white and s.coefficients.cells == 0 and memory.in_force.watch_later == 0 and memory.innovation_noise.weight > 0.0


cdef void _follow_live(Stepping* s, int64_t position) noexcept nogil:
    """Have the filters follow to a sample, and its row tell the rate by them; x^ is what is left where they do not.

    They rest with the needle.
    """
    cdef double rate, sigma
    live, row = &s.live, &s.observer.ring[position & MASK]
    row.open_loop_rate, row.rate_sigma, row.as_believed = row.injection_rate, NAN, 1.0
    if row.resting or not _tells(s):
        live.follows = False
        return
    if not live.follows:
        if not s.observer.ring[(position - 1) & MASK].resting:
            return
        _begin_live(s, position - 1)
    _advance_live(s, position)
    rate = _live_rate(s, position, &sigma)
    s.forced.network = s.network
    live.follows = isfinite(rate + sigma)
    if live.follows:
        level = s.observer.memory.in_force.level
        row.injection_rate, row.rate_sigma, row.as_believed = level * rate, level * sigma, live.filters[0].weight


cdef void _advance_live(Stepping* s, int64_t position) noexcept nogil:
    """All filters one sample on, linearised at their mean, and corrected by the line pressure where it is known."""
    cdef double[4] x
    cdef double shown, y, innovation, indicated, largest, total = 0.0
    cdef double flow_noise
    cdef int64_t i, j
    cdef bint is_open, is_measured
    observer, live, point = s.observer, &s.live, &s.observer.memory.operating_point
    if not (live.has_widened or point.in_learned_range):
        live.has_widened = True
        if point.known_until == 0.0:  # else it begins where it was known
            for i in range(2):
                live.filters[0].covariance[OF_NOZZLE + i][OF_NOZZLE + i] += WIDTHS[1][i] * WIDTHS[1][i]
    before, row = &observer.ring[(position - 1) & MASK], &observer.ring[position & MASK]
    g = &live.gradient
    is_open = before.seat_area > 0.0 or row.seat_area > 0.0
    memcpy(x, live.mean, 3 * sizeof(double))
    x[3], indicated = 0.0, live.mean[SHOWN]
    for i in range(2):
        live.bias[i] = observer.memory.in_force.bias[i] + max(live.mean[OF_NOZZLE + i], LEAST_CHANGE)
    memset(live.by, 0, sizeof(live.by))
    memset(live.indicated, 0, sizeof(live.indicated))
    for i in range(3):
        live.by[i * LIVE_COLUMNS + i] = 1.0
    live.indicated[SHOWN] = 1.0
    s.forced.network = live.network
    _force(s, position, x, &live.network, s.of_live)
    if live.states > OF_DELAY:
        _delay_needle(live, before.seat_area - row.seat_area, NEEDLE_JITTER / s.interval, &s.forced.interval)
    shown = predict(x, &indicated, &s.forced, s.fraction, observer.memory.in_force.sensor, g)
    shown = shown_under_terms(shown, &s.forced, s.of_live)
    is_measured = row.innovation != 0.0
    y = observer.ring[(position + observer.constants.sensor.late) & MASK].line_pressure
    innovation = y - observer.memory.pair.offset - shown
    if is_measured:
        innovation = trusted_under_terms(innovation, s.interval, s.of_live)
    memset(live.change, 0, sizeof(live.change))
    for i in range(<int64_t> LIVE_STATES):
        for j in range(3):
            live.change[j][i] = live.by[j * LIVE_COLUMNS + i]
        live.change[SHOWN][i] = live.indicated[i]
    live.change[OF_NOZZLE][OF_NOZZLE] = live.change[OF_SEAT][OF_SEAT] = live.change[OF_DELAY][OF_DELAY] = 1.0
    flow_noise = s.coefficients.line.lump.a3 * s.interval * observer.channels[RAIL].noise
    memcpy(live.moved_mean, live.mean, sizeof(live.mean))
    memcpy(live.moved_mean, x, 3 * sizeof(double))
    live.moved_mean[SHOWN] = indicated
    for i in range(<int64_t> FILTERS):
        _advance_filter(
            live, &live.filters[i], WIDTHS[1 if i == 0 and live.has_widened else i],
            s.interval / WALK_STEP if is_open else 0.0,
            flow_noise * flow_noise * observer.constants.rail_every, innovation, is_measured,
        )
    largest = max(live.filters[0].log_weight, live.filters[1].log_weight, live.filters[2].log_weight)
    memset(live.mean, 0, sizeof(live.mean))
    for i in range(<int64_t> FILTERS):
        live.filters[i].log_weight -= largest
        live.filters[i].weight = exp(live.filters[i].log_weight)
        total += live.filters[i].weight
    for i in range(<int64_t> FILTERS):
        live.filters[i].weight /= total
        for j in range(<int64_t> LIVE_STATES):
            live.mean[j] += live.filters[i].weight * live.filters[i].mean[j]


cdef void _delay_needle(Live* live, double falls_by, double samples, Interval* interval) noexcept nogil:
    """Shift an interval's area by the delay. falls_by: the area's drop over it; samples: the delay's unit in samples."""
    cdef int64_t i, k
    if falls_by != 0.0 and (falls_by > 0.0) != live.falls:  # another edge
        live.falls = not live.falls
        live.mean[OF_DELAY] = 0.0
        for i in range(<int64_t> FILTERS):
            one = &live.filters[i]
            one.mean[OF_DELAY] = 0.0
            for k in range(<int64_t> LIVE_STATES):
                one.covariance[OF_DELAY][k] = one.covariance[k][OF_DELAY] = 0.0
            one.covariance[OF_DELAY][OF_DELAY] = 1.0
    interval.start.by_needle[0] = interval.end.by_needle[0] = falls_by * samples
    interval.start.area += falls_by * samples * live.mean[OF_DELAY]
    interval.end.area += falls_by * samples * live.mean[OF_DELAY]


cdef void _advance_filter(
    Live* live, Filter* one, const double* widths, double steps, double flow_noise, double innovation, bint is_measured
) noexcept nogil:
    """A filter one sample on; steps: of its walks; flow_noise: variance of Q_L by the rail's."""
    cdef double[LIVE_STATES][LIVE_STATES] moved
    cdef double[LIVE_STATES] away
    cdef double[LIVE_STATES] cross
    cdef double error = innovation, expected = live.variance, total
    cdef int64_t i, j, k, n = live.states
    for k in range(2):
        one.covariance[OF_NOZZLE + k][OF_NOZZLE + k] += steps * widths[2 + k] * widths[2 + k]
    for i in range(n):
        away[i] = one.mean[i] - live.mean[i]
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += live.change[i][k] * one.covariance[k][j]
            moved[i][j] = total
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += one.covariance[i][k] * live.error[k]
        expected += live.error[i] * total
        error += live.error[i] * away[i]
    for i in range(n):
        cross[i], total = 0.0, live.moved_mean[i]
        for k in range(n):
            cross[i] -= moved[i][k] * live.error[k]
            total += live.change[i][k] * away[k]
        one.mean[i] = total
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += moved[i][k] * live.change[j][k]
            one.covariance[i][j] = one.covariance[j][i] = total
    one.covariance[1][1] += flow_noise
    if not is_measured:
        return
    one.log_weight -= 0.5 * (log(expected) + error * error / expected)
    for i in range(n):
        one.mean[i] += cross[i] / expected * error
        for j in range(i + 1):
            one.covariance[i][j] -= cross[i] * cross[j] / expected
            one.covariance[j][i] = one.covariance[i][j]


cdef double _live_rate(Stepping* s, int64_t position, double* sigma) noexcept nogil:
    """The rate [m3/s] at the filters' mean, and its standard deviation by all of them."""
    cdef double[LIVE_STATES] by
    cdef double variance = 0.0, apart
    cdef double* bias = s.of_live.bias if s.of_live.rows > 0 else s.live.bias
    cdef FlowSlopes flows
    cdef Inputs u
    cdef int64_t f, i, j
    live = &s.live
    sigma[0] = 0.0
    u = s.forced.interval.end
    u.area = max(u.area, 0.0)
    if u.area <= 0.0 and live.mean[SAC] == 0.0:
        return 0.0
    for i in range(2):
        bias[i] += max(live.mean[OF_NOZZLE + i], LEAST_CHANGE) - max(live.moved_mean[OF_NOZZLE + i], LEAST_CHANGE)
    flow_slopes(live.mean, u, &s.forced.coefficients, &s.forced.network, &flows)
    memset(by, 0, sizeof(by))
    memcpy(by, flows.h_x, 3 * sizeof(double))
    by[OF_NOZZLE] = flows.h_change
    for f in range(<int64_t> FILTERS):
        one = &live.filters[f]
        apart = 0.0
        for i in range(<int64_t> LIVE_STATES):
            apart += by[i] * (one.mean[i] - live.mean[i])
            for j in range(<int64_t> LIVE_STATES):
                variance += one.weight * by[i] * one.covariance[i][j] * by[j]
        variance += one.weight * apart * apart
    sigma[0] = s.coefficients.nozzle.flow * sqrt(max(variance, 0.0))
    return s.coefficients.nozzle.flow * flows.q_h
