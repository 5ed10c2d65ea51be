"""The identification system x~ and the observer x^ over an event's samples, with their derivatives by theta."""

from libc.math cimport floor
from libc.stdint cimport int64_t

from numpy import array, zeros, zeros_like

from observer_rt.core.learning.matrices cimport propagate
from observer_rt.core.model.hydraulics cimport Seat, sac_stiffness, seat_area_slope
from observer_rt.core.model.model cimport (
    Carried, Model, Terms, Weights, begin_forcing, correct, empty_sac, predict, rate_after, rate_slopes, servos_over,
    shown_under_terms, trusted_under_terms, under_terms
)
from observer_rt.core.model.needle cimport NEEDLE_NUMBERS
from observer_rt.core.model.records cimport (
    SAC, Coefficients, FlowSlopes, Forced, Gradient, Inputs, Interval, Knot, Tangent, inputs_of, opened_since
)
from observer_rt.core.model.sensor cimport SENSOR_NUMBERS, LaggedSlopes, lagged_slopes
from observer_rt.core.model.valve cimport Servo


cdef class _Followed:
    """A window's samples and a model, as `follow` goes along them."""

    cdef const double[:, :] inputs, knots, by_needle
    cdef const double[:] output
    cdef const double[:, ::1] servos
    cdef const unsigned char[:] resting, masked
    cdef const int64_t[:] shots
    cdef Model model
    cdef Weights weights
    cdef Terms terms
    cdef Forced forced
    cdef Interval interval

    def __init__(self, window, setting, learned, Terms terms) -> None:
        self.inputs, self.output, self.resting = window.inputs, window.output, window.resting.view("u1")
        self.knots, self.masked, self.by_needle = window.knots, window.masked.view("u1"), window.by_needle
        self.shots = window.shots
        samples = self.output.shape[0]
        if self.inputs.shape[0] < samples or self.inputs.shape[1] != 2 or self.resting.shape[0] < samples:
            raise ValueError("arrays of a window do not fit each other")
        if 0 < self.knots.shape[0] < samples:
            raise ValueError("a window has fewer knots than samples")
        if 0 < self.by_needle.shape[0] < samples or self.shots.shape[0] < self.by_needle.shape[0] or self.by_needle.shape[1] != NEEDLE_NUMBERS:
            raise ValueError("slopes by the needle do not fit the window")
        self.model, self.weights, self.terms = Model(learned.coefficients), Weights(learned.network), terms
        self.forced.coefficients, self.forced.network = self.model.coefficients, self.weights.network
        self.servos = servos_over(self.inputs, window.commands, samples, &self.model.coefficients, setting.interval)
        self.interval.length, self.interval.substeps = setting.interval, setting.substeps

    cdef void force(self, const double* x, int64_t k) noexcept nogil:
        """Set up the interval before sample k, from a state x (n,) on, under the terms in force."""
        cdef Knot knot
        cdef int64_t number
        cdef const Servo* servo = <const Servo*> &self.servos[k - 1, 0]
        cdef double since = opened_since(self.interval.end.since, self.inputs[k - 1, 1], self.inputs[k, 1])
        self.interval.start = inputs_of(self.inputs[k - 1, 0], self.inputs[k - 1, 1])
        self.interval.end = inputs_of(self.inputs[k, 0], self.inputs[k, 1])
        self.interval.start.servo, self.interval.end.servo = servo[0], servo[1]
        self.interval.start.since, self.interval.end.since = since, since + self.interval.length
        for number in range(NEEDLE_NUMBERS if self.by_needle.shape[0] > 0 else 0):
            self.interval.start.by_needle[number] = self.by_needle[k - 1, number]
            self.interval.end.by_needle[number] = self.by_needle[k, number]
            self.interval.start.shot, self.interval.end.shot = self.shots[k - 1], self.shots[k]
        knot.share = knot.area = 0.0
        if self.knots.shape[0] > 0:
            knot.share, knot.area = self.knots[k - 1, 0], self.knots[k - 1, 1]
        under_terms(
            x, &self.interval, knot, &self.model.coefficients, &self.weights.network, &self.terms.forcing, &self.forced
        )


