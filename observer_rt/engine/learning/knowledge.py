"""What the observer knows: the belief about all parameters, what is in force, what an event adds."""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gain import GainSchedule, NoiseLevels
from observer_rt.engine.estimation.gating import Belief, prior_belief
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import SCALARS, Scalars, Theta
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.disturbances.colour import Colour
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.interval import EVERYWHERE, EventPoint, KnownFlow, Resimulated
from observer_rt.engine.learning.memory import NOTHING, Memory, Remembered
from observer_rt.engine.stream.phi import Phi, StructuredPhi
from observer_rt.engine.stream.standstill import RestingLift, Standstill
from observer_rt.engine.stream.state import Constants


class Adoption(StrEnum):
    """What came of learning from an event."""

    ADOPTED = "adopted"
    REJECTED = "rejected"  # the new theta does not lower the re-simulated output error
    FAILED = "failed"  # singular information, or no finite cost
    SET_ASIDE = "set aside"  # events in a row are not explained: what explains them best is carried meanwhile
    FROZEN = "frozen"  # the standstill contradicts the model: nothing learned from it may be used


@dataclass(frozen=True)
class Knowledge:
    """All that was learned, as one value that can be saved and restored.

    belief: about all parameters jointly; active: the gated columns in use; in_force: theta (m,) the observer carries,
    0 at start; noise: levels in use; colour: of the innovations, None while they are white; learned_at: the operating
    points of the last events learned from; memory: what learning follows from event to event, and its doubts;
    lift: what a shut needle's shows, from which the stream starts; scalars: the table theta goes by.
    """

    belief: Belief
    in_force: NDArray[np.float64]
    noise: NoiseLevels
    active: frozenset[int] = frozenset()
    phi_version: int = 0
    events: int = 0  # learned from
    statistics: PhaseStatistics = field(default_factory=no_statistics)
    colour: Colour | None = None
    learned_at: tuple[EventPoint, ...] = ()
    memory: Memory = NOTHING
    lift: RestingLift = field(default_factory=RestingLift)
    scalars: Scalars = field(default=SCALARS, repr=False, compare=False)

    def colour_at(self, interval: float) -> Colour | None:
        """The colour, if it was found at this sample interval [s]."""
        colour = self.colour
        if colour is None or not math.isclose(colour.interval, interval, rel_tol=SAME_RATE):
            return None
        return colour

    def memory_at(self, interval: float) -> Remembered:
        """What was remembered, if it was at this sample interval [s]."""
        return self.memory.found if math.isclose(self.memory.interval, interval, rel_tol=SAME_RATE) else {}


def no_knowledge(noise: NoiseLevels, pressure_scale: float, scalars: Scalars = SCALARS) -> Knowledge:
    """Knowledge of a new part: phi = 0 and the prior. pressure_scale p_0 [Pa]."""
    prior = prior_belief(np.zeros(scalars.width), np.diag(scalars.prior(pressure_scale) ** 2))
    return Knowledge(prior, np.zeros(scalars.width), noise, scalars=scalars)


@dataclass(frozen=True)
class Outcome:
    """Result of learning from one event: what to carry from the adoption point on, and what to say of the event.

    knowledge: its `in_force` is the new theta when adopted, else the old one. estimate: the new theta in any case,
    with the covariance (m, m) of its error, None where the training knows none. resimulated: the event with the
    estimate, None where nothing usable was learned from it. phi: what x^ is to carry.
    outliers: samples of the line pressure that were left out, of those that the stream had not bridged. loudest: mean
    square of its innovations where it is loudest over that at rest, by what is known of its noise. known:
    where the flow is known well enough by what is to be carried.
    """

    adoption: Adoption
    knowledge: Knowledge
    schedule: GainSchedule
    objections: tuple[Objection, ...]
    estimate: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    resimulated: Resimulated | None = None
    phi: Phi = field(default_factory=StructuredPhi)
    outliers: int = 0
    loudest: float = 1.0
    known: KnownFlow = EVERYWHERE


class EventLearner(Protocol):
    """What learns between events, whichever training it uses."""

    @property
    def schedule(self) -> GainSchedule:
        """Gains of the live x~."""

    @property
    def phi(self) -> Phi:
        """What x^ carries at the start, in arrays of its own."""

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Learn from one event, during which `in_force` (m,) was carried; its constants, None: as they were."""
