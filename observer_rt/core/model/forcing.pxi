# Evaluates the terms in force once a sample, and applies their changes over the interval.
#
# A term is a law of the inputs in the middle of an interval, and of a lump's pressure and flow there; else of the state
# at its start. One of the sensor is of the pressure at its end. What it changes is what a model has anyway: coefficients
# of the line, the constants of the network, the inputs.

cdef enum:
    # places in `Forcing.past`: s, number, ms, mm, MPa, and ..
    PAST_TIME, PAST_INJECTIONS, PAST_SINCE, PAST_LIFT, PAST_PRESSURE, PAST_AREA
    PAST_OF_FLOWS  # .. whether a law reads the flow through seat or nozzle
    PAST_OF_SENSOR  # .. whether one is of the sensor
    LIFT_ITERATIONS = 5  # of a lift whose flow coefficient depends on it

cdef double LEAST_LIFT = 0.02e-6  # m, from which on a term holds a needle open that is seen to be shut
cdef double MEGAPASCAL = 1e6
cdef double MILLIMETRE = 1e-3
cdef double MILLISECOND = 1e-3
cdef double MM3_PER_MS = 1e-6


cdef void begin_forcing(Forcing* f, double time, double injections) noexcept nogil:
    """Let a program begin anew with the needle shut, at a time [s] after so many injections."""
    cdef int64_t i
    f.first_of_sensor = sensor_rows(f.program, f.rows)
    memset(f.past, 0, PAST_NUMBERS * sizeof(double))
    memset(f.variables, 0, VARIABLES * sizeof(double))
    memset(f.totals, 0, TOTALS * sizeof(double))
    f.past[PAST_OF_SENSOR] = f.first_of_sensor < f.rows
    f.past[PAST_OF_FLOWS] = reads(f.program, f.rows, VARIABLE_SEAT_FLOW) or reads(f.program, f.rows, VARIABLE_NOZZLE_FLOW)
    f.past[PAST_TIME], f.past[PAST_INJECTIONS], f.past[PAST_PRESSURE] = time, injections, NAN
    for i in range(3 * f.rows):
        f.memory[i] = NAN


cdef void under_terms(
    const double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network, Forcing* f,
    Forced* forced
) noexcept nogil:
    """Fill `forced` with the interval from a state x (n,) on as the terms in force, if there are any, change it.

    Without terms, coefficients and network of `forced` are left: they must be those given, once for all samples.
    """
    forced.interval, forced.knot = interval[0], knot
    if f.rows > 0:
        forced.coefficients, forced.network = c[0], network[0]
        _force(x, interval, knot, c, network, f, forced)


cdef void _force(
    const double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network, Forcing* f,
    Forced* forced
) noexcept nogil:
    """Apply the terms in force to line, network and inputs of an interval."""
    cdef double pressure = MEGAPASCAL / c.pressure_scale, flow = MM3_PER_MS / c.flow_scale
    cdef double* totals = f.totals
    _observe(x, interval, c, network, f)
    run_program(f.program, 0, f.first_of_sensor, f.rows, f.variables, f.memory, interval.length / MILLISECOND, totals)
    f.bias[0] = network.bias[0] + totals[EQUATION_NOZZLE_FLOW]
    f.bias[1] = network.bias[1] + totals[EQUATION_SEAT_FLOW]
    memcpy(f.nozzle, network.nozzle, NOZZLE_NUMBERS * sizeof(double))
    f.nozzle[0] += totals[EQUATION_CHAMBER_PRESSURE] * pressure
    forced.network.bias, forced.network.nozzle = f.bias, f.nozzle
    _change_line(
        &forced.coefficients, totals[EQUATION_STIFFNESS], totals[EQUATION_INERTANCE],
        totals[EQUATION_LINE_PRESSURE] * flow, totals[EQUATION_LINE_FLOW] * pressure,
    )
    _change_inputs(
        interval, knot, totals[EQUATION_RAIL_PRESSURE] * pressure, totals[EQUATION_NEEDLE_LIFT] * MILLIMETRE,
        f.variables[VARIABLE_OPEN] > 0.0, &c.seat, forced,
    )
    f.past[PAST_AREA] = forced.interval.end.area


cdef void _change_inputs(
    const Interval* interval, Knot knot, double rail, double lift, bint moves, const Seat* seat, Forced* forced
) noexcept nogil:
    """Add to the rail pressure [p_0] and the lift [m] of an interval; moves: as of `lifted`."""
    cdef bint bends = interval.start.area > 0.0 or knot.area > 0.0 or interval.end.area > 0.0
    start, end = &forced.interval.start, &forced.interval.end
    start.rail, end.rail = interval.start.rail + rail, interval.end.rail + rail
    start.area, end.area = lifted(interval.start.area, lift, moves, seat), lifted(interval.end.area, lift, moves, seat)
    forced.knot.share, forced.knot.area = knot.share if bends else 0.0, lifted(knot.area, lift, moves, seat)


