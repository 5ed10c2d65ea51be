"""The simulated injector: the model's equations under wear, in fine steps with the exact needle lift."""

from libc.math cimport INFINITY, fabs, isinf, tanh
from libc.stdint cimport int64_t

from observer_rt.core.model.hydraulics cimport normalised_area
from observer_rt.core.model.model cimport (
    Model, Terms, Weights, above_100_mpa, fine_step, rate_after, shown_under_terms, under_terms
)
from observer_rt.core.model.needle cimport CORNER_ROUNDING, NeedleStroke, lands, rounded_lift
from observer_rt.core.model.records cimport SAC, Coefficients, Forced, Inputs, Interval, Knot, inputs_of
from observer_rt.core.model.sensor cimport lagged
from observer_rt.core.model.valve cimport (
    LIFT_OFF, STAYS_AT_STOP, STOP_EDGE, VALVE_EDGE, Stroke, hold_valve, join_valve
)

cdef double BOUNCE_TIME = 60e-6  # s, from landing on
cdef double EMPTY_SAC = 1e-9  # of the pressure scale, below which a shut sac is at chamber pressure


cdef inline NeedleStroke _stroke(const double[:, ::1] strokes, int64_t number) noexcept nogil:
    """Row `number` of the table; past its end the needle stays shut: a stroke that never begins."""
    cdef NeedleStroke s
    if number >= strokes.shape[0]:
        s.opening = s.top = s.closing = s.closed = s.landed = INFINITY
        s.opening_speed = s.closing_speed = s.bounce = 0.0
        return s
    s.opening, s.top, s.closing = strokes[number, 0], strokes[number, 1], strokes[number, 2]
    s.closed, s.opening_speed, s.closing_speed = strokes[number, 3], strokes[number, 4], strokes[number, 5]
    s.bounce, s.landed = strokes[number, 6], strokes[number, 7]
    return s


cdef inline double _lift(double time, const NeedleStroke* s, double bounce) noexcept nogil:
    """Lift [m] at a time [s] in or after a stroke, after which the needle bounces by a lift [m]."""
    cdef double landed = (time - s.closed - 0.5 * CORNER_ROUNDING) / BOUNCE_TIME
    cdef double lift = rounded_lift(time, CORNER_ROUNDING, s)
    return lift + 4.0 * bounce * landed * (1.0 - landed) if 0.0 < landed < 1.0 else lift


cdef inline Inputs _inputs(double rail, double lift, const Coefficients* c) noexcept nogil:
    return inputs_of(rail, normalised_area(lift, &c.seat))


cdef inline void _open_valve(
    Inputs* u, double time, double lift, const NeedleStroke* s, const NeedleStroke* following, const Coefficients* c
) noexcept nogil:
    """The pilot valve at a time [s] in or before a stroke; it may open for the following one already."""
    cdef double at_stop = lift - (s.top - s.opening) * s.opening_speed + LIFT_OFF
    if (c.line.wave.servo if c.cells > 0 else c.line.lump.servo) == 0.0:
        return
    _open_for(u, time, s, c)
    _open_for(u, time, following, c)
    if u.servo.opening > 0.0 and s.closing - s.top > STAYS_AT_STOP:
        hold_valve(&u.servo, 0.5 * (1.0 + tanh(at_stop / (STOP_EDGE * LIFT_OFF))), &c.valve)


cdef inline void _open_for(Inputs* u, double time, const NeedleStroke* s, const Coefficients* c) noexcept nogil:
    cdef Stroke lifted
    if isinf(s.opening):
        return
    lifted.lifts, lifted.falls = s.opening + LIFT_OFF / s.opening_speed, s.closing + LIFT_OFF / s.closing_speed
    lifted.pressure = above_100_mpa(u.rail, c)
    join_valve(&u.servo, time, &lifted, &c.valve, 1.0, VALVE_EDGE)


