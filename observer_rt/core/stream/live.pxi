# The live rate: the running injection as an event of its own, explained by the line pressure so far.
#
# While the needle is open, and until the line is at rest again, derivatives of x~ and x^ by the numbers of a filter bank
# are carried along, as in an event's fit; they are 0 at an opening from rest. Every innovation of x~ corrects the bank,
# on a line of cells the mean of as many as its waves are resolved by. The rate of x^, moved along its derivatives by the
# bank's mean, is the live rate; the bank's covariance is its uncertainty. x~ and x^ themselves stay as they are.
#
# What the nozzle passes more is one number for each stretch of time, which walks on along a slope; when columns run out,
# the oldest stretch acts as the next one. A needle that answers commands has another delay at each opening and closing.

cdef double STRETCH = 0.1e-3  # s
cdef double WIDER = 1.2  # times the innovations' variance, for what a model leaves
cdef double LEAST_FRICTION = -0.05  # beyond the believed one, as a share: friction grows sooner than it falls
cdef double FURTHEST = 3.0  # change of the injection rate, in units of the nozzle's flow at p_0, that a line still tells
cdef double FLOW = 0.3  # standard deviation of nozzle and seat that may be any
cdef double AS_BELIEVED = 0.003  # .. of a nozzle as believed, where events have shown it
cdef double WALK = 0.015, SLOPE = 0.02, BEND = 0.01  # .. by which a flow that moves on changes from stretch to stretch
cdef double LAG = 0.5e-6, DELAY = 0.2e-6, OFFSET = 2e-4  # s, s, p_0: .. as they are known
cdef double OFFSET_HELD = 1e-3  # p_0: .. of an offset that no standstill moves, for the noise is coloured
cdef Widths[EXPLANATIONS] WIDTHS = [
    Widths(AS_BELIEVED, 1e-3, 0.0, 0.0, [0.01, 0.01, 0.002, LAG, OFFSET, DELAY], 0.9),  # as believed
    Widths(FLOW, 2e-3, 0.0, 0.0, [FLOW, 0.01, 0.002, LAG, OFFSET, DELAY], 0.02),  # another flow
    Widths(FLOW, WALK, SLOPE, BEND, [FLOW, 0.01, 0.002, LAG, OFFSET, DELAY], 0.02),  # a flow that moves on
    Widths(FLOW, 0.08, 0.0, 0.0, [FLOW, 0.01, 0.002, LAG, OFFSET, DELAY], 0.02),  # a flow that changes at once
    Widths(AS_BELIEVED, 1e-3, 0.0, 0.0, [0.01, 1.0, 0.1, LAG, OFFSET, DELAY], 0.02),  # another line
    Widths(AS_BELIEVED, 1e-3, 0.0, 0.0, [0.01, 0.01, 0.002, 35e-6, OFFSET, 30e-6], 0.02),  # late line pressure or lift
    Widths(FLOW, WALK, 0.0, 0.0, [FLOW, 1.0, 0.1, LAG, OFFSET, DELAY], 0.01),  # another flow and line
]
# Standard deviations beside the bank's, as shares: of the seat's flow at lifts that events have shown, of flows at others.
cdef double SEAT_SHARE = 0.003, UNSEEN = 0.05


cdef void _lend_live(Stepping* s, double[:, ::1] scratch) noexcept:
    """Lend the tangents of x~ and x^ their arrays, rows of a scratch (k, NUMBERS), which must stay where it is."""
    cdef int64_t of_each = LIVE_ROWS * s.coefficients.states + 8, number
    cdef double* rows = &scratch[2 * of_each, 0]
    live, g = &s.live, &s.live.of_tilde
    memset(live.parts, BY_NOZZLE | BY_SEAT | BY_LINE, sizeof(live.parts))
    for number in range(<int64_t> NEEDLE_NUMBERS):
        live.unused[number], live.needle[number], live.needle_sizes[number] = UNUSED, UNUSED, 0.0
    live.needle_sizes[OPENING_DELAY] = 1.0
    _lend_tangent(s, &g.tangent, &scratch[0, 0])
    _lend_tangent(s, &live.of_hat, &scratch[of_each, 0])
    g.offset = OF_OFFSET
    g.before, g.indicated, g.error, g.sensor = rows, rows + NUMBERS, rows + 2 * NUMBERS, rows + 3 * NUMBERS
    rows[3 * NUMBERS + OF_LAG] = 1.0


cdef void _lend_tangent(Stepping* s, Tangent* t, double* rows) noexcept nogil:
    """Lend a tangent its arrays, LIVE_ROWS rows (NUMBERS,) for each state, and 8."""
    cdef int64_t of_states = s.coefficients.states * NUMBERS
    live = &s.live
    t.n, t.m, t.size = s.coefficients.states, NUMBERS, s.coefficients.size
    t.by, t.moved, t.by_number = rows, rows + of_states, rows + 2 * of_states
    t.by_state, t.by_flow, t.by_coefficient = rows + 6 * of_states, rows + 7 * of_states, rows + 8 * of_states
    t.of_flows = rows + LIVE_ROWS * of_states
    t.parts, t.neurons = live.parts, live.no_neurons
    t.theta.seat_bias, t.theta.nozzle, t.theta.valve, t.theta.valve_sizes = OF_SEAT, live.unused, live.unused, live.no_sizes
    t.theta.needle, t.theta.needle_sizes = live.needle, live.needle_sizes
    t.theta.columns, t.theta.coefficients, t.theta.slopes = live.columns, live.numbers, live.slopes


