"""The simulated injector: the model's equations (19)-(23) under wear and terms, in fine steps with the exact lift."""

from libc.math cimport INFINITY, fabs, isinf, tanh
from libc.stdint cimport int64_t

from observer_rt.core.model.hydraulics cimport normalised_area
from observer_rt.core.model.model cimport (
    Model, Terms, Weights, above_100_mpa, fine_step, rate_after, shown_under_terms, under_terms
)
from observer_rt.core.model.needle cimport CORNER_ROUNDING, NeedleStroke, lands, rounded_lift
from observer_rt.core.model.records cimport SAC, Coefficients, Forced, Forcing, Inputs, Interval, Knot, Network, inputs_of
from observer_rt.core.model.sensor cimport lagged
from observer_rt.core.model.valve cimport (
    LIFT_OFF, STAYS_AT_STOP, STOP_EDGE, Stroke, hold_valve, join_valve
)

cdef double BOUNCE_TIME = 60e-6  # s, from landing on
cdef double EMPTY_SAC = 1e-9  # of the pressure scale, below which a shut sac is at chamber pressure


# A simulation: what it is given, and where it is but for the state.
cdef struct Simulation:
    const Coefficients* coefficients
    const Network* network
    Forcing* forcing
    Forced forced
    double bounce  # m
    double delay, lag  # s, of the line-pressure sensor
    int64_t steps, samples, stroke_count  # steps: from a sample to the next
    const double* time  # (samples,), s
    const double* rail  # (samples,)
    const NeedleStroke* strokes
    int64_t number  # of the stroke under way or next
    NeedleStroke stroke, following
    double lift  # m
    Inputs u
    double indicated  # what the sensor shows
    int64_t due  # the first sample of the line pressure not recorded yet


cdef inline NeedleStroke _stroke(const Simulation* s, int64_t number) noexcept nogil:
    """A stroke by its number; past the last one the needle stays shut: a stroke that never begins."""
    cdef NeedleStroke never
    if number < s.stroke_count:
        return s.strokes[number]
    never.opening = never.top = never.closing = never.closed = never.landed = never.rebound = INFINITY
    never.opening_speed = never.closing_speed = never.bounce = 0.0
    return never


cdef inline double _lift_at(const Simulation* s, double time) noexcept nogil:
    """Lift [m] at a time [s] in or after the stroke, after which the needle bounces."""
    cdef double landed = (time - s.stroke.closed - 0.5 * CORNER_ROUNDING) / BOUNCE_TIME
    cdef double lift = rounded_lift(time, CORNER_ROUNDING, &s.stroke)
    return lift + 4.0 * s.bounce * landed * (1.0 - landed) if 0.0 < landed < 1.0 else lift


cdef inline Inputs _inputs_at(
    const Simulation* s, double time, double rail, double lift, double valve_lift
) noexcept nogil:
    """Inputs at a time [s] in or before the stroke; valve_lift: by which the valve knows the needle at its stop."""
    cdef Inputs u = inputs_of(rail, normalised_area(lift, &s.coefficients.seat))
    cdef double at_stop = valve_lift - (s.stroke.top - s.stroke.opening) * s.stroke.opening_speed + LIFT_OFF
    _open_valve(&u, time, &s.stroke, s.coefficients)
    _open_valve(&u, time, &s.following, s.coefficients)  # it may open for that already
    if u.servo.opening > 0.0 and s.stroke.closing - s.stroke.top > STAYS_AT_STOP:
        hold_valve(&u.servo, 0.5 * (1.0 + tanh(at_stop / (STOP_EDGE * LIFT_OFF))), &s.coefficients.valve)
    return u


cdef inline void _open_valve(Inputs* u, double time, const NeedleStroke* s, const Coefficients* c) noexcept nogil:
    """Have the pilot valve open for a stroke, if it does at this time [s]."""
    cdef Stroke lifted
    if isinf(s.opening) or (c.line.wave.drain.control_flow if c.cells > 0 else c.line.lump.drain.control_flow) == 0.0:
        return
    lifted.lifts, lifted.falls = s.opening + LIFT_OFF / s.opening_speed, s.closing + LIFT_OFF / s.closing_speed
    lifted.pressure = above_100_mpa(u.rail, c)
    join_valve(&u.servo, time, &lifted, &c.valve, 1.0, c.valve.edge)


cdef void _force(Simulation* s, const double* x, Inputs start, Inputs end, double length, double area) noexcept nogil:
    """Have `forced` be an interval [s] under the terms in force; area: in its middle."""
    cdef Interval interval
    cdef Knot knot
    interval.start, interval.end, interval.length, interval.substeps = start, end, length, 1
    knot.share, knot.area = 0.0, area
    under_terms(x, &interval, knot, s.coefficients, s.network, s.forcing, &s.forced)


cdef void _take_sample(Simulation* s, double* x, int64_t n, double* state, double* lift, double* rate) noexcept nogil:
    """Begin the interval after sample n, and note state (3,), lift and rate there."""
    cdef int64_t i
    lift[0] = s.lift = _lift_at(s, s.time[n])
    s.u = _inputs_at(s, s.time[n], s.rail[n], s.lift, s.lift)
    if s.u.area == 0.0 and fabs(x[SAC]) < EMPTY_SAC:
        x[SAC] = 0.0  # at rest, not decaying towards denormal numbers
    for i in range(3):
        state[i] = x[i]
    _force(s, x, s.u, s.u, 0.0, s.u.area)
    rate[0] = rate_after(x, &s.forced)


