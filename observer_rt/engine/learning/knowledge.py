"""Knowledge of the observer: the state of learning, the parameters in force, and the outcome of an event.

Each tracker is a frozen class with a method `after` that returns its next value, and is one field, kept by its name
in the state file. Nothing writes into the arrays. Where events of a kind were seen to differ, each says less by that
factor (quasi-likelihood: McCullagh, Nelder, Generalized Linear Models, 2nd ed., section 4.5).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from observer_rt.engine.estimation.belief import Belief, GatedBelief, held_at, prior_belief
from observer_rt.engine.estimation.parameters import EXACTLY, SCALARS, Parameter, Theta, with_gain
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics
from observer_rt.engine.estimation.predictor import GainSchedule, NoiseLevels
from observer_rt.engine.estimation.scales import shrink
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.coil_current import CoilDisturbance
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.kinds import Mode, Velocity
from observer_rt.engine.learning.mass import EVERYWHERE, EventPoint, KnownFlow, Resimulation, Transfer
from observer_rt.engine.learning.noise import Colour, RestingNoise
from observer_rt.engine.learning.run import EventRun
from observer_rt.engine.stream.standstill import HeldRail, RestingLift, SensorSlope, Standstill
from observer_rt.engine.stream.state import Constants, Reason
from observer_rt.foundation.records import NOT_KEPT, Count
from observer_rt.foundation.units import Floats

USUAL_SCORE = 1.2  # of events that scatter by noise alone; their mean is 1
SCORES_REMEMBERED = 0.95  # weight of the scores before an event
PRIOR_EVENTS = 10.0  # for which the factor of the fit counts at first
LARGEST_RATIO = 2.5  # of a score to the usual one, up to which it is scatter and no change of the injector
LARGEST_FACTOR = 8.0  # factor; a model worse than that is inadequate
_ROUNDS = 10  # in which the factor settles


@dataclass(frozen=True, eq=False)
class LearnedInjector:
    """Belief about injector and noise."""

    belief: Belief  # about all parameters jointly
    theta: Theta  # (m,) where the last event was explained
    statistics: PhaseStatistics = field(default_factory=no_statistics)  # of recent innovations
    active: frozenset[int] = frozenset()  # gated columns in use
    is_prior: bool = True  # nothing was learned yet, or all of it was forgotten
    colour: Colour | None = None  # of the innovations; None: they are white
    at_rest: RestingNoise = field(default_factory=RestingNoise)  # by which the colour is found
    learned_at: tuple[EventPoint, ...] = ()  # operating points of the last events

    @cached_property
    def gated(self) -> GatedBelief:
        """The belief as the estimate has it."""
        return GatedBelief(shrink(self.belief), SCALARS.gate, self.active)

    def colour_at(self, interval: float) -> Colour | None:
        """The colour, if it was found at this sample interval [s]."""
        colour = self.colour
        if colour is None or not math.isclose(colour.interval, interval, rel_tol=SAME_RATE):
            return None
        return colour

    def with_gain(self, sigma: float) -> "LearnedInjector":
        """What holds of sensors, stated with a standard deviation of the gain of one over the other's, 0: none."""
        column, covariance = int(Parameter.LINE_PRESSURE_GAIN), self.belief.covariance
        if (sigma > 0.0) is bool(covariance[column, column] > 2.0 * EXACTLY**2):
            return self
        theta = self.theta.copy()
        theta[column] = 0.0
        belief = held_at(self.belief, column, 0.0, EXACTLY**2).prior
        return replace(self, belief=belief.widened(with_gain(np.zeros_like(theta), max(sigma, EXACTLY))), theta=theta)

    def begun(self, interval: float) -> "LearnedInjector":
        """What holds at a sample interval [s], whatever the one before was."""
        return replace(self, colour=self.colour_at(interval), at_rest=RestingNoise())


@dataclass(frozen=True, eq=False)
class Account:
    """The belief about injector and noise, and the probabilities of the modes in which the injector may be."""

    learned: LearnedInjector
    modes: Mapping[Mode, float] = field(default_factory=lambda: {Mode.STEADY: 1.0})
    velocity: Velocity | None = None  # of wear that moves on
    rival: "Account | None" = field(default=None, metadata=NOT_KEPT)  # explains all events by other elements
    log_odds: float = field(default=0.0, metadata=NOT_KEPT)  # of a rival, against the account that has it
    outlasts: bool = field(default=False, metadata=NOT_KEPT)  # whether a rival has explained an event after its first


def _within(factor: float) -> float:
    return min(max(factor, 1.0), LARGEST_FACTOR)


def _ratio(score: float) -> float:
    return min(score / USUAL_SCORE, LARGEST_RATIO)


@dataclass(frozen=True)
class Overdispersion:
    """The factor on the variance of what events say of the parameters, at least 1: a weighted mean over events."""

    sum: float = PRIOR_EVENTS
    weight: float = PRIOR_EVENTS

    @property
    def factor(self) -> float:
        """Factor by which an event's log likelihood is divided."""
        return _within(self.sum / self.weight)

    def after(self, score: float) -> "Overdispersion":
        """The next value, after an event whose score by the belief before it was tempered by this factor."""
        return Overdispersion(
            SCORES_REMEMBERED * self.sum + _ratio(score) * self.factor, SCORES_REMEMBERED * self.weight + 1.0
        )


