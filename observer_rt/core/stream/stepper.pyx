"""Stepper of the pair x~ and x^ from sample to sample: the only part of the stream that knows line and phi."""

from libc.math cimport NAN, fabs, isfinite, pow, sqrt
from libc.stdint cimport int32_t, int64_t
from libc.string cimport memcpy, memset

from numpy import zeros

from observer_rt.core.model.model cimport (
    Model, Terms, above_100_mpa, advance_over, begin_strokes, correct, follow_stroke, is_shut_under_terms, needle_speed,
    predict, rate_and_phi, rate_slopes, rest_line, shown_under_terms, trusted_under_terms, under_terms, valve_at
)
from observer_rt.core.model.records cimport (
    BY_LINE, BY_NOZZLE, BY_SEAT, PAST_NUMBERS, SAC, TOTALS, Coefficients, FlowSlopes, Forced, Forcing, Gradient, Inputs,
    Interval, Knot, Network, Tangent, inputs_of, opened_since
)
from observer_rt.core.model.needle cimport NEEDLE_JITTER, NEEDLE_NUMBERS, OPENING_DELAY
from observer_rt.core.model.sensor cimport SENSOR_NUMBERS
from observer_rt.core.model.valve cimport VALVE_TAIL, Stroke, valve_edge
from observer_rt.core.stream.filter_bank cimport (
    EXPLANATIONS, NUMBERS, OF_CLOSING, OF_DELAY, OF_FRICTION, OF_LAG, OF_NOZZLE, OF_OFFSET, OF_SEAT, OF_SLOPE,
    OF_STIFFNESS, STRETCHES, UNUSED, FilterBank, Widths, begin_anew, begin_bank, begin_stretch, correct_filters,
    forget_stretch, mix_filters, moved_by, newest_of, variance_by, widen_flow, widen_past_flow
)
from observer_rt.core.stream.operating_point cimport BELIEVED, falls, is_shown
from observer_rt.core.stream.state cimport (
    COMMANDS, MASK, RAIL, STEPPING_CORRECT, STEPPING_PREDICT, OperatingPoint, Sample
)
from observer_rt.core.stream.stream cimport Stream

cdef double LONGEST_RERUN = 2e-3  # s before a sample, from which on the pair is run again at most


cdef class Stepper(PairStepper):
    """An observer's model by its constants, `engine.stream.state.Constants`, on the memory of its stream."""

    def __init__(self, Stream stream, constants) -> None:
        cdef Model model = Model(constants.coefficients)
        s, memory, program = &self.stepping, stream.observer.memory, constants.program
        if model.coefficients.states != stream.observer.states:
            raise ValueError(f"a model of {model.coefficients.states} states for {stream.observer.states} of the observer")
        self.stream = stream
        self.terms_of_tilde, self.terms_of_hat = Terms(program), Terms(program)
        s.coefficients = s.forced.coefficients = model.coefficients
        s.network.curves, s.network.bias = &memory.in_force.curves[0][0], memory.in_force.bias
        s.network.nozzle = memory.in_force.nozzle
        s.forced.network = s.network
        s.fraction, s.interval, s.substeps = constants.sensor.fraction, constants.interval, constants.substeps
        begin_strokes(&s.strokes)
        s.command = s.command_before = s.strokes.last
        s.observer = &stream.observer
        s.of_tilde, s.of_hat = &self.terms_of_tilde.forcing, &self.terms_of_hat.forcing
        rows = 2 * (LIVE_ROWS * model.coefficients.states + 8) + SENSOR_NUMBERS + 3
        self.scratch = zeros((rows, NUMBERS))
        s.live.together = max(1, round(constants.coefficients.line.resolved / constants.interval))
        _lend_live(s, self.scratch)
        self.step, self.stepper = step, s

    def go_on_from(self, Stepper before) -> None:
        """Remember of the terms in force what the stepper before did."""
        if before.terms_of_tilde.forcing.rows != self.terms_of_tilde.forcing.rows:
            raise ValueError("other terms than before")
        self.terms_of_tilde, self.terms_of_hat = before.terms_of_tilde, before.terms_of_hat
        self.scratch = before.scratch
        s = &self.stepping
        s.strokes, s.started, s.commands = before.stepping.strokes, before.stepping.started, before.stepping.commands
        s.command, s.command_before = before.stepping.command, before.stepping.command_before
        s.of_tilde, s.of_hat = &self.terms_of_tilde.forcing, &self.terms_of_hat.forcing
        s.live = before.stepping.live
        _lend_live(s, self.scratch)