cdef void _change_line(
    Coefficients* c, double stiffness_share, double inertance_share, double outflow, double loss
) noexcept nogil:
    """Multiply the line's stiffness and inertance by 1 + a share; set the outflow of its end, and its loss."""
    cdef double less = 1.0 / (1.0 + inertance_share) - 1.0
    cdef double* values = c.line.values
    cdef int64_t i
    for i in range(c.size):
        values[i] = values[i] * (1.0 + stiffness_share * c.of_stiffness[i]) * (1.0 + less * c.of_inertance[i])
    values[c.size - 2] = outflow
    values[c.size - 1] = loss


cdef double rate_after(const double* x, const Forced* forced) noexcept nogil:
    """The injection rate [m3/s] at the end of an interval under terms, x (n,) being the state there."""
    cdef Inputs u = forced.interval.end
    u.area = max(u.area, 0.0)
    return injection_rate(x, u, &forced.coefficients, &forced.network)


cdef double shown_under_terms(double shown, const Forced* forced, Forcing* f) noexcept nogil:
    """The pressure [p_0] recorded at the end of an interval, with terms of the sensor, of that which it would show.

    Terms of the sensor see that pressure: for what rings it must not be late.
    """
    cdef double duration, line_pressure
    c = &forced.coefficients
    if not f.past[PAST_OF_SENSOR] > 0.0:
        return shown
    duration = forced.interval.length
    line_pressure = (shown * c.pressure_scale + c.chamber_pressure) / MEGAPASCAL
    f.variables[VARIABLE_LINE_PRESSURE] = line_pressure
    if duration > 0.0:
        f.variables[VARIABLE_LINE_RATE] = (line_pressure - f.past[PAST_PRESSURE]) * MILLISECOND / duration
    run_program(f.program, f.first_of_sensor, f.rows, f.rows, f.variables, f.memory, duration / MILLISECOND, f.totals)
    return shown + f.totals[EQUATION_SENSOR] * MEGAPASCAL / c.pressure_scale


cdef bint is_shut_under_terms(const Forcing* f) noexcept nogil:
    """Whether no term held the needle open at the end of the last interval."""
    return f.past[PAST_AREA] <= 0.0


cdef double trusted_under_terms(double innovation, double interval, Forcing* f) noexcept nogil:
    """An innovation as it corrects the state, less what the sensor rings: with that the gain fed the resonance."""
    if not f.past[PAST_OF_SENSOR] > 0.0:
        return innovation
    return without_ringing(f.program, f.first_of_sensor, f.rows, f.memory, innovation, interval / MILLISECOND)