class TemperedEvent(NamedTuple):
    """The run of an event with the belief before it, and the covariance (m, m) of that belief."""

    run: EventRun
    covariance: Floats

    def ratio(self, factor: float) -> float:
        """Ratio of a score to the usual one, tempered by a factor."""
        return _ratio(self.run.tempered(factor).score(self.covariance))


def overdispersion_of(events: Sequence[TemperedEvent]) -> float:
    """The factor with which the scores of events are the usual ones on the mean, 1 .. LARGEST_FACTOR."""
    factor = 1.0
    for _ in range(_ROUNDS):
        mean = float(np.mean([event.ratio(factor) for event in events]))
        factor = _within(factor * mean)
    return factor


@dataclass(frozen=True, eq=False)
class LearningState:
    """State of learning, which goes from one event to the next."""

    account: Account
    noise: NoiseLevels
    events: Count = 0  # learned from
    interval: float = 0.0  # of the samples [s]; 0 before the first event
    changes: float = 0.0  # number of changes of the flow, older ones counting less
    elsewhere: Transfer = field(default_factory=Transfer)
    overdispersion: Overdispersion = field(default_factory=Overdispersion)
    held_rail: HeldRail = field(default_factory=HeldRail)
    sensor_slope: SensorSlope = field(default_factory=SensorSlope)
    energizing: CoilDisturbance = field(default_factory=CoilDisturbance)
    standstill: Standstill | None = field(default=None, metadata=NOT_KEPT)  # at the end of the last event

    @property
    def learned(self) -> LearnedInjector:
        return self.account.learned

    def map(self, change: Callable[[LearnedInjector], LearnedInjector]) -> "LearningState":
        return replace(self, account=replace(self.account, learned=change(self.learned)))

    def begun(self, interval: float, overdispersion: float) -> "LearningState":
        """State at the start of a run; with another interval [s] trackers begin anew, for they count samples."""
        if math.isclose(self.interval, interval, rel_tol=SAME_RATE):
            return replace(self, standstill=None)
        return LearningState(
            account=Account(self.learned.begun(interval)),
            noise=self.noise,
            events=self.events,
            interval=interval,
            overdispersion=Overdispersion(PRIOR_EVENTS * overdispersion),
        )


def no_state(noise: NoiseLevels, pressure_scale: float) -> LearningState:
    """State before any event: phi = 0, with the prior. pressure_scale: p_0 [Pa]."""
    theta = np.zeros(SCALARS.width)
    belief = prior_belief(theta.copy(), np.diag(SCALARS.prior(pressure_scale) ** 2))
    return LearningState(Account(LearnedInjector(belief, theta)), noise)


class Adoption(StrEnum):
    ADOPTED = "adopted"
    REJECTED = "rejected"  # what was in force stays
    FAILED = "failed"  # singular information, or no finite cost


@dataclass(frozen=True)
class Knowledge:
    """Knowledge after an event, as one value that can be saved and restored."""

    state: LearningState
    in_force: Theta  # (m,) theta that the observer uses; 0 at the start
    phi_version: int = 0  # number of adoptions
    lift: RestingLift = field(default_factory=RestingLift)  # with which the stream starts


def no_knowledge(noise: NoiseLevels, pressure_scale: float) -> Knowledge:
    """Knowledge of a new injector: phi = 0 and the prior. pressure_scale p_0 [Pa]."""
    return Knowledge(no_state(noise, pressure_scale), np.zeros(SCALARS.width))


@dataclass(frozen=True)
class Outcome:
    """Result of learning from one event: what the observer uses from now on, and what the event's report needs."""

    adoption: Adoption
    knowledge: Knowledge  # its `in_force` is the new theta if it was adopted, else the old one
    schedule: GainSchedule
    forward: tuple[Objection, ...]  # to the learned state
    objections: tuple[Objection, ...]  # those, and the objections to the event's own mass
    estimate: Floats  # (m,) new theta, adopted or not
    covariance: Floats  # (m, m) of its error
    resimulated: Resimulation | None = None  # the event with the estimate; None: nothing was learned
    outliers: int = 0  # samples of the line pressure left out, without those that the stream had bridged
    known_flow: KnownFlow = EVERYWHERE  # where the flow is known well enough to be used
    change: Reason = Reason.NONE  # shown by an event that passed
    posterior: tuple[tuple[str, float], ...] = ()  # each hypothesis in words, with its probability


@dataclass(frozen=True, eq=False)
class EventRecord:
    event: np.void  # `stream.state.EVENT`
    objections: tuple[Objection, ...]  # what speaks against it
    outcome: Outcome | None  # what was learned from it; None: nothing
    is_late: bool  # it was to be learned from, and was judged before
    knowledge: Knowledge  # that the observer carries now
    constants: Constants  # of the observer during the event
