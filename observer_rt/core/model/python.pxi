# Functions of the model that Python calls.

from numpy import asarray, ascontiguousarray, full, zeros


cdef class Model:
    """The coefficients of a `model.effective.Coefficients`, as loops of the core have them."""

    def __init__(self, coefficients) -> None:
        _fill(&self.coefficients, coefficients)


cdef class Weights:
    """A `model.network.Network`, lent: what is written into its arrays counts at once."""

    def __init__(self, network) -> None:
        cdef double[:, :, ::1] curves = network.curves
        cdef double[::1] bias = network.bias, nozzle = network.nozzle
        n = &self.network
        fits = bias.shape[0] == 2 and nozzle.shape[0] == NOZZLE_NUMBERS
        if curves.shape[0]:
            fits = fits and curves.shape[0] == CURVES and curves.shape[1] == PIECES and curves.shape[2] == 4
            n.curves = &curves[0, 0, 0]
        if not fits:
            raise ValueError("weights of a network do not fit each other")
        n.bias, n.nozzle = &bias[0], &nozzle[0]
        self.lent = (network.curves, network.bias, network.nozzle)


cdef class Terms:
    """A program of terms (n, 2) about to begin, the needle shut, at a time [s] after so many injections."""

    def __init__(self, program, double time=0.0, double injections=0.0) -> None:
        cdef const double[:, ::1] rows = program
        memory, scratch = full(3 * len(program), NAN), zeros(PAST_NUMBERS + 2 + NOZZLE_NUMBERS + VARIABLES + TOTALS)
        cdef double[::1] of_memory = memory, of_scratch = scratch
        f = &self.forcing
        f.rows = rows.shape[0]
        if f.rows:
            f.program, f.memory = &rows[0, 0], &of_memory[0]
        f.past, f.bias = &of_scratch[0], &of_scratch[PAST_NUMBERS]
        f.nozzle = f.bias + 2
        f.variables = f.nozzle + NOZZLE_NUMBERS
        f.totals = f.variables + VARIABLES
        self.lent = (program, memory, scratch)
        begin_forcing(f, time, injections)


cdef class Carried:
    """A `model.tangent.Tangent`, lent."""

    def __init__(self, tangent) -> None:
        cdef double[:, ::1] by = tangent.by, moved = tangent.moved
        cdef double[:, :, ::1] by_state = tangent.by_state, by_number = tangent.by_number
        cdef double[:, :, ::1] by_flow = tangent.by_flow, of_flows = tangent.of_flows
        cdef double[:, ::1] by_coefficient = tangent.by_coefficient
        cdef const unsigned char[::1] parts = tangent.parts
        cdef const double[:, :, :, ::1] basis = tangent.theta.basis
        cdef const int64_t[::1] neurons = tangent.theta.neurons
        cdef const int64_t[::1] columns = tangent.theta.line_columns, coefficients = tangent.theta.line_coefficients
        cdef const int64_t[::1] nozzle = tangent.theta.nozzle
        cdef const double[::1] slopes = tangent.theta.line_slopes, sizes = tangent.theta.valve_sizes
        cdef const int64_t[::1] valve = tangent.theta.valve, needle = tangent.theta.needle
        cdef const double[::1] needle_sizes = tangent.theta.needle_sizes
        t = &self.tangent
        t.n, t.m, t.size = by.shape[0], by.shape[1], by_coefficient.shape[1]
        fits = (
            moved.shape[0] == t.n and moved.shape[1] == t.m and t.m % WIDTH == 0
            and by_state.shape[0] == 4 and by_state.shape[1] == t.n and by_state.shape[2] == WIDTH
            and by_number.shape[0] == 4 and by_number.shape[1] == t.n and by_number.shape[2] == t.m
            and by_flow.shape[0] == 4 and by_flow.shape[1] == t.n and by_flow.shape[2] == 2
            and of_flows.shape[0] == 4 and of_flows.shape[1] == 2 and of_flows.shape[2] == t.m
            and parts.shape[0] == t.m // WIDTH and by_coefficient.shape[0] == t.n
            and neurons.shape[0] == basis.shape[0] == CURVES and basis.shape[1] == PIECES
            and basis.shape[2] == 4 and basis.shape[3] == MOST_NEURONS
            and columns.shape[0] == coefficients.shape[0] == slopes.shape[0] and nozzle.shape[0] == NOZZLE_NUMBERS
            and valve.shape[0] == sizes.shape[0] == VALVE_NUMBERS
            and needle.shape[0] == needle_sizes.shape[0] == NEEDLE_NUMBERS
        )
        if not fits:
            raise ValueError("arrays of a tangent do not fit each other")
        t.by, t.moved, t.by_state, t.by_number = &by[0, 0], &moved[0, 0], &by_state[0, 0, 0], &by_number[0, 0, 0]
        t.by_flow, t.of_flows, t.parts = &by_flow[0, 0, 0], &of_flows[0, 0, 0], &parts[0]
        t.by_coefficient, t.basis, t.neurons = &by_coefficient[0, 0], &basis[0, 0, 0, 0], &neurons[0]
        theta = &t.theta
        theta.nozzle_bias, theta.nozzle_weight = tangent.theta.nozzle_bias, tangent.theta.nozzle_weight
        theta.seat_bias, theta.seat_weight = tangent.theta.seat_bias, tangent.theta.seat_weight
        theta.nozzle = &nozzle[0]
        theta.valve, theta.valve_sizes = &valve[0], &sizes[0]
        theta.needle, theta.needle_sizes = &needle[0], &needle_sizes[0]
        theta.shots, theta.first_shot = tangent.theta.shots, tangent.theta.first_shot
        theta.pairs = slopes.shape[0]
        if theta.pairs:
            theta.columns, theta.coefficients, theta.slopes = &columns[0], &coefficients[0], &slopes[0]
        self.lent = (tangent,)


