"""The observer: rings of samples, events and injections, its constants, and what of the core works on them."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stepper import Stepper
from observer_rt.core.stream.stream import Stream
from observer_rt.engine.stream.memory import RESTING_LIFT, STANDSTILL
from observer_rt.engine.stream.phi import Phi
from observer_rt.engine.stream.verdict import Verdicts
from observer_rt.foundation.continuity import Break, Doubt
from observer_rt.model.effective import Coefficients, InputTerms
from observer_rt.model.sensor import Sensor

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

EVENT = np.dtype(
    [
        ("number", np.int64),
        ("due_index", np.int64),  # judged at the first sample >= this outside every event
        ("window_start", np.int64),  # positions in the stream of samples
        ("window_end", np.int64),
        ("opening", np.int64),
        ("learnable", np.bool_),
        ("fault", np.int8),  # Reason its samples are not to be trusted, 0 when they are
        ("closed_index", np.int64),  # of the sample at which it closed
        ("judged_before", np.int64),  # events, when it closed
        ("injections", np.int64),  # begun, when it closed
        ("taken", np.int8),  # verdict.Taken, once it was judged
        # as they were at the event's end
        ("standstill", STANDSTILL),
        ("resting_lift", RESTING_LIFT),
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

SAMPLE = np.dtype(_SAMPLE, align=True)
"""A sample of the ring."""


def sample_dtype(states: int) -> np.dtype[np.void]:
    """A sample with x~ and x^ of a model of so many states, as Python is given it."""
    pair = [("x_tilde", np.float64, (states,)), ("x_hat", np.float64, (states,))]
    return np.dtype(_SAMPLE + pair, align=True)


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
    memory: NDArray[np.void]  # (1,) `memory.MEMORY`
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