cdef inline void _take_line_slopes(Stepping* s) noexcept nogil:
    """Take the slopes of the line in force by friction and stiffness, as shares."""
    cdef int64_t i, pairs = 1, n = s.coefficients.size
    live, line, values = &s.live, &s.coefficients.line, s.coefficients.line.values
    live.columns[0] = OF_FRICTION
    live.numbers[0] = (&line.lump.a4 if s.coefficients.cells == 0 else &line.wave.a4) - values
    live.slopes[0] = values[live.numbers[0]]
    for i in range(n):
        if s.coefficients.of_stiffness[i] != 0.0:
            live.columns[pairs], live.numbers[pairs], live.slopes[pairs] = OF_STIFFNESS, i, values[i]
            pairs += 1
    live.of_tilde.tangent.theta.pairs = live.of_hat.theta.pairs = pairs


cdef void _begin_live(Stepping* s, int64_t position) noexcept nogil:
    """Start bank and derivatives with the needle about to open."""
    live, g = &s.live, &s.live.of_tilde
    cdef int64_t size = s.coefficients.states * NUMBERS * sizeof(double)
    flow = s.coefficients.nozzle.flow * s.observer.memory.in_force.flow_factor
    s.observer.memory.operating_point.full_rate = flow * sqrt(s.observer.ring[position & MASK].rail_pressure)
    live.follows, live.has_widened, live.falls = True, False, False
    live.followed, live.samples, live.innovation, live.counted = 0, 0, 0.0, 0
    memset(live.slopes_sum, 0, sizeof(live.slopes_sum))
    memset(g.tangent.by, 0, size)
    memset(live.of_hat.by, 0, size)
    memset(g.indicated, 0, NUMBERS * sizeof(double))
    _take_line_slopes(s)
    live.needle[OPENING_DELAY] = OF_DELAY
    begin_bank(&live.bank, WIDTHS, s.observer.memory.in_force.flow_spread)
    _point_at_newest(&g.tangent, &live.bank)
    _point_at_newest(&live.of_hat, &live.bank)
    if s.observer.constants.needle.stop > 0.0:
        begin_anew(&live.bank, OF_DELAY, NEEDLE_JITTER)
    if s.observer.memory.in_force.coloured_noise > 0.0:
        begin_anew(&live.bank, OF_OFFSET, OFFSET_HELD)


cdef inline void _point_at_newest(Tangent* t, const FilterBank* bank) noexcept nogil:
    """Have the flow's derivatives go into the column of the present stretch, and no longer into others."""
    t.theta.nozzle_bias = newest_of(bank)
    memset(t.of_flows, 0, 8 * NUMBERS * sizeof(double))


cdef inline Gradient* _gradient(Stepping* s) noexcept nogil:
    """Derivatives that are carried along with x~; NULL while no injection is followed."""
    return &s.live.of_tilde if s.live.follows else NULL


cdef void _look_for_opening(Stepping* s, int64_t position) noexcept nogil:
    """Begin to follow an injection at the first sample after rest, and end with rest; see the needle's edges meanwhile."""
    before, row = &s.observer.ring[(position - 1) & MASK], &s.observer.ring[position & MASK]
    if row.resting:
        s.live.follows = False
    elif not s.live.follows and before.resting:
        _begin_live(s, position)
    if s.live.follows and s.observer.constants.needle.stop > 0.0 and row.seat_area != before.seat_area:
        _see_edge(&s.live, row.seat_area < before.seat_area)


cdef inline void _see_edge(Live* live, bint falls) noexcept nogil:
    """Have the edge of a needle that answers commands come with a delay of its own."""
    if falls == live.falls:
        return
    live.falls = falls
    live.needle[OPENING_DELAY] = OF_CLOSING if falls else OF_DELAY
    begin_anew(&live.bank, live.needle[OPENING_DELAY], NEEDLE_JITTER)
    _point_at_newest(&live.of_tilde.tangent, &live.bank)
    _point_at_newest(&live.of_hat, &live.bank)