cdef void _fill(Coefficients* c, coefficients) except *:
    line = coefficients.line
    cdef int64_t i
    if len(line) > MOST_COEFFICIENTS:
        raise ValueError(f"a line of {len(line)} coefficients, at most {MOST_COEFFICIENTS}")
    c.cells = int(line.cells) if "cells" in line._fields else 0
    c.kind, c.is_mean, c.states, c.size = line.kind, line.averaged, 3 + line.further, len(line)
    for i, name in enumerate(line._fields):
        c.line.values[i] = line[i]
        c.of_stiffness[i], c.of_inertance[i] = name in line.of_stiffness, name in line.of_inertance
    c.seat, c.nozzle, c.sac = coefficients.seat._asdict(), coefficients.nozzle._asdict(), coefficients.sac._asdict()
    c.valve = coefficients.valve._asdict()
    c.pressure_scale, c.flow_scale = coefficients.pressure_scale, coefficients.flow_scale
    c.area_scale, c.chamber_pressure = coefficients.area_scale, coefficients.chamber_pressure
    c.density, c.compression = coefficients.density, coefficients.compression


cdef Inputs _inputs(u) except *:
    cdef Inputs result = inputs_of(u[0], u[1])
    result.since = u[2] if len(u) > 2 else 0.0
    return result


cdef void _require_states(const double[::1] x, const Coefficients* c) except *:
    if x.shape[0] != c.states:
        raise ValueError(f"{x.shape[0]} states, {c.states} are wanted")


cdef const double[::1] _state(x):
    cdef const double[::1] numbers = ascontiguousarray(x, "f8")
    if numbers.shape[0] < 3:
        raise ValueError(f"{numbers.shape[0]} states, at least 3 are wanted")
    return numbers


def advance_state(double[::1] x, interval, coefficients, network, tangent=None, knot=(0.0, 0.0)) -> None:
    """State x (n,) one `Interval` later, in place.

    knot: share (0..1) of the interval after which the area bends, and the normalised area there; a share of 0: it does
    not. tangent: the `Tangent` that moves with it, None for none.
    """
    cdef Model model = Model(coefficients)
    cdef Weights weights = Weights(network)
    cdef Carried carried = None if tangent is None else Carried(tangent)
    cdef Interval of_interval
    cdef Knot at
    _require_states(x, &model.coefficients)
    of_interval.start, of_interval.end = _inputs(interval.start), _inputs(interval.end)
    of_interval.length, of_interval.substeps = interval.length, interval.substeps
    at.share, at.area = knot
    advance_over(
        &x[0], &of_interval, at, &model.coefficients, &weights.network, NULL if carried is None else &carried.tangent
    )


def rest_state(double[::1] x, double pressure, coefficients) -> None:
    """The line's states in x (n,) become those of a line at rest at a normalised pressure; p_S is left."""
    cdef Model model = Model(coefficients)
    _require_states(x, &model.coefficients)
    rest_line(&x[0], pressure, &model.coefficients)


def rates_of_change(x, u, coefficients, network, tangent=None) -> list[float]:
    """x' = f + phi of (25)-(26) [1/s] of a lump, x (3,) or (4,) with its mean; tangent: gets the derivatives."""
    cdef const double[::1] state = _state(x)
    cdef Model model = Model(coefficients)
    cdef Weights weights = Weights(network)
    cdef Carried carried
    cdef double[4] rate
    cdef int n = <int> model.coefficients.states
    _require_states(state, &model.coefficients)
    if model.coefficients.cells:
        raise ValueError("a line of cells has no rates: it is stepped")
    if tangent is None:
        right_hand_side(&state[0], _inputs(u), &model.coefficients, &weights.network, rate, n)
    else:
        carried = Carried(tangent)
        tangent_rates(&state[0], _inputs(u), &model.coefficients, &weights.network, &carried.tangent, 0, rate, n)
    return [rate[i] for i in range(n)]


def slopes_of_flows(x, u, coefficients, network) -> dict[str, Any]:
    """Flows with phi and their derivatives, by name."""
    cdef const double[::1] state = _state(x)
    cdef Model model = Model(coefficients)
    cdef Weights weights = Weights(network)
    cdef FlowSlopes found
    cdef Inputs of_u = _inputs(u)
    flow_slopes(&state[0], &of_u, &model.coefficients, &weights.network, &found)
    return found


