"""The observer: rings of samples, events and injections, constants with those of its front end, what works on them.

core/stream/front_end.pxi says how the ramps of a lift are completed, compensation.pxi how stated lags are undone.
"""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import InputTerms, Sensor
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.core.stream import stream as core
from observer_rt.core.stream.stepper import Stepper
from observer_rt.core.stream.stream import Doubt as Doubt
from observer_rt.core.stream.stream import State as State
from observer_rt.core.stream.stream import VerdictKind as VerdictKind
from observer_rt.model.accuracy import StatedAccuracy
from observer_rt.model.effective import Coefficients
from observer_rt.model.surroundings import Surroundings

RAIL, LIFT, LINE = core.RAIL, core.LIFT, core.LINE  # numbers of the channels

OPENING = 40e-6  # s above the dead band that open it: less is a spike
MOST_OPENING = 8  # samples of that
RAMP = 30e-6  # s of a ramp from which its slope is taken, behind its first sample
LONGEST_RAMP = core.LOOK_BACK + core.FEWEST_OPENING - 2  # samples; so many are known when the slope is needed


class Reason(IntEnum):
    """Why a sample, an injection or the service is not valid; the first five are those of `Break`."""

    NONE = core.Break.NONE
    STARTING = core.Break.START
    JUMPED = core.Break.JUMP  # x~ restarted after a window of the source
    SAMPLES_LOST = core.Break.LOSS
    DEVICE_RESTARTED = core.Break.RESTART
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
    UNTESTED = 15  # given up to 0.2, by the paper's training: a code in users' databases
    TIME_BASE = 16  # when samples were taken is in doubt, or the line pressure seems recorded late
    REVISED = 17  # given up to 0.2, while the live mass was published: a code in users' databases
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
    PRELIMINARY = 30  # the needle's lift is not recorded: the rate is known when the needle is shut
    LEARNING_LATE = 31  # the event left what was learned before, and could not be learned from in time
    COIL_CURRENT = 32  # the coil's current shows in the line pressure, and is not taken out yet
    NO_COMMAND = 33  # the line pressure shows an injection that no command explains


def sample_dtype(states: int) -> np.dtype[np.void]:
    """A sample with x~ and x^ of a model of so many states, as Python is given it."""
    pair = [("x_tilde", np.float64, (states,)), ("x_hat", np.float64, (states,))]
    return np.dtype([*((name, core.SAMPLE[name]) for name in core.SAMPLE.names or ()), *pair], align=True)


class Constants(NamedTuple):
    """Constants while the observer runs; the stream does not see the line."""

    coefficients: Coefficients
    means: bool  # samples are means over the sample period that ends at their time
    inputs: InputTerms
    sensor: Sensor
    interval: float  # s
    substeps: int
    timing: core.Timing
    events_required: int  # judged events before a sample can be valid
    rail_every: float  # samples to one of the rail pressure
    undoing: core.Undoing
    quickest: float  # m a sample: no needle is
    program: NDArray[np.float64]  # of the terms in force
    calibration: StatedAccuracy  # of level and pressure sensors
    needle: NeedleLaw | None = None  # that answers the commands, where its lift is not recorded
    surroundings: Surroundings = Surroundings()  # as measured

    def by_commands(self) -> "Constants":
        """The same where a pilot valve goes by the injector's commands: `observer.energize`."""
        valve = self.coefficients.valve.by_commands(self.needle)
        return self._replace(coefficients=self.coefficients._replace(valve=valve))


class Observer(NamedTuple):
    """Constants, preallocated memory, and the core's calls that work on it.

    A judge of closed events posts verdicts, and the stream takes one when an event is due, with no lock: a finding
    counts for the event whose number it bears, written last. Of 2 SLOTS, slot n % SLOTS has the n-th verdict, SLOTS
    further the teaching of an earlier event.
    """

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
    verdicts: NDArray[np.void]  # (2 SLOTS,) `VERDICT`
    verdict_gains: NDArray[np.float64]  # (2 SLOTS, n, states) gain schedules
    verdict_theta: NDArray[np.float64]  # (2 SLOTS, m)
    stream: core.Stream
    stepper: Stepper  # of the pair


def confirming_samples(interval: float) -> int:
    """Samples in a row above the dead band that open the needle; sample interval [s]."""
    return min(max(round(OPENING / interval), core.FEWEST_OPENING), MOST_OPENING)


def samples_ahead(interval: float) -> int:
    """Samples the front end must know beyond the first recorded as open; sample interval [s]."""
    return core.LOOK_BACK + confirming_samples(interval) - 1


def ramp_samples(interval: float) -> int:
    """Samples behind the first of a ramp from which its slope is taken; sample interval [s]."""
    return min(max(round(RAMP / interval), 1), LONGEST_RAMP)


def undoing_of(inputs: InputTerms, interval: float) -> core.Undoing:
    """Corrections to undo at a sample interval [s]."""
    late = inputs.rail_delay / interval
    whole_samples = math.floor(late)
    ahead = max(math.ceil(late), int(inputs.lift_lag > 0.0), 0)
    stated = inputs.rail_delay != 0.0 or inputs.lift_lag != 0.0
    return core.Undoing(stated, whole_samples, late - whole_samples, inputs.lift_lag / interval, ahead)


def noise_gain(lag: float) -> float:
    """Factor on the white noise of a lift where a lag of its sensor [samples] is undone."""
    return math.sqrt(1.0 + 0.5 * lag**2)  # of central differences


assert all(Reason(reason).name == reason.name for reason in core.OwnReason)  # those that the core finds