cdef double step(void* stepper, int64_t what, int64_t position) noexcept nogil:
    """Start the pair at a sample, predict x~ there, or correct x~ and step x^: what, one of STEPPING_.

    PREDICT returns the line pressure that should be recorded, CORRECT NaN if a state is no longer finite, else 0.
    After START and CORRECT the sample's row has injection rate and phi of x^.
    """
    s = <Stepping*> stepper
    if what == STEPPING_PREDICT:
        return _predict(s, position)
    if what == STEPPING_CORRECT:
        return _correct(s, position)
    _start(s, position)
    return 0.0


cdef inline double* _x_tilde(Stepping* s, int64_t position) noexcept nogil:
    return s.observer.x_tilde + (position & MASK) * s.observer.states


cdef inline double* _x_hat(Stepping* s, int64_t position) noexcept nogil:
    return s.observer.x_hat + (position & MASK) * s.observer.states


cdef inline void _take_line(Stepping* s) noexcept nogil:
    """Take the line's coefficients that are in force now."""
    cdef size_t size = s.coefficients.size * sizeof(double)
    memcpy(s.coefficients.line.values, s.observer.memory.in_force.line, size)
    memcpy(s.forced.coefficients.line.values, s.observer.memory.in_force.line, size)


cdef inline void _force(
    Stepping* s, int64_t position, const double* x, const Network* network, Forcing* forcing
) noexcept nogil:
    """Fill `forced` with the interval before a sample, from a state x (n,) on, under the terms in force."""
    cdef Interval interval
    cdef Knot knot
    before, row = &s.observer.ring[(position - 1) & MASK], &s.observer.ring[position & MASK]
    interval.start, interval.end = inputs_of(before.rail_pressure, before.seat_area), inputs_of(row.rail_pressure, row.seat_area)
    interval.start.servo.opening, interval.end.servo.opening = before.valve, row.valve
    interval.end.servo.speed = needle_speed(before.seat_area, row.seat_area, s.interval, &s.coefficients.seat)
    interval.start.since = opened_since(before.opened_since, before.seat_area, row.seat_area)
    interval.end.since = row.opened_since = interval.start.since + s.interval
    interval.length, interval.substeps = s.interval, s.substeps
    if s.live.follows:  # the area is less by so much with a needle 1 s later
        interval.start.by_needle[OPENING_DELAY] = (before.seat_area - row.seat_area) / s.interval
        interval.end.by_needle[OPENING_DELAY] = interval.start.by_needle[OPENING_DELAY]
    knot.share, knot.area = before.lift_after, before.lift_area
    under_terms(x, &interval, knot, &s.coefficients, network, forcing, &s.forced)


cdef inline void _go_on_as(Forcing* forcing, const Forcing* other) noexcept nogil:
    """Have terms go on with what they remember for another state."""
    memcpy(forcing.past, other.past, PAST_NUMBERS * sizeof(double))
    memcpy(forcing.totals, other.totals, TOTALS * sizeof(double))
    if other.rows > 0:
        memcpy(forcing.memory, other.memory, 3 * other.rows * sizeof(double))


cdef void _start(Stepping* s, int64_t position) noexcept nogil:
    """Begin x~ and x^ anew: p_L = y, Q_L = 0, empty sac."""
    cdef int64_t i
    row = &s.observer.ring[position & MASK]
    x_tilde = _x_tilde(s, position)
    _take_line(s)
    begin_strokes(&s.strokes)
    s.started = position
    row.valve = 0.0
    rest_line(x_tilde, row.indicated, &s.coefficients)
    x_tilde[SAC] = 0.0
    memcpy(_x_hat(s, position), x_tilde, s.observer.states * sizeof(double))
    for i in range(3 * s.of_tilde.rows):
        s.of_tilde.memory[i] = NAN
    memset(s.of_tilde.totals, 0, TOTALS * sizeof(double))
    s.live.follows = False
    _read(s, position, &s.coefficients, &s.network)
    row.open_loop_rate, row.rate_sigma, row.as_believed = row.injection_rate, NAN, 1.0