cdef class _FlowRecord:
    """An `engine.estimation.predictor.OpenLoop` of zeros, lent."""

    cdef double[::1] rate, relaxation, by_area, fullness
    cdef double[:, ::1] slopes, gradient
    cdef double[:, :, ::1] transition

    def __init__(self, run) -> None:
        self.rate, self.slopes, self.gradient = run.rate, run.slopes, run.gradient
        self.transition, self.relaxation, self.by_area = run.transition, run.relaxation, run.by_area
        self.fullness = run.fullness

    cdef void begin(self, Tangent* t) noexcept nogil:
        """Have the columns behind the m of theta become the state's derivatives by itself."""
        cdef int64_t m = self.slopes.shape[1], i, j
        for i in range(t.n):
            for j in range(t.n):
                t.by[i * t.m + m + j] = 1.0 if i == j else 0.0

    cdef void take(self, int64_t k, const double* x, const Forced* forced, Tangent* t) noexcept nogil:
        """Note the rate of sample k, one after `begin`, with slopes by flows and state, whichever line there is."""
        cdef int64_t n = t.n, m = self.slopes.shape[1], i, j
        cdef FlowSlopes flows
        cdef double nozzle_flow = forced.coefficients.nozzle.flow, relaxation
        c = &forced.coefficients
        for i in range(n):
            for j in range(n):
                self.transition[k, i, j] = t.by[i * t.m + m + j]
        if not rate_slopes(x, forced, t, m, nozzle_flow, &flows, &self.gradient[k, 0], &self.slopes[k, 0]):
            return
        self.rate[k], self.fullness[k] = nozzle_flow * flows.q_h, x[SAC] / x[0]
        self.gradient[k, n] = nozzle_flow * flows.h_area
        # the sac by itself: how its pressure's rate of change goes with that pressure, and with the area
        relaxation = c.sac.a6 * flows.h_x[2] - c.sac.a5 * flows.s_x[2]
        self.relaxation[k] = relaxation * sac_stiffness(x[SAC], &c.sac)
        if forced.interval.end.area > 0.0:
            self.by_area[k] = (c.sac.a5 * flows.s_area - c.sac.a6 * flows.h_area) / relaxation


