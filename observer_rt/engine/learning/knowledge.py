"""What the observer has learned: the belief about all parameters, those in force, and the result of an event."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gain import GainSchedule, NoiseLevels
from observer_rt.engine.estimation.gating import Belief
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import SCALARS, Theta
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.interval import Resimulation
from observer_rt.engine.learning.learned_range import EVERYWHERE, KnownFlow
from observer_rt.engine.learning.state import LearningState, no_state
from observer_rt.engine.stream.standstill import RestingLift, Standstill
from observer_rt.engine.stream.state import Constants, Reason


class Adoption(StrEnum):
    """Result of learning from an event."""

    ADOPTED = "adopted"
    REJECTED = "rejected"  # what was in force stays
    FAILED = "failed"  # singular information, or no finite cost


@dataclass(frozen=True)
class Knowledge:
    """Knowledge after an event, as one value that can be saved and restored.

    state: of the learning; in_force: theta (m,) that the observer uses, 0 at the start; phi_version: number of
    adoptions; lift: zero and crosstalk of a shut needle's lift, with which the stream starts.
    """

    state: LearningState
    in_force: Theta
    phi_version: int = 0
    lift: RestingLift = field(default_factory=RestingLift)


def no_knowledge(noise: NoiseLevels, pressure_scale: float) -> Knowledge:
    """Knowledge of a new injector: phi = 0 and the prior. pressure_scale p_0 [Pa]."""
    return Knowledge(no_state(noise, pressure_scale), np.zeros(SCALARS.width))


@dataclass(frozen=True)
class Outcome:
    """Result of learning from one event: what the observer uses from now on, and what the event's report needs.

    knowledge: its `in_force` is the new theta if it was adopted, else the old one. forward: objections to the learned
    state; objections: those and the objections to the event's own mass. estimate: the new theta, adopted or not, with
    the covariance (m, m) of its error. resimulated: the event simulated with the estimate, None if nothing was
    learned. outliers: number of samples of the line pressure that were left out, without those that the stream had
    bridged. loudest: largest mean square of the innovations, relative to that at rest. known_flow: where the flow is
    known well enough to be used. prior: belief before the event, drift included. window, setting: inputs of the
    simulation. change: shown by an event that passed. posterior: each hypothesis in words, with its probability.
    """

    adoption: Adoption
    knowledge: Knowledge
    schedule: GainSchedule
    forward: tuple[Objection, ...]
    objections: tuple[Objection, ...]
    estimate: NDArray[np.float64]
    covariance: NDArray[np.float64]
    resimulated: Resimulation | None = None
    outliers: int = 0
    loudest: float = 1.0
    known_flow: KnownFlow = EVERYWHERE
    prior: Belief | None = None
    window: Window | None = None
    setting: Setting | None = None
    change: Reason = Reason.NONE
    posterior: tuple[tuple[str, float], ...] = ()


class EventLearner(Protocol):
    """Learns between events: our learner, or one that only watches."""

    @property
    def schedule(self) -> GainSchedule:
        """Gains of the live x~."""

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Learn from an event, during which `in_force` (m,) was used; constants: None if they are unchanged."""