cdef double _predict(Stepping* s, int64_t position) noexcept nogil:
    """Predict x~ from the sample before; returns the line pressure that should be recorded."""
    _take_line(s)
    if _follow_valve(s, position):
        _run_again(s, position)
    _look_for_opening(s, position)
    return _predict_sample(s, position, _gradient(s))


cdef bint _follow_valve(Stepping* s, int64_t position) noexcept nogil:
    """Follow the pilot valve to a sample by lift or commands; whether they show that it stood otherwise before."""
    cdef bint is_shown
    ring, in_force = s.observer.ring, &s.observer.memory.in_force
    before, row = &ring[(position - 1) & MASK], &ring[position & MASK]
    is_shown = follow_stroke(
        &s.strokes, position, before.seat_area, row.seat_area, above_100_mpa(row.rail_pressure, &s.coefficients),
        s.interval, &s.coefficients.seat,
    )
    if in_force.watch_later == 0:  # there is no control flow
        row.valve = 0.0
        return False
    if in_force.valve.commanded != 0.0:
        is_shown = _follow_commands(s, position)
    row.valve = _valve_at(s, position)
    return is_shown and s.of_tilde.rows == 0


cdef bint _follow_commands(Stepping* s, int64_t position) noexcept nogil:
    """Take in the commands up to a sample; whether they show that the valve stood otherwise before."""
    cdef bint is_shown = False
    cdef Stroke stroke
    commands = &s.observer.memory.commands
    s.commands = max(s.commands, commands.count - COMMANDS)
    if s.commands > 0:
        stroke = _command(s, s.commands - 1, position)
        if stroke.falls != s.command.falls:  # its end has become known
            is_shown, s.strokes.edge = True, min(stroke.falls, s.command.falls)
        s.command = stroke
    while s.commands < commands.count:
        stroke = _command(s, s.commands, position)
        if stroke.lifts > position + VALVE_TAIL * valve_edge(&s.observer.memory.in_force.valve, s.interval):
            break
        s.strokes.edge = min(s.strokes.edge, stroke.lifts) if is_shown else stroke.lifts
        is_shown, s.commands = True, s.commands + 1
        s.command_before, s.command = s.command, stroke
    return is_shown


cdef inline Stroke _command(Stepping* s, int64_t number, int64_t position) noexcept nogil:
    """The command of a number, in positions by the index of a sample, which is counted modulo 2^32."""
    cdef int64_t place = number % COMMANDS
    cdef Stroke result
    commands = &s.observer.memory.commands
    result.lifts = position + <int32_t> (commands.starts[place] - s.observer.ring[position & MASK].index)
    result.falls, result.pressure = result.lifts + commands.lengths[place], 1.0
    return result


cdef inline double _valve_at(Stepping* s, int64_t position) noexcept nogil:
    """Opening of the valve at a sample, by the lift or the commands known so far."""
    cdef double area = s.observer.ring[position & MASK].seat_area
    valve = &s.observer.memory.in_force.valve
    if valve.commanded != 0.0:
        return valve_at(position, area, &s.command_before, &s.command, &s.strokes, valve, s.interval)
    return valve_at(position, area, &s.strokes.before, &s.strokes.last, &s.strokes, valve, s.interval)


cdef void _run_again(Stepping* s, int64_t position) noexcept nogil:
    """Run the pair once more over the samples in which the valve, as this sample shows, stood otherwise.

    Published rates stay. It is left out where terms are in force, which remember what they saw.
    """
    cdef int64_t earliest = max(s.started + 1, position - <int64_t> (LONGEST_RERUN / s.interval)), k
    cdef double before, shown, pressure
    valve, ring = &s.observer.memory.in_force.valve, s.observer.ring
    pressure = s.strokes.last.pressure if valve.commanded == 0.0 else 1.0
    before = max(valve.start, valve.end) * pow(pressure, -valve.exponent) / s.interval
    before += VALVE_TAIL * valve_edge(valve, s.interval)
    for k in range(max(earliest, <int64_t> (s.strokes.edge - before)), position):
        row = &ring[k & MASK]
        row.valve = _valve_at(s, k)
        shown = _predict_sample(s, k, NULL)
        if row.innovation != 0.0:
            y = ring[(k + s.observer.constants.sensor.late) & MASK].line_pressure
            row.innovation = y - s.observer.memory.pair.offset - shown
        _move_pair(s, k, NULL)


