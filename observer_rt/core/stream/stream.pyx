"""Observer over its stream of samples: the operations at every sample, in their order.

One unit, for its parts call each other at every sample; a file for each of them.
"""

from libc.math cimport NAN, INFINITY, ceil, copysign, exp, fabs, isfinite, isnan, log, rint, sqrt
from libc.stdint cimport int32_t, int64_t
from libc.string cimport memcpy

from observer_rt.core.model.hydraulics cimport Seat, normalised_area
from observer_rt.core.model.needle cimport CORNER_ROUNDING, NeedleStroke, answers, lands, rounded_lift
from observer_rt.core.records import dtype_of, enum_of, tuple_of
from observer_rt.core.stream.operating_point cimport BELIEVED, FULL_LIFT, falls, is_shown
from observer_rt.core.stream.ramps cimport slope_of_means
from observer_rt.core.stream.state cimport *
from observer_rt.core.stream.validity cimport *


cdef inline void copy_numbers(const double* source, double* target, int64_t count) noexcept nogil:
    memcpy(target, source, count * sizeof(double))


include "front_end.pxi"
include "compensation.pxi"
include "standstill.pxi"
include "events.pxi"
include "false_openings.pxi"
include "lift_step.pxi"
include "lift_zero.pxi"
include "crosstalk.pxi"
include "lift_stop.pxi"
include "outliers.pxi"
include "judgement.pxi"
include "pair.pxi"
include "innovation_monitor.pxi"
include "step.pxi"


# What Python works with, too, beside what is `cpdef`.
globals().update(
    CHANGE_MEMORY=CHANGE_MEMORY, CLOSE=CLOSE, COMMANDS=COMMANDS, CONTRADICTED=CONTRADICTED,
    DIFFERENCE_GAIN=DIFFERENCE_GAIN, FOOT=FOOT, FULL_LIFT=FULL_LIFT, FURTHEST_OFFSET=FURTHEST_OFFSET,
    FURTHEST_ZERO=FURTHEST_ZERO, INJECTIONS=INJECTIONS, LIFT=LIFT, LINE=LINE, MAX_EVENT=MAX_EVENT,
    MOST_CROSSTALK=MOST_CROSSTALK, OFFSET_FOLLOWS=OFFSET_FOLLOWS, PENDING_EVENTS=PENDING_EVENTS, RAIL=RAIL,
    RAIL_BIN=RAIL_BIN, RAIL_BINS=RAIL_BINS, RECORDED_RING=RECORDED_RING, RESTLESS=RESTLESS, RING=RING, SLOTS=SLOTS,
    SLOWEST_OPENING=SLOWEST_OPENING, SPREAD=SPREAD, STEP=STEP,
)


