# The live rate: a mixture of filters beside x^ that follow the running injection by its own line pressure.
#
# Each is an extended Kalman filter on z = [p_L, Q_L, p_S, r, s, indicated pressure, delay]: r and s are what nozzle and
# seat pass more than the model with phi, as shares of the model's; 0 at an opening from rest, random walks while the
# needle is open. A needle that answers commands has another delay at each opening and closing. The filters differ in
# how far and how fast these may go, and weigh by the likelihood of the line pressure since the opening. Where no event
# has shown the flow, the first goes as far as the second. They are linearised together, at their mean. Line and sensor
# are as believed: a fault of either is taken for a flow here, and only the event's own fit tells them apart.

cdef double WALK_STEP = 1e-5  # s, for which the walks are given
cdef double[FILTERS][4] WIDTHS = [  # sd at the opening of r and s, walk of r and s in a step
    [0.003, 0.01, 3e-4, 1e-3],
    [0.3, 0.3, 2e-3, 5e-3],
    [0.3, 0.3, 2e-2, 2e-2],
]
cdef double[FILTERS] ODDS = [0.98, 0.01, 0.01]
cdef double LEAST_CHANGE = -0.9  # of r and s
cdef double WHITE = 2.5  # mean square of innovations, up to which a model leaves little of a healthy injector
cdef int64_t[VALVE_NUMBERS] SPARE = [7] * 4  # column of derivatives that nobody reads
cdef int64_t[NEEDLE_NUMBERS] DELAYS = [6, 7, 7, 7, 7, 7, 7, 7]  # both delays are one state, of either edge
cdef double[NEEDLE_NUMBERS] DELAY_SIZES = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
cdef double[VALVE_NUMBERS] NO_SIZES  # zeros
cdef int64_t[CURVES] NO_NEURONS  # zeros


cdef void _prepare_live(Stepping* s) noexcept nogil:
    """Lend the filters their scratch, which must stay where it is."""
    live, g = &s.live, &s.live.gradient
    t = &g.tangent
    t.n, t.m, t.size = s.coefficients.states, LIVE_COLUMNS, s.coefficients.size
    t.by, t.moved, t.by_state, t.by_number = live.by, live.moved, live.by_state, live.by_number
    t.by_flow, t.of_flows, t.by_coefficient = live.by_flow, live.of_flows, live.by_coefficient
    memset(live.parts, BY_NOZZLE | BY_SEAT, sizeof(live.parts))
    t.parts, t.neurons = live.parts, NO_NEURONS
    t.theta.nozzle_bias, t.theta.seat_bias = OF_NOZZLE, OF_SEAT
    t.theta.nozzle, t.theta.valve, t.theta.valve_sizes = SPARE, SPARE, NO_SIZES
    t.theta.needle, t.theta.needle_sizes = DELAYS, DELAY_SIZES
    g.offset, g.sensor = SPARE[0], live.no_numbers
    g.before, g.indicated, g.error = live.before, live.indicated, live.error
    live.network = s.network
    live.network.bias = live.bias


cdef void _begin_live(Stepping* s, int64_t position) noexcept nogil:
    """Start the filters at a sample at rest with the state x~, which errs as the steady gain of its filter says."""
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
        filter = &live.filters[i]
        memcpy(filter.mean, live.mean, sizeof(live.mean))
        memset(filter.covariance, 0, sizeof(filter.covariance))
        filter.covariance[0][0] = filter.covariance[SHOWN][SHOWN] = pressure
        filter.covariance[0][SHOWN] = filter.covariance[SHOWN][0] = pressure
        filter.covariance[1][1] = pressure * line.a3 / line.a1
        for k in range(2):
            filter.covariance[OF_NOZZLE + k][OF_NOZZLE + k] = WIDTHS[i][k] * WIDTHS[i][k]
        if live.states > OF_DELAY:
            filter.covariance[OF_DELAY][OF_DELAY] = 1.0
        filter.log_weight = log(ODDS[i])
    _go_on_as(s.of_live, s.of_tilde)
    live.follows, live.has_widened = True, False


cdef inline bint _has_white_innovations(Stepping* s) noexcept nogil:
    """Whether x~ leaves white noise: of a lump line, without coloured noise or a pilot valve that is seen late."""
    cdef bint is_white
    memory = s.observer.memory
    is_white = memory.judgement.offset_moves and memory.prior.healthy_variance < WHITE  # an offset under colour is held
    return is_white and s.coefficients.cells == 0 and memory.in_force.watch_later == 0 and memory.innovation_noise.weight > 0.0


cdef void _follow_live(Stepping* s, int64_t position) noexcept nogil:
    """Give a sample's row the rate by the filters, which begin with the needle at rest; else it keeps that of x^."""
    cdef double rate, sigma
    live, row = &s.live, &s.observer.ring[position & MASK]
    row.open_loop_rate, row.rate_sigma, row.as_believed = row.injection_rate, NAN, 1.0
    if row.resting or not _has_white_innovations(s):
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
        factor = s.observer.memory.in_force.flow_factor
        row.injection_rate, row.rate_sigma, row.as_believed = factor * rate, factor * sigma, live.filters[0].weight


