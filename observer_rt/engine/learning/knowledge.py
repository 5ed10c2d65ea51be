"""Knowledge of the observer: the state of learning, the parameters in force, and the outcome of an event.

Each tracker is a frozen class in a module of its own, with a method `after` that returns its next value, and is one
field here; the state file keeps it by the names of its fields. Nothing writes into the arrays.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.belief import prior_belief
from observer_rt.engine.estimation.gain import GainSchedule, NoiseLevels
from observer_rt.engine.estimation.scalars import SCALARS, Theta
from observer_rt.engine.learning.account import Account, LearnedInjector, Overdispersion, of_healthy
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.disturbances.coil_current import CoilDisturbance
from observer_rt.engine.learning.disturbances.colour import SlowRail
from observer_rt.engine.learning.disturbances.time_jitter import TimeJitter
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.interval import Resimulation
from observer_rt.engine.learning.learned_range import EVERYWHERE, KnownFlow, Transfer
from observer_rt.engine.stream.standstill import HeldRail, RestingLift, Standstill
from observer_rt.engine.stream.state import Constants, Reason
from observer_rt.foundation.records import NOT_KEPT, Count


@dataclass(frozen=True, eq=False)
class LearningState:
    """State of learning, which goes from one event to the next."""

    account: Account
    noise: NoiseLevels
    events: Count = 0  # learned from
    interval: float = 0.0  # of the samples [s]; 0 before the first event
    changes: float = 0.0  # number of changes of the flow, older ones counting less
    elsewhere: Transfer = field(default_factory=Transfer)
    slow_rail: SlowRail = field(default_factory=SlowRail)
    jitter: TimeJitter = field(default_factory=TimeJitter)
    overdispersion: Overdispersion = field(default_factory=Overdispersion)
    held_rail: HeldRail = field(default_factory=HeldRail)
    energizing: CoilDisturbance = field(default_factory=CoilDisturbance)
    standstill: Standstill | None = field(default=None, metadata=NOT_KEPT)  # at the end of the last event

    @property
    def learned(self) -> LearnedInjector:
        """The belief about injector and noise."""
        return self.account.learned

    def map(self, change: Callable[[LearnedInjector], LearnedInjector]) -> "LearningState":
        """State after a change of the belief."""
        return replace(self, account=replace(self.account, learned=change(self.learned)))

    def begun(self, interval: float, overdispersion: float) -> "LearningState":
        """State at the start of a run with samples of an interval [s]; overdispersion: of the healthy injector.

        With another interval than before the trackers begin anew, for they count in samples.
        """
        if math.isclose(self.interval, interval, rel_tol=SAME_RATE):
            return replace(self, standstill=None)
        return LearningState(
            account=Account(self.learned.begun(interval)),
            noise=self.noise,
            events=self.events,
            interval=interval,
            overdispersion=of_healthy(overdispersion),
        )


def no_state(noise: NoiseLevels, pressure_scale: float) -> LearningState:
    """State before any event: phi = 0, with the prior. pressure_scale: p_0 [Pa]."""
    theta = np.zeros(SCALARS.width)
    belief = prior_belief(theta.copy(), np.diag(SCALARS.prior(pressure_scale) ** 2))
    return LearningState(Account(LearnedInjector(belief, theta)), noise)


class Adoption(StrEnum):
    """Result of learning from an event."""

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
    estimate: NDArray[np.float64]  # (m,) new theta, adopted or not
    covariance: NDArray[np.float64]  # (m, m) of its error
    resimulated: Resimulation | None = None  # the event with the estimate; None: nothing was learned
    outliers: int = 0  # samples of the line pressure left out, without those that the stream had bridged
    loudest: float = 1.0  # largest mean square of the innovations, relative to that at rest
    known_flow: KnownFlow = EVERYWHERE  # where the flow is known well enough to be used
    change: Reason = Reason.NONE  # shown by an event that passed
    posterior: tuple[tuple[str, float], ...] = ()  # each hypothesis in words, with its probability


@dataclass(frozen=True, eq=False)
class EventRecord:
    """An event that was judged."""

    event: np.void  # `stream.state.EVENT`
    objections: tuple[Objection, ...]  # what speaks against it
    outcome: Outcome | None  # what was learned from it; None: nothing
    is_late: bool  # it was to be learned from, and was judged before
    knowledge: Knowledge  # that the observer carries now
    constants: Constants  # of the observer during the event
