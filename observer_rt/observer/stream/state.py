"""The observer's memory: one ring of samples and one record of everything else, both preallocated."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stepper import Stepper
from observer_rt.core.stream.stream import Stream
from observer_rt.foundation.continuity import Break, Doubt
from observer_rt.model.effective import Coefficients, InputTerms
from observer_rt.model.network import ARGUMENTS, HIDDEN
from observer_rt.model.sensor import Sensor
from observer_rt.observer.stream.phi import Phi
from observer_rt.observer.stream.verdict import CARRIED, Verdicts

RAIL, LIFT, LINE = range(3)  # numbers of the channels


class State(IntEnum):
    """What the service as a whole is in; sent in every output frame."""

    STARTING = 0
    WAITING_FOR_DATA = 1
    RUNNING_NOMINAL = 2
    ADAPTED = 3
    DEGRADED = 4


class Reason(IntEnum):
    """Why a sample, an injection or the service is not valid; the first five continue `Break`."""

    NONE = Break.NONE
    STARTING = Break.START
    JUMPED = Break.JUMP  # x~ restarted after a window of the source
    SAMPLES_LOST = Break.LOSS
    DEVICE_RESTARTED = Break.RESTART
    NUMERICAL = 5  # a state was not finite
    NEEDLE_STUCK = 6  # open longer than any injection
    TOO_FEW_EVENTS = 7  # not enough events were judged since the start
    INPUT_TIMEOUT = 8  # no input frames
    MODEL_INADEQUATE = 9  # the innovations contradict the model
    PRESSURE_OFFSET = 10  # line and rail pressure differ at standstill beyond what a good sensor does
    SENSOR_LAG = 11  # the line-pressure sensor is implausibly slow
    NOT_LEARNED = 12  # the event could not be learned from
    SUDDEN_CHANGE = 13  # the event contradicts what was learned before it
    AMBIGUOUS_SCALE = 14  # line stiffness and nozzle flow changed as if the line's inertance had
    UNTESTED = 15  # the training in use (the paper's) has no test of its result
    TIME_BASE = 16  # when samples were taken is in doubt, or the line pressure seems recorded late
    REVISED = 17  # what was learned from the injection changes its mass
    INPUT_STALE = 18  # one of the inputs stays away while others come
    NOT_JUDGED = 19  # the event could not be tested; after two in a row nothing is known of what follows
    CONTRADICTED = 20  # the innovations have left the model: an input is wrong, or the injector changed
    SECOND_SENDER = 21  # another node sends what only this service should
    NO_STANDSTILL = 22  # the needle is not shut long enough between injections
    LIFT_ZERO = 23  # the lift of the shut needle is too far from zero
    INPUT_FROZEN = Doubt.FROZEN  # an input keeps its value for longer than can be bridged
    INPUT_CLIPPED = Doubt.CLIPPED  # an input stays at the end of its range
    LIFT_SENSOR_LAG = 26  # a needle lift recorded late would explain what the model does not
    INPUT_PROTECTION = 27  # the end-to-end protection of an input says that it cannot be used
    OUTSIDE_LEARNED_RANGE = 28  # what was learned does not tell the flow of such an injection well enough
    LIFT_DEAD = 29  # the line pressure shows injections, the lift none


_SAMPLE = [
    # as received, normalised by (24), lift in m
    ("index", np.int64),
    ("rail_pressure", np.float64),
    ("needle_lift", np.float64),
    ("line_pressure", np.float64),
    ("lift_after", np.float64),  # share of an interval by which the lift was taken later than the rest
    ("rail_share", np.float64),  # in the rail pressure, of the later one of two neighbours
    ("lift", np.float64),  # m, the recorded one without what `lift_zero` takes for no motion
    ("interpolated", np.bool_),
    ("broken", np.int8),  # Break
    ("doubt", np.int8),  # Doubt
    ("bridged", np.int8),  # a bit for every channel whose value does not count
    # as computed
    ("lift_area", np.float64),  # normalised seat area when the lift was taken
    ("seat_area", np.float64),  # u2
    ("resting", np.bool_),
    ("innovation", np.float64),  # e~ of x~, in units of p_0; 0 where the line pressure is not known
    ("indicated", np.float64),  # line pressure as the lagging sensor of x~ shows it, without offset
    ("phi", np.float64, (3,)),  # 1/s
    ("injection_rate", np.float64),  # m3/s, NaN while not synchronised
    ("valid", np.bool_),
    ("state", np.int8),  # State
    ("reason", np.int8),  # Reason
]

# what the closed needle has told so far
_STANDSTILL = [
    ("rest_count", np.int64),
    ("offset_sum", np.float64),
    ("difference_count", np.int64),
    ("rail_squares", np.float64),
    ("line_squares", np.float64),
    ("lift_count", np.int64),
    ("lift_variance", np.float64),  # m2, of the noise: a running mean
]

# what the lift shows of a shut needle
_RESTING_LIFT = [
    ("zero", np.float64),  # m
    ("quick_squares", np.float64),  # m2, running mean of the square of `quick`
    ("crosstalk", np.float64),  # m of lift by the line pressure's p_0, as it is taken out; 0: none was found
]

EVENT = np.dtype(
    [
        ("number", np.int64),
        ("due_index", np.int64),  # judged at the first sample >= this outside every event
        ("window_start", np.int64),  # positions in the stream of samples
        ("window_end", np.int64),
        ("opening", np.int64),
        ("learnable", np.bool_),
        ("doubtful", np.int8),  # Reason its samples are not to be trusted, 0 when they are
        ("closed_index", np.int64),  # of the sample at which it closed
        ("judged_before", np.int64),  # events, when it closed
        ("injections", np.int64),  # begun, when it closed
        ("taken", np.int8),  # verdict.Taken, once it was judged
        # up to the event's end
        *_STANDSTILL,
        *_RESTING_LIFT,
    ],
    align=True,
)

CHANNEL = np.dtype(
    [
        ("noise", np.float64),  # standard deviation of a sample, as normalised as it is
        ("last", np.float64),  # value as it came
        ("change", np.float64),  # running mean from sample to sample
        ("until", np.int64),  # position before which every sample is looked at
        ("run", np.int64),  # samples in a row with the value of the one before
        ("needed", np.int64),  # of them, until it is frozen
        ("is_dropout", np.bool_),  # it leapt there
        ("instead", np.float64),  # value before it did
        ("repeats", np.int64),  # of all samples, those that only by chance have the value of the one before
        ("held", np.float64),  # value at which it was frozen last
        ("is_held", np.bool_),  # it has not moved since
        ("went_above", np.bool_),  # it has been higher than that since,
        ("went_below", np.bool_),  # and lower: no end of a range
        ("is_clipped", np.bool_),  # it was the time before as well
        ("bridged", np.int64),  # lately: samples that do not count less others since
    ],
    align=True,
)

INJECTION = np.dtype(
    [
        ("number", np.int64),
        ("event", np.int64),
        ("start", np.int64),  # position of the window's first sample
        ("end", np.int64),  # position of its last, -1 while not known
        ("start_index", np.int64),
        ("end_index", np.int64),
        ("volume", np.float64),  # m3
        ("peak_rate", np.float64),  # m3/s
        ("opening_index", np.int64),  # of its first sample with the needle open
        ("opening_seen", np.bool_),  # else it was open when the samples began
        ("rail_pressure", np.float64),  # at its opening, normalised
        ("known_from", np.float64),  # rail pressures at which the flow was known then
        ("known_to", np.float64),
        ("valid", np.bool_),
        ("reason", np.int8),  # Reason of its first sample that is not valid
        ("phi_version", np.int64),
        ("state", np.int8),
        ("middle_x", np.float64, (3,)),  # x^ and inputs in the middle of the window
        ("middle_u", np.float64, (2,)),
    ],
    align=True,
)

_OBSERVER = [
    # numbers of recorded samples: recorded >= given_on
    ("recorded", np.int64),  # taken in
    ("given_on", np.int64),  # what is stated of their channels is undone
    ("unbroken_since", np.int64),  # number of the first sample since the last break
    # positions in the stream of samples: received >= inspected >= processed
    ("received", np.int64),
    ("inspected", np.int64),  # for outliers
    ("processed", np.int64),
    ("lifted", np.int64),  # as far as `lift` is known
    ("newest_break", np.int64),  # position of the newest sample that does not follow the one before
    ("segment_start", np.int64),  # position of the first sample since the last break
    ("draining", np.bool_),  # no more samples will come: do without look-ahead
    # parameters in force
    ("hidden", np.float64, (HIDDEN, ARGUMENTS)),
    ("offset", np.float64),  # the learned one, moved by what the standstill shows
    ("offset_moves", np.bool_),  # slow innovations at rest are the offset's, not the colour of the noise
    ("judgement", np.int8),  # Reason the last judged event did not pass, 0 when it did
    ("untested", np.int64),  # events in a row that could not be tested
    ("doubted", np.int8),  # Reason all that comes now is not to be trusted, 0 when it is
    ("familiar", np.bool_),  # the flow is known well enough for an injection as the last one
    ("sac_flow", np.float64),  # sums since it opened: of Q_H times p_S,
    ("line_flow", np.float64),  # and times p_L
    ("innovation_sigma", np.float64),  # standard deviation of e~, in units of p_0
    (
        "healthy_variance",
        np.float64,
    ),  # what e~ of a healthy injector has, over its square; 1 if the model is right
    ("innovation_weight", np.float64),  # 1 / their product
    ("surprise", np.float64),  # running mean of e~^2 by this weight
    ("contradicted", np.bool_),  # it has left what noise can do, and no event passed since
    ("contradicted_at_rest", np.bool_),  # by a channel, for the injector did nothing
    ("calm", np.int64),  # samples since it was
    ("lowest_line", np.float64),  # line less rail pressure meanwhile
    ("falls", np.int64),  # how often in a row such a one was an injection's, though no needle opened
    ("contradicted_in", np.int64),  # number of the first event that can tell otherwise
    ("halted_in", np.int64),  # number of the event in which a needle stopped too low, 0 once one has passed
    ("lift_on", np.float64),  # m
    ("lift_off", np.float64),
    ("phi_version", np.int64),
    # the pair x~, x^ is in the ring; what else it needs
    ("since_start", np.int64),  # samples since x~ started
    ("closed_since_start", np.int64),  # of these, with a closed needle
    ("synchronised", np.bool_),
    ("unsynchronised_by", np.int8),  # Reason
    # needle and event
    ("needle_open", np.bool_),
    ("shut_since", np.int64),  # index of the first closed sample
    ("in_event", np.bool_),
    ("event_learnable", np.bool_),
    ("event_doubtful", np.int8),  # Reason
    ("event_number", np.int64),
    ("event_opening", np.int64),
    ("opening", np.int64),  # position of the last one
    ("rested", np.int64),  # position of the last sample with the needle long shut
    # the part of a ramp that a lift recorded too low does not show
    ("foot", np.int64),  # position of the first sample whose recorded lift counts
    ("foot_lift", np.float64),  # m, lift at the sample before
    ("rise", np.float64),  # m a sample
    ("sinking_lift", np.float64),  # m, of a needle no longer recorded as open
    ("fall", np.float64),  # m a sample, 0 while the recorded lift counts
    ("events_judged", np.int64),
    ("waits_for_verdicts", np.bool_),  # else an event without one when it is due is not judged
    ("waiting", np.bool_),  # the head of `events` is due and must be judged before going on
    ("events_closed", np.int64),
    ("events_taken", np.int64),
    ("injections_begun", np.int64),
    ("injections_reported", np.int64),
    *_RESTING_LIFT,
    ("zero_mean", np.float64),  # m, running mean
    ("zero_near", np.float64),  # m, a shorter one, and
    ("zero_behind", np.float64),  # .. the running mean of that
    ("zero_moves", np.float64),  # m2, mean square of their difference
    ("zero_slope", np.float64),  # m a sample, 0 while that is noise
    ("followed", np.int64),  # position of the last sample in them
    ("quick", np.float64),  # m, mean over some samples of the lift about its zero
    ("quick_limit", np.float64),  # m2, of its square: more is a step
    ("quiet", np.int64),  # position of the last sample at which it was small
    ("stepped", np.int64),  # position at which a step of the zero was found
    ("before_step", np.float64),  # m, the zero before it
    ("summit", np.float64),  # m, highest lift since it opened
    ("zero_count", np.int64),
    ("spread", np.float64),  # m2, mean square of the lift about it: noise of any colour
    ("variance_lately", np.float64),  # m2, of the noise: a shorter mean
    ("line_mean", np.float64),  # of the line pressure, running as `zero` does
    ("crosstalk_count", np.int64),
    ("swing_squares", np.float64),  # fading sums: of the line pressure about its mean,
    ("swing_lifts", np.float64),  # and of its products with the lift about its zero
    ("squares_lately", np.float64),  # shorter ones of the same
    ("lifts_lately", np.float64),
    # where the lift of an open needle stays
    ("level", np.float64),  # m, mean of the samples that differ little, and
    ("level_count", np.int64),  # .. how many they are
    ("highest", np.float64),  # m, of this opening, 0 where it stayed nowhere
    ("stop", np.float64),  # m, running mean of the openings that went furthest
    ("stop_openings", np.int64),
    # statistics of the standstill
    ("stated_noise", np.float64, (3,)),  # of rail and line pressure [p_0] and lift [m], until it is measured
    ("rest_run", np.int64),
    ("highest_line", np.float64),  # line pressure of the run, normalised
    ("at_highest", np.int64),  # samples of a rest in a row that repeat it exactly: its range ends there
    ("differences_before", np.int64),  # what was known when the event before closed
    ("rail_squares_before", np.float64),
    ("line_squares_before", np.float64),
    *_STANDSTILL,
    # outliers
    ("accepted_innovation", np.float64),  # the last of x~ that did not leap
    ("leaping", np.int64),  # samples since
    # counters
    ("spikes", np.int64),
    ("bridged", np.int64),
    ("interpolated", np.int64),
    ("numerical_resets", np.int64),
    ("doubtful_events", np.int64),  # judged
]


SAMPLE = np.dtype(_SAMPLE, align=True)
"""A sample of the ring."""


def sample_dtype(states: int) -> np.dtype[np.void]:
    """A sample with x~ and x^ of a model of so many states, as Python is given it."""
    pair = [("x_tilde", np.float64, (states,)), ("x_hat", np.float64, (states,))]
    return np.dtype(_SAMPLE + pair, align=True)


MEMORY = np.dtype(_OBSERVER + CARRIED, align=True)
"""What there is one of."""


class Timing(NamedTuple):
    """Durations in samples."""

    settle: int  # closed needle after which the sac is at rest and x^ follows x~
    good: int  # closed needle after which x~ is good again
    event_gap: int
    learning_delay: int
    window_lead: int  # injection window: before the opening
    window_tail: int  # and after the needle is shut
    learning_lead: int  # learning window: before the event's first opening
    lookahead: int  # samples the observer must know beyond the one in hand
    toe: int  # most samples of an opening ramp that a lift recorded too low does not show
    ramp: int  # samples beyond the first of a ramp from which its slope is taken
    confirm: int  # samples in a row above the dead band that open the needle
    bounce: int  # closed needle after which its lift is its zero
    stays: int  # for which a low lift that the line pressure does not show is none of an open needle
    bridge: int  # most samples of a channel that may be missing
    filtered: bool  # samples come fast enough for a spike to be told from the line


class Undoing(NamedTuple):
    """What is undone of channels before the observer sees a sample; of the line pressure the model knows it."""

    stated: bool  # whether there is anything
    rail_late: (
        int  # samples; sample k + rail_late of the rail pressure is of the time `rail_fraction` (0..1) of a
    )
    rail_fraction: float  # .. sample before k
    lift_lag: float  # samples: time constant of the lift's sensor
    ahead: int  # samples that must be known beyond one


class Constants(NamedTuple):
    """What does not change while the observer runs; the stream does not see the line."""

    coefficients: Coefficients
    means: bool  # samples are means over the sample period that ends at their time
    inputs: InputTerms
    sensor: Sensor
    interval: float  # s
    substeps: int
    timing: Timing
    events_required: int  # judged events before a sample can be valid
    rail_every: float  # samples to one of the rail pressure
    undoing: Undoing
    quickest: float  # m a sample: no needle is
    program: NDArray[np.float64]  # of the terms in force


class Observer(NamedTuple):
    """Constants, preallocated memory, and what of the core works on it."""

    constants: Constants
    memory: NDArray[np.void]  # (1,) `MEMORY`
    recorded: NDArray[np.void]  # (RECORDED_RING,) `RECORDED`
    ring: NDArray[np.void]  # (RING,) `SAMPLE`
    x_tilde: NDArray[np.float64]  # (RING, states) of the samples in the ring
    x_hat: NDArray[np.float64]
    gains: NDArray[np.float64]  # (n, states) gain schedule in force
    events: NDArray[np.void]  # (PENDING_EVENTS,) `EVENT`: the n-th closed one at n % PENDING_EVENTS
    injections: NDArray[np.void]  # (INJECTIONS,) `INJECTION`
    channels: NDArray[np.void]  # (3,) `CHANNEL`
    theta: NDArray[np.float64]  # (m,) in force
    phi: Phi  # of x^
    verdicts: Verdicts
    stream: Stream
    stepper: Stepper  # of the pair