cdef void _follow_live(Stepping* s, int64_t position) noexcept nogil:
    """Correct the bank by a sample, and give the sample's row the rate by it; else the row keeps that of x^."""
    cdef FlowSlopes flows
    cdef double[NUMBERS] by
    cdef double[3] by_state
    cdef double moved, sigma, flow = s.coefficients.nozzle.flow * s.observer.memory.in_force.flow_factor
    live, row = &s.live, &s.observer.ring[position & MASK]
    row.open_loop_rate, row.rate_sigma, row.as_believed = row.injection_rate, NAN, 1.0
    if not live.follows:
        return
    _widen_beliefs(live, &s.observer.memory.operating_point)
    _take_innovation(s, position)
    if not rate_slopes(_x_hat(s, position), &s.forced, &live.of_hat, NUMBERS, 1.0, &flows, by_state, by):
        row.rate_sigma = 0.0
        return
    mix_filters(&live.bank)
    moved, sigma = moved_by(&live.bank, by), _rate_sigma(s, row, by)
    if row.seat_area > 0.0:
        _go_through_stretch(s)
    live.follows = fabs(moved) + sigma < FURTHEST  # neither, if not finite
    if live.follows:
        row.injection_rate = max(row.injection_rate + flow * moved, 0.0)
        row.rate_sigma, row.as_believed = flow * sigma, live.bank.filters[0].weight


cdef inline void _take_innovation(Stepping* s, int64_t position) noexcept nogil:
    """Add up the newest innovation that is final, and correct the bank by as many together as the line resolves."""
    # Coloured noise counts as white noise of its loudest: the filters would take the slow part of it for a flow.
    cdef double noise = WIDER / s.observer.memory.innovation_noise.weight
    cdef int64_t later = min(s.observer.memory.in_force.watch_later, <int64_t> LATER - 1), j
    cdef double innovation = s.observer.ring[(position - later) & MASK].innovation
    if s.observer.memory.in_force.coloured_noise > 0.0:
        noise = WIDER * s.observer.memory.prior.healthy_variance * s.observer.memory.in_force.coloured_noise
    live = &s.live
    memcpy(live.later[position % LATER], live.of_tilde.error, sizeof(live.later[0]))
    live.followed += 1
    if live.followed <= later or innovation == 0.0:
        return
    slopes = live.later[(position - later) % LATER]
    live.innovation += innovation
    for j in range(<int64_t> NUMBERS):
        live.slopes_sum[j] += slopes[j]
    live.counted += 1
    if live.counted < live.together:
        return
    correct_filters(&live.bank, live.innovation, live.slopes_sum, live.counted * noise, LEAST_FRICTION)
    live.innovation, live.counted = 0.0, 0
    memset(live.slopes_sum, 0, sizeof(live.slopes_sum))


cdef inline void _go_through_stretch(Stepping* s) noexcept nogil:
    """Count a sample with the needle open, and begin another stretch where one is over, between innovations."""
    live = &s.live
    live.samples += 1
    if live.samples * s.interval < STRETCH or live.counted > 0:
        return
    live.samples = 0
    if live.bank.stretches == STRETCHES:
        forget_stretch(&live.bank)
        _join_oldest(live.of_tilde.tangent.by, s.coefficients.states)
        _join_oldest(live.of_tilde.indicated, 1)
        _join_oldest(live.of_hat.by, s.coefficients.states)
        if s.observer.memory.in_force.watch_later > 0:  # else none of them is taken later
            _join_oldest(live.later[0], LATER)
    begin_stretch(&live.bank)
    _point_at_newest(&live.of_tilde.tangent, &live.bank)
    _point_at_newest(&live.of_hat, &live.bank)


cdef inline void _join_oldest(double* by, int64_t rows) noexcept nogil:
    """Have the oldest stretch act as the next one, in derivatives (rows, NUMBERS); the last column becomes 0."""
    cdef int64_t i, j
    for i in range(rows):
        row = by + i * NUMBERS + OF_NOZZLE
        row[1] += row[0]
        for j in range(<int64_t> STRETCHES - 1):
            row[j] = row[j + 1]
        row[STRETCHES - 1] = 0.0


cdef inline void _widen_beliefs(Live* live, const OperatingPoint* point) noexcept nogil:
    """Let a flow as believed be another one that moves on, from where on no event has shown so long an opening."""
    cdef int64_t i
    if live.has_widened or point.in_learned_range:
        return
    live.has_widened, bank = True, &live.bank
    for i in range(<int64_t> EXPLANATIONS):
        if WIDTHS[i].nozzle == AS_BELIEVED:
            bank.walks[i], bank.bends[i] = WALK, BEND
            widen_flow(&bank.filters[i], newest_of(bank), SLOPE, SLOPE)
            if point.known_until == 0.0:  # else its spread so far is that of the part of the opening that is known
                widen_past_flow(&bank.filters[i], bank.stretches, FLOW)


cdef double _rate_sigma(Stepping* s, const Sample* row, const double* by) noexcept nogil:
    """Standard deviation of the rate with derivatives (NUMBERS,), in units of the nozzle's flow."""
    cdef double seat, nozzle = 0.0
    bank, point = &s.live.bank, &s.observer.memory.operating_point
    covariance, shown = &bank.covariance[0][0], is_shown(point, row)
    if shown and bank.filters[0].weight > BELIEVED:
        covariance = &bank.filters[0].covariance[0][0]
    if not shown and falls(point, row):
        nozzle = UNSEEN * by[newest_of(bank)]
    seat = by[OF_SEAT] * (max(SEAT_SHARE, s.observer.memory.in_force.flow_spread) if shown else UNSEEN)
    return sqrt(variance_by(covariance, by) + nozzle * nozzle + seat * seat)