cdef void _advance_live(Stepping* s, int64_t position) noexcept nogil:
    """Advance all filters by a sample, and correct them by the line pressure where it is known."""
    cdef double shown, walk_steps, flow_sigma, innovation = 0.0
    cdef bint is_measured
    cdef int64_t i
    observer, live = s.observer, &s.live
    before, row = &observer.ring[(position - 1) & MASK], &observer.ring[position & MASK]
    _widen_first_filter(live, &observer.memory.operating_point)
    shown = _predict_live(s, position)
    is_measured = row.innovation != 0.0
    if is_measured:
        y = observer.ring[(position + observer.constants.sensor.late) & MASK].line_pressure
        innovation = trusted_under_terms(y - observer.memory.pair.offset - shown, s.interval, s.of_live)
    walk_steps = s.interval / WALK_STEP if before.seat_area > 0.0 or row.seat_area > 0.0 else 0.0
    flow_sigma = s.coefficients.line.lump.a3 * s.interval * observer.channels[RAIL].noise
    for i in range(<int64_t> FILTERS):
        _advance_filter(
            live, &live.filters[i], WIDTHS[1 if i == 0 and live.has_widened else i], walk_steps,
            flow_sigma * flow_sigma * observer.constants.rail_every, innovation, is_measured
        )
    _mix_filters(live)


cdef inline void _widen_first_filter(Live* live, const OperatingPoint* point) noexcept nogil:
    """Let the first filter go as far as the second, once no event has shown the flow for so long an opening."""
    cdef int64_t i
    if live.has_widened or point.in_learned_range:
        return
    live.has_widened = True
    if point.known_until == 0.0:  # else its spread is that of the part of the opening that is known
        for i in range(2):
            live.filters[0].covariance[OF_NOZZLE + i][OF_NOZZLE + i] += WIDTHS[1][i] * WIDTHS[1][i]


cdef double _predict_live(Stepping* s, int64_t position) noexcept nogil:
    """Predict the filters' mean by a sample, with derivatives; returns the line pressure that should be recorded."""
    cdef double[4] x
    cdef double shown, indicated
    cdef int64_t i
    in_force, live = &s.observer.memory.in_force, &s.live
    before, row = &s.observer.ring[(position - 1) & MASK], &s.observer.ring[position & MASK]
    memcpy(x, live.mean, 3 * sizeof(double))
    x[3], indicated = 0.0, live.mean[SHOWN]
    for i in range(2):
        live.bias[i] = in_force.bias[i] + max(live.mean[OF_NOZZLE + i], LEAST_CHANGE)
    _begin_derivatives(live)
    s.forced.network = live.network
    _force(s, position, x, &live.network, s.of_live)
    if live.states > OF_DELAY:
        _delay_needle(live, before.seat_area - row.seat_area, NEEDLE_JITTER / s.interval, &s.forced.interval)
    shown = predict(x, &indicated, &s.forced, s.fraction, in_force.sensor, &live.gradient)
    _take_derivatives(live)
    memcpy(live.moved_mean, live.mean, sizeof(live.mean))
    memcpy(live.moved_mean, x, 3 * sizeof(double))
    live.moved_mean[SHOWN] = indicated
    return shown_under_terms(shown, &s.forced, s.of_live)


cdef inline void _begin_derivatives(Live* live) noexcept nogil:
    """Let line, sac and indicated pressure have the derivative 1 by themselves before a sample."""
    cdef int64_t i
    memset(live.by, 0, sizeof(live.by))
    memset(live.indicated, 0, sizeof(live.indicated))
    for i in range(3):
        live.by[i * LIVE_COLUMNS + i] = 1.0
    live.indicated[SHOWN] = 1.0


cdef inline void _take_derivatives(Live* live) noexcept nogil:
    """Write the derivatives of all states over the sample into `change`; flows passed more and the delay stay."""
    cdef int64_t i, j
    memset(live.change, 0, sizeof(live.change))
    for i in range(<int64_t> LIVE_STATES):
        for j in range(3):
            live.change[j][i] = live.by[j * LIVE_COLUMNS + i]
        live.change[SHOWN][i] = live.indicated[i]
    live.change[OF_NOZZLE][OF_NOZZLE] = live.change[OF_SEAT][OF_SEAT] = live.change[OF_DELAY][OF_DELAY] = 1.0


cdef void _delay_needle(Live* live, double falls_by, double samples, Interval* interval) noexcept nogil:
    """Shift an interval's area by the delay. falls_by: the area's drop over it; samples: the delay's unit in samples."""
    cdef int64_t i, k
    if falls_by != 0.0 and (falls_by > 0.0) != live.falls:  # another edge
        live.falls = not live.falls
        live.mean[OF_DELAY] = 0.0
        for i in range(<int64_t> FILTERS):
            filter = &live.filters[i]
            filter.mean[OF_DELAY] = 0.0
            for k in range(<int64_t> LIVE_STATES):
                filter.covariance[OF_DELAY][k] = filter.covariance[k][OF_DELAY] = 0.0
            filter.covariance[OF_DELAY][OF_DELAY] = 1.0
    interval.start.by_needle[OPENING_DELAY] = interval.end.by_needle[OPENING_DELAY] = falls_by * samples
    interval.start.area += falls_by * samples * live.mean[OF_DELAY]
    interval.end.area += falls_by * samples * live.mean[OF_DELAY]