cdef void _observe(
    const double* x, const Interval* interval, const Coefficients* c, const Network* network, Forcing* f
) noexcept nogil:
    """Work out the variables of laws, in printed units, by the state x (n,) at the start of an interval.

    Inputs are those in its middle, as pressure and flow of a lump. In an interval of no length rates and times stay.
    """
    cdef double duration = interval.length / MILLISECOND
    cdef double* past = f.past
    cdef double* seen = f.variables
    cdef double q_h = 0.0, q_s = 0.0, line_pressure, rise
    cdef double unit = c.pressure_scale / MEGAPASCAL, chamber = c.chamber_pressure / MEGAPASCAL
    cdef double through_nozzle = c.nozzle.flow / MM3_PER_MS
    cdef double[2] line
    cdef Inputs u = between(interval.start, interval.end, 0.5)
    u.rail = 0.5 * (interval.start.rail + interval.end.rail)
    u.area = 0.5 * (max(interval.start.area, 0.0) + max(interval.end.area, 0.0))
    cdef bint is_open = u.area > 0.0
    cdef double lift = lift_at(u.area, &c.seat) / MILLIMETRE
    if is_open and past[PAST_LIFT] <= 0.0:
        past[PAST_INJECTIONS] += 1.0
        past[PAST_SINCE] = 0.0
    if past[PAST_OF_FLOWS] > 0.0 and not is_at_rest(x, u):
        flows_with_phi(x, u, c, network, &q_h, &q_s)
    _line_in_middle(x, u, 0.5 * interval.length, c, network, f, line)
    line_pressure = line[0] * unit + chamber
    if duration > 0.0:
        rise = line_pressure - past[PAST_PRESSURE]
        seen[VARIABLE_LIFT_RATE] = (lift - past[PAST_LIFT]) / duration
        seen[VARIABLE_RAIL_RATE] = (interval.end.rail - interval.start.rail) * unit / duration
        seen[VARIABLE_LINE_RATE] = 0.0 if isnan(rise) else rise / duration
        past[PAST_LIFT], past[PAST_PRESSURE] = lift, line_pressure
    seen[VARIABLE_RAIL_PRESSURE] = u.rail * unit + chamber
    seen[VARIABLE_LINE_PRESSURE] = line_pressure
    seen[VARIABLE_SAC_PRESSURE] = x[SAC] * unit + chamber
    seen[VARIABLE_CHAMBER_PRESSURE] = chamber
    # friction and inertance act along a whole line: shut at its end it goes on ringing, and there nothing flows
    seen[VARIABLE_LINE_FLOW] = (mean_flow(x, c.cells) if c.cells > 0 else line[1]) * c.flow_scale / MM3_PER_MS
    seen[VARIABLE_SEAT_FLOW] = q_s * through_nozzle * c.sac.a5 / c.sac.a6
    seen[VARIABLE_NOZZLE_FLOW] = q_h * through_nozzle
    seen[VARIABLE_LIFT], seen[VARIABLE_MAX_LIFT] = lift, NAN  # the largest is a number in every program
    seen[VARIABLE_SINCE_OPENING], seen[VARIABLE_TIME] = past[PAST_SINCE], past[PAST_TIME]
    seen[VARIABLE_INJECTION_NUMBER] = max(past[PAST_INJECTIONS], 1.0)
    seen[VARIABLE_OPEN], seen[VARIABLE_CLOSED] = 1.0 if is_open else 0.0, 0.0 if is_open else 1.0
    seen[VARIABLE_OPENING] = 1.0 if is_open and seen[VARIABLE_LIFT_RATE] > 0.0 else 0.0
    seen[VARIABLE_CLOSING] = 1.0 if is_open and seen[VARIABLE_LIFT_RATE] < 0.0 else 0.0
    past[PAST_SINCE] += duration
    past[PAST_TIME] += interval.length


cdef void _line_in_middle(
    const double* x, Inputs u, double half, const Coefficients* c, const Network* network, const Forcing* f, double* line
) noexcept nogil:
    """Pressure and flow of a line half an interval [s] after the state x (n,), under the terms of the interval before.

    A law taken at the start would be late by that half; a line with waves is taken there all the same.
    """
    cdef Coefficients changed
    cdef double[4] rate
    line[0], line[1] = x[0], x[1]
    if c.kind != LUMP or half <= 0.0:
        return
    changed = c[0]
    _change_line(
        &changed, f.totals[EQUATION_STIFFNESS], f.totals[EQUATION_INERTANCE],
        f.totals[EQUATION_LINE_PRESSURE] * MM3_PER_MS / c.flow_scale,
        f.totals[EQUATION_LINE_FLOW] * MEGAPASCAL / c.pressure_scale,
    )
    rates_at(x, u, &changed, network, rate)
    line[0] += half * rate[0]
    line[1] += half * rate[1]


cdef double lift_at(double u_2, const Seat* seat) noexcept nogil:
    """The lift x_N [m] that opens a normalised seat area, the inverse of `normalised_area`; 0 for a shut needle."""
    cdef double lift, share
    cdef int64_t iteration
    if u_2 <= 0.0:
        return 0.0
    lift = _lift_of_area(u_2 * seat.area_scale, seat)
    if seat.loss != 0.0:
        for iteration in range(<int64_t> LIFT_ITERATIONS):
            share = 1.0 - seat.loss * exp(-lift / seat.loss_lift)
            lift = _lift_of_area(u_2 * seat.area_scale / share, seat)
    return lift


cdef inline double _lift_of_area(double area, const Seat* seat) noexcept nogil:
    """The lift [m] that opens a flow area [m2] of the seat."""
    cdef double bend = sin(2.0 * seat.half_cone_angle)
    cdef double scaled = area / (pi * sin(seat.half_cone_angle))
    return 2.0 * scaled / (seat.diameter + sqrt(max(seat.diameter * seat.diameter - 2.0 * bend * scaled, 0.0)))


cdef double lifted(double u_2, double lift, bint moves, const Seat* seat) noexcept nogil:
    """A normalised seat area with so much lift [m] added; a needle seen to be shut may stay so, or be held open.

    moves: whether the needle is on a ramp, whose foot a negative area is, see `between`.
    """
    cdef double measured, true
    if lift == 0.0:
        return u_2
    measured = lift_at(fabs(u_2), seat)
    true = lift + (measured if u_2 > 0.0 else (-measured if moves else 0.0))
    if u_2 <= 0.0 and true < LEAST_LIFT:
        return u_2
    return normalised_area(true, seat)