def follow(
    window, setting, learned, int64_t corrected, double[:] errors, double[:] rate, gradient, double[:, ::1] slopes,
    Terms terms=None, run=None
) -> NDArray[np.float64]:
    """Follow a window by x~ before sample `corrected`, from there on by x^ in open loop; returns the last state (n,).

    window, setting, learned, gradient: named tuples of engine.estimation.predictor. terms: go on with these; None: they
    begin at the window's clock. errors: (n,) y - o - (indicated pressure), before the correction, errors[0] is 0; rate:
    of injection, before the correction [m3/s], (n,), or (0,) if not wanted. With a gradient of 0 (else None), slopes
    (n, m) becomes d(errors)/dtheta. run: an `OpenLoop` of zeros, filled from `corrected` on until nothing flows, where
    the gradient begins, then at least m + states columns wide; or None.
    """
    cdef _Followed it
    cdef _FlowRecord flows = None if run is None else _FlowRecord(run)
    cdef Gradient of_gradient
    cdef Gradient* g = NULL
    cdef Carried carried
    cdef const double[::1] gain = setting.gain
    cdef const double[:, ::1] sensor_by
    cdef double[::1] sensor = learned.sensor.copy()
    cdef double[::1] before, indicated_by, error_by
    cdef double offset = setting.offset + learned.offset, late = setting.late
    cdef double interval = setting.interval, time = window.clock.time, injections = window.clock.injections
    cdef double indicated, shown, trusted
    cdef bint is_measured
    it = _Followed(window, setting, learned, Terms(setting.program, time, injections) if terms is None else terms)
    cdef int64_t samples = it.output.shape[0], n = it.model.coefficients.states, first = samples, width = slopes.shape[1]
    cdef int64_t k, j
    state = array(window.start[:n])
    cdef double[::1] x = state
    sensor[0] += setting.lag
    if len(window.start) != n + 1 or gain.shape[0] < n or errors.shape[0] < samples or 0 < rate.shape[0] < samples:
        raise ValueError("what is followed does not fit the model or the window")
    if run is not None and (flows.rate.shape[0] < samples or flows.transition.shape[0] > samples):
        raise ValueError("what is recorded does not fit the window")
    errors[:1] = 0.0
    rate[:1] = 0.0
    slopes[:1] = 0.0
    indicated = window.start[n]
    if gradient is not None:
        carried = Carried(gradient.tangent)
        sensor_by, before, indicated_by, error_by = gradient.sensor, gradient.before, gradient.indicated, gradient.error
        if run is None and slopes.shape[0] < samples:
            raise ValueError("the slopes do not fit the window")
        if sensor_by.shape[0] != SENSOR_NUMBERS or sensor_by.shape[1] != carried.tangent.m:
            raise ValueError("the gradient does not fit the sensor")
        if carried.tangent.n != n or carried.tangent.m < (width if run is None else flows.slopes.shape[1] + n):
            raise ValueError("the slopes do not fit the gradient")
        if not 0 <= gradient.offset < carried.tangent.m:
            raise ValueError("the sensor's offset is no column of the gradient")
        of_gradient.tangent, of_gradient.offset = carried.tangent, gradient.offset
        of_gradient.sensor, of_gradient.before = &sensor_by[0, 0], &before[0]
        of_gradient.indicated, of_gradient.error = &indicated_by[0], &error_by[0]
        g = &of_gradient if run is None else NULL
    if run is not None:
        if gradient is None:
            raise ValueError("the open loop's record needs a gradient")
        first = max(corrected, <int64_t> 1)
        samples = flows.transition.shape[0]
    with nogil:
        for k in range(1, samples):
            if k >= first:
                if k == first:
                    g = &of_gradient
                    begin_forcing(&it.terms.forcing, time + (first - 1) * interval, injections)
                flows.begin(&g.tangent)
            it.force(&x[0], k)
            shown = predict(&x[0], &indicated, &it.forced, late, &sensor[0], g)
            shown = shown_under_terms(shown, &it.forced, &it.terms.forcing)
            if rate.shape[0] > 0:
                rate[k] = rate_after(&x[0], &it.forced)
            is_measured = k >= it.masked.shape[0] or it.masked[k] == 0
            errors[k] = it.output[k] - offset - shown if is_measured else 0.0
            if g != NULL:
                for j in range(width):
                    slopes[k, j] = g.error[j] if is_measured else 0.0
            if k < corrected and is_measured:
                trusted = trusted_under_terms(errors[k], interval, &it.terms.forcing)
                correct(&x[0], &indicated, trusted, &gain[0], n, g)
            if it.resting[k] != 0 and it.forced.interval.end.area <= 0.0:
                empty_sac(&x[0], NULL if g == NULL else &g.tangent)
            if k >= first:
                flows.take(k, &x[0], &it.forced, &g.tangent)
    return state