cdef inline double _with_products(double total, const double* left, const double* right, int64_t n) noexcept nogil:
    """A total with the scalar product of two vectors (n,) added to it, one product after another."""
    cdef int64_t k
    for k in range(n):
        total += left[k] * right[k]
    return total


cdef void _advance_filter(
    Live* live, Filter* filter, const double* widths, double walk_steps, double flow_noise, double innovation,
    bint is_measured
) noexcept nogil:
    """Predict a filter by a sample, and correct it by the innovation [p_0] at the filters' mean if there is one.

    walk_steps: of the random walks; flow_noise: variance of Q_L by the rail's noise in the sample.
    """
    cdef double[LIVE_STATES][LIVE_STATES] moved
    cdef double[LIVE_STATES] away
    cdef double[LIVE_STATES] with_error
    cdef double error, variance
    cdef int64_t i, j, n = live.states
    for i in range(2):
        filter.covariance[OF_NOZZLE + i][OF_NOZZLE + i] += walk_steps * widths[2 + i] * widths[2 + i]
    for i in range(n):
        away[i] = filter.mean[i] - live.mean[i]
        with_error[i] = _with_products(0.0, filter.covariance[i], live.error, n)
        for j in range(n):
            moved[i][j] = _with_products(0.0, live.change[i], filter.covariance[j], n)
    variance = _with_products(live.variance, live.error, with_error, n)
    error = _with_products(innovation, live.error, away, n)
    for i in range(n):
        with_error[i] = _with_products(0.0, moved[i], live.error, n)
        filter.mean[i] = _with_products(live.moved_mean[i], live.change[i], away, n)
        for j in range(i + 1):
            filter.covariance[i][j] = filter.covariance[j][i] = _with_products(0.0, moved[i], live.change[j], n)
    filter.covariance[1][1] += flow_noise
    if not is_measured:
        return
    filter.log_weight -= 0.5 * (log(variance) + error * error / variance)
    for i in range(n):
        filter.mean[i] -= with_error[i] / variance * error
        for j in range(i + 1):
            filter.covariance[i][j] -= with_error[i] * with_error[j] / variance
            filter.covariance[j][i] = filter.covariance[i][j]


cdef void _mix_filters(Live* live) noexcept nogil:
    """Weigh the filters by their likelihoods, and form the mean of them all."""
    cdef double total = 0.0
    cdef double largest = max(live.filters[0].log_weight, live.filters[1].log_weight, live.filters[2].log_weight)
    cdef int64_t i, j
    memset(live.mean, 0, sizeof(live.mean))
    for i in range(<int64_t> FILTERS):
        live.filters[i].log_weight -= largest
        live.filters[i].weight = exp(live.filters[i].log_weight)
        total += live.filters[i].weight
    for i in range(<int64_t> FILTERS):
        live.filters[i].weight /= total
        for j in range(<int64_t> LIVE_STATES):
            live.mean[j] += live.filters[i].weight * live.filters[i].mean[j]


cdef double _live_rate(Stepping* s, int64_t position, double* sigma) noexcept nogil:
    """Return the injection rate [m3/s] at the filters' mean; sigma: its standard deviation by all of them."""
    cdef double[LIVE_STATES] by
    cdef double variance = 0.0, apart
    cdef double* bias = s.of_live.bias if s.of_live.rows > 0 else s.live.bias
    cdef FlowSlopes flows
    cdef Inputs u = s.forced.interval.end
    cdef int64_t f, i, j
    live = &s.live
    sigma[0] = 0.0
    u.area = max(u.area, 0.0)
    if u.area <= 0.0 and live.mean[SAC] == 0.0:
        return 0.0
    for i in range(2):
        bias[i] += max(live.mean[OF_NOZZLE + i], LEAST_CHANGE) - max(live.moved_mean[OF_NOZZLE + i], LEAST_CHANGE)
    flow_slopes(live.mean, &u, &s.forced.coefficients, &s.forced.network, &flows)
    memset(by, 0, sizeof(by))
    memcpy(by, flows.h_x, 3 * sizeof(double))
    by[OF_NOZZLE] = flows.h_change
    for f in range(<int64_t> FILTERS):
        filter = &live.filters[f]
        apart = 0.0
        for i in range(<int64_t> LIVE_STATES):
            apart += by[i] * (filter.mean[i] - live.mean[i])
            for j in range(<int64_t> LIVE_STATES):
                variance += filter.weight * by[i] * filter.covariance[i][j] * by[j]
        variance += filter.weight * apart * apart
    sigma[0] = s.coefficients.nozzle.flow * sqrt(max(variance, 0.0))
    return s.coefficients.nozzle.flow * flows.q_h