def run_injector(
    double[::1] x, int64_t number, double indicated, int64_t due, int64_t first, int64_t last, const double[::1] time,
    const double[::1] rail, const double[:, ::1] strokes, int64_t steps, double bounce, Model model, Weights weights, sensor,
    Terms terms, double[:, ::1] states, double[::1] lift, double[::1] rate, double[::1] recorded
) -> tuple[int, float, int]:
    """Record samples first..last-1 and step the state x (n,) on to `last`; number: of the stroke under way or next.

    indicated: what the sensor shows; due: the first sample of the line pressure not recorded yet. time [s], rail,
    lift [m], rate [m3/s], recorded (k,); states (k, 3); strokes (m, 8); bounce [m].
    """
    cdef NeedleStroke s = _stroke(strokes, number), following = _stroke(strokes, number + 1)
    cdef Forced forced
    cdef Interval interval
    cdef Knot knot
    cdef Inputs u, middle, end_u
    cdef double delay = sensor.delay, lag = sensor.lag, step, start, before, shown, added, end, share, rail_middle, rail_end
    cdef double lift_before, lift_end, lasting = BOUNCE_TIME if bounce > 0.0 else 0.0
    cdef int64_t n, i, samples = time.shape[0]
    c = &model.coefficients
    f = &terms.forcing
    fits = rail.shape[0] == lift.shape[0] == rate.shape[0] == recorded.shape[0] == states.shape[0] == samples
    if not fits or strokes.shape[1] != 8 or x.shape[0] != c.states or not 0 <= first <= last <= samples:
        raise ValueError("arrays of a simulation do not fit each other")
    forced.coefficients, forced.network = model.coefficients, weights.network
    with nogil:
        for n in range(first, last):
            lift[n] = lift_end = _lift(time[n], &s, bounce)
            u = _inputs(rail[n], lift[n], c)
            _open_valve(&u, time[n], lift[n], &s, &following, c)
            if u.area == 0.0 and fabs(x[SAC]) < EMPTY_SAC:
                x[SAC] = 0.0  # at rest, not decaying towards denormal numbers
            for i in range(3):
                states[n, i] = x[i]
            interval.start = interval.end = u
            interval.length, interval.substeps = 0.0, 1
            knot.share, knot.area = 0.0, u.area
            under_terms(&x[0], &interval, knot, c, &weights.network, f, &forced)
            rate[n] = rate_after(&x[0], &forced)
            if n + 1 == samples:
                shown = shown_under_terms(indicated, &forced, f)
                for i in range(due, samples):
                    recorded[i] = shown
                break
            step = (time[n + 1] - time[n]) / steps
            for i in range(steps):
                start = time[n] + i * step
                if start > min(lands(&s) + CORNER_ROUNDING / 2.0 + lasting, following.opening - CORNER_ROUNDING / 2.0):
                    number += 1
                    s, following = following, _stroke(strokes, number + 1)
                rail_middle = rail[n] + (i + 0.5) / steps * (rail[n + 1] - rail[n])
                rail_end = rail[n] + (i + 1.0) / steps * (rail[n + 1] - rail[n])
                lift_before, lift_end = lift_end, _lift(start + step, &s, bounce)
                middle = _inputs(rail_middle, _lift(start + 0.5 * step, &s, bounce), c)
                end_u = _inputs(rail_end, lift_end, c)
                _open_valve(&middle, start + 0.5 * step, lift_before, &s, &following, c)
                _open_valve(&end_u, start + step, lift_end, &s, &following, c)
                u.servo.speed = middle.servo.speed = end_u.servo.speed = (lift_end - lift_before) / step
                before, shown = x[0], indicated
                interval.start, interval.end, interval.length = u, end_u, step
                knot.area = middle.area
                under_terms(&x[0], &interval, knot, c, &weights.network, f, &forced)
                middle.rail = middle.rail + forced.interval.end.rail - end_u.rail
                middle.area = forced.knot.area
                fine_step(
                    &x[0], forced.interval.start, middle, forced.interval.end, step, &forced.coefficients, &forced.network
                )
                indicated = lagged(shown, before, x[0], step, lag)
                added = shown_under_terms(indicated, &forced, f) - indicated
                end = time[n] + (i + 1) * step if i + 1 < steps else time[n + 1]
                while due < samples and time[due] - delay < end:
                    share = max(time[due] - delay - start, 0.0) / step
                    recorded[due] = shown + share * (indicated - shown) + added
                    due += 1
                u = end_u
    return number, indicated, due


def show_slowly(const double[::1] values, double interval, double lag, double[::1] shown) -> None:
    """Values (n,) at every interval [s], at rest before, as a sensor of this lag [s] shows them, into `shown` (n,)."""
    cdef int64_t k
    if shown.shape[0] != values.shape[0]:
        raise ValueError("as many shown as there are values")
    if values.shape[0]:
        shown[0] = values[0]
    for k in range(1, values.shape[0]):
        shown[k] = lagged(shown[k - 1], values[k - 1], values[k], interval, lag)