cdef inline void _begin_next_stroke(Simulation* s, double time) noexcept nogil:
    """Go on to the next stroke if this one is over at a time [s], its bounce included, or the next begins."""
    cdef double over = lands(&s.stroke) + CORNER_ROUNDING / 2.0 + (BOUNCE_TIME if s.bounce > 0.0 else 0.0)
    if time > min(over, s.following.opening - CORNER_ROUNDING / 2.0):
        s.number += 1
        s.stroke, s.following = s.following, _stroke(s, s.number + 1)


cdef void _take_step(Simulation* s, double* x, int64_t n, int64_t i, double* recorded) noexcept nogil:
    """Step the state by step i of those from sample n to the next, and record the line pressures that fall in it."""
    cdef double step = (s.time[n + 1] - s.time[n]) / s.steps, start = s.time[n] + i * step, shown = s.indicated
    cdef double rail = s.rail[n], rise = s.rail[n + 1] - s.rail[n], lift_before = s.lift, before = x[0]
    cdef double middle_rail = rail + (i + 0.5) / s.steps * rise, end_rail = rail + (i + 1.0) / s.steps * rise
    cdef Inputs middle, end
    _begin_next_stroke(s, start)
    s.lift = _lift_at(s, start + step)
    middle = _inputs_at(s, start + 0.5 * step, middle_rail, _lift_at(s, start + 0.5 * step), lift_before)
    end = _inputs_at(s, start + step, end_rail, s.lift, s.lift)
    s.u.servo.speed = middle.servo.speed = end.servo.speed = (s.lift - lift_before) / step
    _force(s, x, s.u, end, step, middle.area)
    middle.rail = middle.rail + s.forced.interval.end.rail - end.rail
    middle.area = s.forced.knot.area
    fine_step(x, s.forced.interval.start, middle, s.forced.interval.end, step, &s.forced.coefficients, &s.forced.network)
    s.indicated, s.u = lagged(shown, before, x[0], step, s.lag), end
    _record(s, start, step, s.time[n] + (i + 1) * step if i + 1 < s.steps else s.time[n + 1], shown, recorded)


cdef inline void _record(
    Simulation* s, double start, double step, double end, double shown, double* recorded
) noexcept nogil:
    """Record the samples due in a step [s], whose pressures are those of a delay before; shown: at its start."""
    cdef double added = shown_under_terms(s.indicated, &s.forced, s.forcing) - s.indicated, share
    while s.due < s.samples and s.time[s.due] - s.delay < end:
        share = max(s.time[s.due] - s.delay - start, 0.0) / step
        recorded[s.due] = shown + share * (s.indicated - shown) + added
        s.due += 1


def run_injector(
    double[::1] x, int64_t number, double indicated, int64_t due, int64_t first, int64_t last, const double[::1] time,
    const double[::1] rail, const double[:, ::1] strokes, int64_t steps, double bounce, Model model, Weights weights, sensor,
    Terms terms, double[:, ::1] states, double[::1] lift, double[::1] rate, double[::1] recorded
) -> tuple[int, float, int]:
    """Record samples first..last-1 and step the state x (n,) on to `last`; number: of the stroke under way or next.

    indicated: what the sensor shows; due: the first sample of the line pressure not recorded yet. time [s], rail,
    lift [m], rate [m3/s], recorded (k,); states (k, 3); strokes (m, fields): rows of `NeedleStroke`; bounce [m].
    """
    cdef Simulation s
    cdef int64_t n, i, samples = time.shape[0]
    fits = rail.shape[0] == lift.shape[0] == rate.shape[0] == recorded.shape[0] == states.shape[0] == samples
    fits = fits and strokes.shape[1] * sizeof(double) == sizeof(NeedleStroke)
    if not fits or x.shape[0] != model.coefficients.states or not 0 <= first <= last <= samples:
        raise ValueError("arrays of a simulation do not fit each other")
    if first == last:
        return number, indicated, due
    s.coefficients, s.network, s.forcing = &model.coefficients, &weights.network, &terms.forcing
    s.forced.coefficients, s.forced.network = model.coefficients, weights.network
    s.bounce, s.delay, s.lag, s.steps = bounce, sensor.delay, sensor.lag, steps
    s.samples, s.time, s.rail = samples, &time[0], &rail[0]
    s.stroke_count, s.strokes = strokes.shape[0], NULL
    if s.stroke_count:
        s.strokes = <const NeedleStroke*> &strokes[0, 0]
    s.number, s.stroke, s.following = number, _stroke(&s, number), _stroke(&s, number + 1)
    s.indicated, s.due = indicated, due
    with nogil:
        for n in range(first, last):
            _take_sample(&s, &x[0], n, &states[n, 0], &lift[n], &rate[n])
            for i in range(steps if n + 1 < samples else 0):
                _take_step(&s, &x[0], n, i, &recorded[0])
        if last == samples:
            recorded[s.due:] = shown_under_terms(s.indicated, &s.forced, s.forcing)
    return s.number, s.indicated, s.due


def show_slowly(const double[::1] values, double interval, double lag, double[::1] shown) -> None:
    """Values (n,) at every interval [s], at rest before, as a sensor of this lag [s] shows them, into `shown` (n,)."""
    cdef int64_t k
    if shown.shape[0] != values.shape[0]:
        raise ValueError("as many shown as there are values")
    if values.shape[0]:
        shown[0] = values[0]
    for k in range(1, values.shape[0]):
        shown[k] = lagged(shown[k - 1], values[k - 1], values[k], interval, lag)