# Dtypes of the records, of which Python makes arrays, and named tuples of the constants it gives.
cdef double[CURVES * CURVE_NUMBERS + 1024] _blank  # room for each of them, most of it for the network's curves
globals().update(
    MEMORY=dtype_of(<ObserverMemory[:1:1]> <ObserverMemory*> _blank, (<ObserverMemory*> _blank)[0]),
    RECORDED=dtype_of(<Recorded[:1:1]> <Recorded*> _blank, (<Recorded*> _blank)[0]),
    SAMPLE=dtype_of(<Sample[:1:1]> <Sample*> _blank, (<Sample*> _blank)[0]),
    EVENT=dtype_of(<Event[:1:1]> <Event*> _blank, (<Event*> _blank)[0]),
    CHANNEL=dtype_of(<Channel[:1:1]> <Channel*> _blank, (<Channel*> _blank)[0]),
    INJECTION=dtype_of(<Injection[:1:1]> <Injection*> _blank, (<Injection*> _blank)[0]),
    VERDICT=dtype_of(<Verdict[:1:1]> <Verdict*> _blank, (<Verdict*> _blank)[0]),
    Timing=tuple_of(__name__, "Timing", (<Timing*> _blank)[0]),
    Undoing=tuple_of(__name__, "Undoing", (<Undoing*> _blank)[0]),
    Break=enum_of(
        __name__, "Break", NONE=BREAK_NONE, START=BREAK_START, JUMP=BREAK_JUMP, LOSS=BREAK_LOSS, RESTART=BREAK_RESTART
    ),
    Doubt=enum_of(
        __name__, "Doubt", NONE=DOUBT_NONE, TIME_BASE=DOUBT_TIME_BASE, FROZEN=DOUBT_FROZEN, CLIPPED=DOUBT_CLIPPED
    ),
    OwnReason=enum_of(
        __name__, "OwnReason", NUMERICAL=REASON_NUMERICAL, NEEDLE_STUCK=REASON_NEEDLE_STUCK,
        TOO_FEW_EVENTS=REASON_TOO_FEW_EVENTS, INPUT_STALE=REASON_INPUT_STALE, NOT_JUDGED=REASON_NOT_JUDGED,
        CONTRADICTED=REASON_CONTRADICTED, NO_STANDSTILL=REASON_NO_STANDSTILL, LIFT_ZERO=REASON_LIFT_ZERO,
        OUTSIDE_LEARNED_RANGE=REASON_OUTSIDE_LEARNED_RANGE, LIFT_DEAD=REASON_LIFT_DEAD, PRELIMINARY=REASON_PRELIMINARY
    ),
    State=enum_of(
        __name__, "State", STARTING=STATE_STARTING, WAITING_FOR_DATA=STATE_WAITING_FOR_DATA,
        RUNNING_NOMINAL=STATE_RUNNING_NOMINAL, ADAPTED=STATE_ADAPTED, DEGRADED=STATE_DEGRADED
    ),
    VerdictKind=enum_of(
        __name__, "VerdictKind", NOTHING=TAKEN_NOTHING, EXAMINED=TAKEN_EXAMINED, LEARNED=TAKEN_LEARNED
    ),
)
assert all(getattr(each, "itemsize", 0) <= sizeof(_blank) for each in list(globals().values()))


def dead_band(double lift_noise) -> tuple[float, float]:
    """Lift [m] above which the needle is open and below which it is shut again, from the lift noise [m]."""
    opens = opening_band(lift_noise)
    return opens, 0.5 * opens


def reason_and_state(facts) -> tuple[int, int]:
    """Reason a sample is not valid, and State, by the facts of validity.pxd's `SampleFacts` (a dict)."""
    cdef SampleFacts of_sample = facts
    cdef int64_t reason = reason_of_sample(&of_sample)
    return reason, state_of_sample(&of_sample, reason)


cdef class PairStepper:
    """A function that steps the pair x~ and x^ from sample to sample, with its argument."""


