"""Knowledge of the observer: the belief about all parameters, those in force, and the result of an event."""

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

    state: with which learning goes on; in_force: theta (m,) the observer carries, 0 at start; phi_version: how often
    another one was adopted; lift: what a shut needle's shows, from which the stream starts.
    """

    state: LearningState
    in_force: Theta
    phi_version: int = 0
    lift: RestingLift = field(default_factory=RestingLift)


def no_knowledge(noise: NoiseLevels, pressure_scale: float) -> Knowledge:
    """Knowledge of a new part: phi = 0 and the prior. pressure_scale p_0 [Pa]."""
    return Knowledge(no_state(noise, pressure_scale), np.zeros(SCALARS.width))


@dataclass(frozen=True)
class Outcome:
    """Result of learning from one event: what to carry from the adoption point on, and the event's report.

    knowledge: its `in_force` is the new theta when adopted, else the old one. forward: objections to the state that
    is carried on, objections: to the event's own mass, too. estimate: the new theta in any case, with the covariance
    (m, m) of its error. resimulated: the event with the estimate, None where nothing usable was learned from it.
    outliers: samples of the line pressure that were left out, of those that the stream had not bridged. loudest: mean
    square of its innovations where it is loudest over that at rest, by its known noise. known_flow: where the flow is
    known well enough by the state to be carried. prior: belief before the event, drift included. window, setting:
    with which it was run again. change: that an event showed which passed. posterior: what the event may be, in
    words, and how probable.
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
    """Learner between events: ours, or one that looks on."""

    @property
    def schedule(self) -> GainSchedule:
        """Gains of the live x~."""

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Learn from one event, during which `in_force` (m,) was carried; its constants, None: as they were."""