def move_lift(
    const double[:, :] inputs, const double[:, :] knots, double samples
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Move the lift in a window's inputs (n, 2) and knots (n, 2), or (0, 2), earlier by so many samples.

    It is straight between samples and knots, and stays beyond them as it is at either end.
    """
    cdef int64_t n = inputs.shape[0], bent = knots.shape[0], k, before
    cdef double place, share, first, last
    moved, bends = array(inputs), zeros_like(knots)
    cdef double[:, :] of_moved = moved, of_bends = bends
    for k in range(n):
        place = min(max(k + samples, 0.0), n - 1.0)
        before = min(<int64_t> place, n - 2)
        first, last, share = inputs[before, 1], inputs[before + 1, 1], place - before
        if before < bent and knots[before, 0] > share:
            last, share = knots[before, 1], share / knots[before, 0]
        elif before < bent and knots[before, 0] > 0.0:
            first, share = knots[before, 1], (share - knots[before, 0]) / (1.0 - knots[before, 0])
        of_moved[k, 1] = first + share * (last - first)
    for k in range(bent):
        place = k + knots[k, 0] - samples
        if knots[k, 0] > 0.0 and 0.0 <= place < bent:
            before = <int64_t> floor(place)
            of_bends[before, 0], of_bends[before, 1] = place - before, knots[k, 1]
    return moved, bends


def propagate_noise(
    const double[:] areas, int64_t opening, run, double interval, seat, start, const double[::1] rail, double lift,
    double[::1] rate, double[::1] volume
) -> None:
    """Propagate the covariance of [x, A_S, volume], whichever line there is: see `input_variance`.

    areas: (n,) A_S; run: an `OpenLoop`; start: variances of x~_1 and x~_2; rail: sigma of the rail pressure's noise in x
    (states,); lift: sigma. rate, volume (n,): variances, filled from the opening on.

    x~ at the opening errs as the steady Kalman filter says: K R, as much in Q_L as in p_L, for the line hardly damped
    turns one into the other. Rail noise, linear between samples, is white to Q_L. The area reaches p_S with the lag
    of the sac.
    """
    cdef int64_t states = rail.shape[0], size = states + 2, area = states, end = states + 1, k, i, j
    cdef double[:, ::1] gradients = run.gradient
    cdef double[:, :, ::1] transitions = run.transition
    cdef const double[::1] relaxations = run.relaxation, areas_by = run.by_area
    cdef double[:, ::1] covariance = zeros((size, size)), change = zeros((size, size)), moved = zeros((size, size))
    cdef double[:, ::1] scratch = zeros((size, size))
    cdef double[::1] by_rail = zeros(size), by_area = zeros(size), gradient = zeros(size), half = zeros(size)
    cdef Seat of_seat = seat._asdict()
    cdef LaggedSlopes lag
    cdef double by_start, by_end, opened, total
    covariance[0, 0], covariance[1, 1] = start
    by_rail[:states] = rail
    by_area[area] = 1.0
    with nogil:
        for k in range(max(opening, <int64_t> 1), rate.shape[0]):
            if k >= transitions.shape[0]:  # drained: x^ was followed no further
                volume[k:] = covariance[end, end]
                break
            by_start, by_end = 0.0, 0.0
            if relaxations[k] > 0.0:
                lag = lagged_slopes(0.0, 0.0, 0.0, interval, 1.0 / relaxations[k])
                by_start, by_end = lag.by_start, lag.by_end
            for i in range(end):
                half[i] = 0.5 * interval * gradients[k, i]
            change[:states, :states] = transitions[k]
            change[2, area] = areas_by[k] * by_start
            by_area[2] = areas_by[k] * by_end
            for j in range(end):
                change[end, j] = 0.5 * interval * gradients[k - 1, j]
                for i in range(states):
                    change[end, j] += half[i] * change[i, j]
            change[end, end] = 1.0
            by_rail[end] = 0.0
            for i in range(states):
                by_rail[end] += half[i] * rail[i]
            by_area[end] = half[2] * by_area[2] + half[area]
            opened = lift * seat_area_slope(areas[k], &of_seat)
            propagate(change, covariance, moved, scratch)
            for i in range(size):
                for j in range(size):
                    covariance[i, j] += by_rail[i] * by_rail[j] + opened * opened * by_area[i] * by_area[j]
            gradient[:end] = gradients[k, :end]
            for i in range(end):
                total = 0.0
                for j in range(size):
                    total += covariance[i, j] * gradient[j]
                rate[k] += gradient[i] * total
            volume[k] = covariance[end, end]
            if areas[k] > 0.0 and areas[k - 1] <= 0.0:
                covariance[end, :] = 0.0
                covariance[:, end] = 0.0