def phi_and_rate(x, u, coefficients, network) -> tuple[tuple[float, float, float], float]:
    """phi(x, u) of (2), (27), its three rows [1/s], and the injection rate Q_H^ [m3/s]."""
    cdef const double[::1] state = _state(x)
    cdef Model model = Model(coefficients)
    cdef Weights weights = Weights(network)
    cdef double[3] phi
    rate = rate_and_phi(&state[0], _inputs(u), &model.coefficients, &weights.network, phi)
    return (phi[0], phi[1], phi[2]), rate


def totals_of_terms(
    const double[:, ::1] program, const double[:, ::1] variables, double[::1] memory, double interval_ms
) -> NDArray[np.float64]:
    """What a program (n, 2) makes of many moments: variables (k, 19) in the units of `Variable`; totals (k, 10).

    memory (3 n,): what rows remember, nan: nothing yet; moves on by `interval_ms` from moment to moment.
    """
    totals = zeros((variables.shape[0], TOTALS))
    cdef double[:, ::1] result = totals
    cdef int64_t k, rows = program.shape[0]
    if variables.shape[1] != VARIABLES or memory.shape[0] != 3 * rows:
        raise ValueError("variables or memory do not fit the program")
    for k in range(variables.shape[0] if rows else 0):
        run_program(&program[0, 0], 0, rows, rows, &variables[k, 0], &memory[0], interval_ms, &result[k, 0])
    return totals


globals().update(
    BY_LINE=BY_LINE, BY_NOZZLE=BY_NOZZLE, BY_SEAT=BY_SEAT, COLUMNS=WIDTH, CURVES=CURVES, FIRST_OF_SEAT=FIRST_OF_SEAT,
    FORGETTING=tuple(FORGETTING), HIGHEST_TOTAL=tuple(HIGHEST_TOTAL), INPUTS=INPUTS, LIFT_OFF=LIFT_OFF,
    LOWEST_TOTAL=tuple(LOWEST_TOTAL), MEMORIES=MEMORIES, MOST_NEURONS=MOST_NEURONS, NOZZLE_NUMBERS=NOZZLE_NUMBERS,
    PIECES=PIECES, REACH=tuple(REACH), SENSOR_NUMBERS=SENSOR_NUMBERS, STEP=WAVE_STEP, WEIGHTS=tuple(WEIGHTS),
)


# Named tuples of the numbers that Python gives, and an enum.
cdef double[MOST_COEFFICIENTS] _blank  # room for each of them
globals().update(
    InputTerms=tuple_of(__name__, "InputTerms", (<InputTerms*> _blank)[0]),
    LumpLine=tuple_of(__name__, "LumpLine", (<LumpLine*> _blank)[0]),
    Nozzle=tuple_of(__name__, "Nozzle", (<Nozzle*> _blank)[0]),
    Sac=tuple_of(__name__, "Sac", (<Sac*> _blank)[0]),
    Seat=tuple_of(__name__, "Seat", (<Seat*> _blank)[0]),
    Sensor=tuple_of(__name__, "Sensor", (<Sensor*> _blank)[0]),
    Valve=tuple_of(__name__, "Valve", (<Valve*> _blank)[0]),
    WaveLine=tuple_of(__name__, "WaveLine", (<WaveLine*> _blank)[0]),
    Operation=enum_of(
        __name__, "Operation", ADD=OP_ADD, SUBTRACT=OP_SUBTRACT, MULTIPLY=OP_MULTIPLY, DIVIDE=OP_DIVIDE, POWER=OP_POWER,
        GREATER=OP_GREATER, LESS=OP_LESS, NEGATE=OP_NEGATE, SQRT=OP_SQRT, ABS=OP_ABS, EXP=OP_EXP, LOG=OP_LOG, SIN=OP_SIN,
        COS=OP_COS, TANH=OP_TANH, MIN=OP_MIN, MAX=OP_MAX
    ),
)


def inputs_along(int curve) -> tuple[int, int]:
    """Numbers of both inputs of a curve of the network."""
    return ALONG[curve][0], ALONG[curve][1]


def steps_in(double interval) -> int:
    """Steps of a wave's line in an interval [s]."""
    return steps_over(interval)


def fading_of(int64_t number, double step) -> tuple[float, float]:
    """What a step [s] keeps of w_(number + 1), and what it takes of a change of the mean flow."""
    cdef double take = 0.0
    keep = fading(number, step, &take)
    return keep, take


def pull_of(int64_t number, double step, double memory) -> tuple[float, float]:
    """Pull [1/s] in the middle of a step [s] by w_(number + 1) before it, and by the change of flow in it."""
    cdef double by_flow = 0.0
    by_memory = pull_in_middle(number, step, memory, &by_flow)
    return by_memory, by_flow


def value_across_joint(double share, double far, double near) -> float:
    """Inertia of a face or compliance of a cell, of which a share (0 to 1) is on the far side of the joint."""
    return across_joint(share, far, near)