cdef double _predict_sample(Stepping* s, int64_t position, Gradient* gradient) noexcept nogil:
    """Predict x~ from the sample before, with the valve as rows have it; returns as `_predict`."""
    cdef double indicated = s.observer.ring[(position - 1) & MASK].indicated, shown
    x_tilde = _x_tilde(s, position)
    memcpy(x_tilde, _x_tilde(s, position - 1), s.observer.states * sizeof(double))
    _force(s, position, x_tilde, &s.network, s.of_tilde)
    shown = predict(x_tilde, &indicated, &s.forced, s.fraction, s.observer.memory.in_force.sensor, gradient)
    s.observer.ring[position & MASK].indicated = indicated
    return shown_under_terms(shown, &s.forced, s.of_tilde)


cdef double _correct(Stepping* s, int64_t position) noexcept nogil:
    """Correct x~ by the sample's innovation, step x^ and note its rate; NaN if a state is no longer finite."""
    cdef double total = 0.0
    cdef int64_t i
    _move_pair(s, position, _gradient(s))
    if s.observer.ring[position & MASK].resting:
        _read(s, position, &s.coefficients, &s.network)
    else:
        _read(s, position, &s.forced.coefficients, &s.forced.network)
    _follow_live(s, position)
    x_tilde, x_hat = _x_tilde(s, position), _x_hat(s, position)
    for i in range(s.observer.states):
        total += x_hat[i] + x_tilde[i]
    return 0.0 if isfinite(total) else NAN


cdef void _move_pair(Stepping* s, int64_t position, Gradient* gradient) noexcept nogil:
    """Correct x~ by the sample's innovation, and step x^; gradient: carried along with x~, NULL: none with either.

    With the needle long shut x^ := x~, the sac at chamber pressure but for a term; else x^ runs open loop.
    """
    cdef double trusted
    cdef int64_t states = s.observer.states
    row = &s.observer.ring[position & MASK]
    x_tilde, x_hat = _x_tilde(s, position), _x_hat(s, position)
    gain = s.observer.gains + min(s.observer.memory.pair.since_start, s.observer.gain_rows - 1) * states
    trusted = trusted_under_terms(row.innovation, s.interval, s.of_tilde)
    correct(x_tilde, &row.indicated, trusted, gain, states, gradient)
    _take_line(s)
    if row.resting:
        if is_shut_under_terms(s.of_tilde):
            x_tilde[SAC] = 0.0
        memcpy(x_hat, x_tilde, states * sizeof(double))
        _go_on_as(s.of_hat, s.of_tilde)
    else:
        memcpy(x_hat, _x_hat(s, position - 1), states * sizeof(double))
        _force(s, position, x_hat, &s.network, s.of_hat)
        of_hat = NULL if gradient == NULL else &s.live.of_hat
        advance_over(x_hat, &s.forced.interval, s.forced.knot, &s.forced.coefficients, &s.forced.network, of_hat)


cdef void _read(Stepping* s, int64_t position, const Coefficients* c, const Network* network) noexcept nogil:
    """Write injection rate and phi of x^ into a sample's row; both are 0 at rest with an empty sac."""
    cdef Inputs u
    row, x_hat = &s.observer.ring[position & MASK], _x_hat(s, position)
    row.phi[0] = row.phi[1] = row.phi[2] = 0.0
    row.injection_rate = 0.0
    if not row.resting or x_hat[SAC] != 0.0:  # a term may hold the needle open
        u = inputs_of(row.rail_pressure, max(row.seat_area, 0.0))
        u.since = row.opened_since
        row.injection_rate = s.observer.memory.in_force.flow_factor * rate_and_phi(x_hat, u, c, network, row.phi)


include "live.pxi"