cdef class Stream:
    """An observer's memory, lent to functions that run once a sample, its arrays checked field by field."""

    def __init__(
        self, memory, recorded, ring, x_tilde, x_hat, gains, events, injections, channels, theta, verdicts,
        verdict_gains, verdict_theta
    ) -> None:
        cdef ObserverMemory[::1] of_memory = memory
        cdef Recorded[::1] of_recorded = recorded
        cdef Sample[::1] of_ring = ring
        cdef Event[::1] of_events = events
        cdef Injection[::1] of_injections = injections
        cdef Channel[::1] of_channels = channels
        cdef Verdict[::1] of_verdicts = verdicts
        cdef double[:, ::1] of_tilde = x_tilde, of_hat = x_hat, of_gains = gains, of_verdict_theta = verdict_theta
        cdef double[::1] of_theta = theta
        cdef double[:, :, ::1] of_verdict_gains = verdict_gains
        expected = (1, RECORDED_RING, RING, RING, RING, PENDING_EVENTS, INJECTIONS, 3, 2 * SLOTS)
        lent = memory, recorded, ring, x_tilde, x_hat, events, injections, channels, verdicts
        found = tuple(len(each) for each in lent)
        if found != expected or verdict_gains.shape != (2 * SLOTS, *gains.shape) or x_hat.shape != x_tilde.shape:
            raise ValueError(f"records of an observer: {found} instead of {expected}, or gains of another shape")
        if gains.shape[1] != x_tilde.shape[1] or verdict_theta.shape != (2 * SLOTS, len(theta)):
            raise ValueError("states of the gains, or parameters of the verdicts, are not those of the observer")
        self.lent = (*lent, gains, theta, verdict_gains, verdict_theta)
        o = &self.observer
        o.memory, o.recorded, o.ring = &of_memory[0], &of_recorded[0], &of_ring[0]
        o.states, o.x_tilde, o.x_hat = of_tilde.shape[1], &of_tilde[0, 0], &of_hat[0, 0]
        o.gain_rows, o.gains = of_gains.shape[0], &of_gains[0, 0]
        o.events, o.injections, o.channels = &of_events[0], &of_injections[0], &of_channels[0]
        o.parameters = of_theta.shape[0]
        o.verdicts, o.verdict_gains = &of_verdicts[0], &of_verdict_gains[0, 0, 0]
        if o.parameters:
            o.theta, o.verdict_theta = &of_theta[0], &of_verdict_theta[0, 0]

    def put_constants(self, constants) -> None:
        """Go on with these `engine.stream.state.Constants`."""
        c, coefficients = &self.observer.constants, constants.coefficients
        c.pressure_scale, c.chamber_pressure = coefficients.pressure_scale, coefficients.chamber_pressure
        c.seat = coefficients.seat._asdict()
        c.means = constants.means
        c.inputs = constants.inputs._asdict()
        c.sensor = constants.sensor._asdict()
        c.interval = constants.interval
        c.timing = constants.timing._asdict()
        c.events_required = constants.events_required
        c.rail_every = constants.rail_every
        c.undoing = constants.undoing._asdict()
        c.quickest = constants.quickest
        c.needle.stop = 0.0
        if constants.needle is not None:
            c.needle = constants.needle._asdict()

    def bind(self, PairStepper stepper) -> None:
        """Have the pair stepped by another stepper from here on."""
        self.observer.step, self.observer.stepper = stepper.step, stepper.stepper
        self.bound = stepper

    def take(self, int64_t end, int64_t doubt) -> None:
        """Take in the recorded samples up to the number `end`; doubt (Doubt): why they are not to be trusted."""
        with nogil:
            take_recorded(&self.observer, end, doubt)

    def advance(self) -> bool:
        """Process every sample whose look-ahead is complete; whether an event must be judged first."""
        cdef bint waits
        with nogil:
            waits = advance_stream(&self.observer)
        return waits

    def judged(self) -> bool:
        """Judge the oldest closed event by the verdict posted on it; False where there is none."""
        return judge_event(&self.observer)

    def carry_on(self, int64_t slot) -> None:
        """Carry the theta, gains and noise of a slot from here on."""
        carry_on(&self.observer, slot)

    def expect(self, double at_rest) -> None:
        """What innovations are to be like; at_rest: mean square of coloured ones with the needle shut [p_0^2]."""
        expect(&self.observer, at_rest)

    def watch(self, double innovation, int64_t doubt) -> None:
        """Take in an innovation of x~ [p_0], of a sample with such a Doubt; a contradiction of the model stays."""
        watch(&self.observer, innovation, doubt)

    def end_contradiction(self, bint is_resting, bint is_new) -> None:
        """End a contradiction that is over; is_resting: the needle is long shut; is_new: it came with this sample."""
        end_contradiction(&self.observer, is_resting, is_new)


def copy_window(
    const Sample[::1] ring, int64_t start, int64_t late, double[:, ::1] inputs, double[::1] output,
    unsigned char[::1] resting, double[:, ::1] knots, unsigned char[::1] masked
) -> None:
    """Fill the arrays of a `Window` with samples from a position on; late: by how many y is recorded late."""
    cdef int64_t number
    cdef const Sample* row
    cdef const Sample* recorded
    with nogil:
        for number in range(output.shape[0]):
            row, recorded = &ring[(start + number) & MASK], &ring[(start + number + late) & MASK]
            inputs[number, 0] = row.rail_pressure
            inputs[number, 1] = row.seat_area
            output[number] = recorded.line_pressure
            resting[number] = row.resting
            knots[number, 0] = row.lift_after
            knots[number, 1] = row.lift_area
            masked[number] = (recorded.bridged >> LINE) & 1 != 0
