"""What the observer knows: parameters with their prior and bounds, the belief about them, what an event adds."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import GainSchedule, NoiseLevels
from observer_rt.estimation.gating import Gate
from observer_rt.estimation.phases import (
    PhaseStatistics,
    no_statistics,
)
from observer_rt.estimation.posterior import Belief, prior_belief
from observer_rt.estimation.predictor import Window
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.network import HIDDEN
from observer_rt.model.sensor import LAG_UNIT
from observer_rt.observer.learning.adequacy import Finding
from observer_rt.observer.learning.interval import Resimulated
from observer_rt.observer.stream.phi import Phi, StructuredPhi
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import Constants


@dataclass(frozen=True)
class Scales:
    """A number for every group of parameters, in the units the comments name."""

    nozzle_bias: float  # -
    nozzle_weight: float  # -
    seat_bias: float  # -
    offset: float  # Pa
    friction: float  # -
    leakage: float  # of Q_0 at p_0
    stiffness: float  # -
    lag: float  # s
    air: float  # K g / p_0
    back_pressure: float  # Pa

    def vector(self, pressure_scale: float) -> NDArray[np.float64]:
        """In the order of `Parameter`, (PARAMETERS,); pressure_scale p_0 [Pa]."""
        result = np.zeros(PARAMETERS)
        result[Parameter.NOZZLE_BIAS] = self.nozzle_bias
        result[Parameter.NOZZLE_WEIGHT : Parameter.NOZZLE_WEIGHT + HIDDEN] = self.nozzle_weight
        result[Parameter.SEAT_BIAS] = self.seat_bias
        result[Parameter.LINE_PRESSURE_OFFSET] = self.offset / pressure_scale
        result[Parameter.LINE_FRICTION] = self.friction
        result[Parameter.GUIDE_LEAKAGE] = self.leakage
        result[Parameter.BULK_MODULUS] = self.stiffness
        result[Parameter.SENSOR_LAG] = self.lag / LAG_UNIT
        result[Parameter.ENTRAINED_AIR] = self.air
        result[Parameter.BACK_PRESSURE : Parameter.BACK_PRESSURE + 2] = self.back_pressure / pressure_scale
        return result


PRIOR = Scales(0.45, 0.05, 0.4, 2.5e6, 1.75, 0.09, 0.18, 35e-6, 0.05, 5e6)
DRIFT = Scales(5e-4, 3e-4, 5e-4, 2e3, 2e-3, 3.3e-4, 2e-4, 0.1e-6, 1e-4, 20e3)
LONGEST_STEP = Scales(0.3, 1.0, 0.3, 10e6, 1.2, 1.0, 0.12, 25e-6, 0.04, 30e6)
"""Of one Gauss-Newton iteration: beyond it the slopes say little."""
LOWEST = Scales(-0.8, -1.0, -0.8, -10e6, -0.95, 0.0, -0.6, 0.0, 0.0, -30e6)
HIGHEST = Scales(1.5, 1.0, 1.5, 10e6, 10.0, 1.0, 1.0, 0.5e-3, 0.5, 30e6)
GATE = Gate(
    columns=(
        int(Parameter.LINE_FRICTION),
        int(Parameter.GUIDE_LEAKAGE),
        int(Parameter.BULK_MODULUS),
        int(Parameter.SENSOR_LAG),
        int(Parameter.ENTRAINED_AIR),
        int(Parameter.BACK_PRESSURE),
        int(Parameter.BACK_PRESSURE) + 1,
    ),
    lowest=(-0.95, 0.0, -0.6, 0.0, 0.0, 0.0, 0.0),
)


@dataclass(frozen=True)
class LearningRules:
    """What the learner assumes: prior, drift from event to event (one sigma each), which scalars must pay."""

    prior: Scales = PRIOR
    drift: Scales = DRIFT
    gate: Gate = GATE


DEFAULT_RULES = LearningRules()


class Verdict(StrEnum):
    """What came of learning from an event."""

    ADOPTED = "adopted"
    REJECTED = "rejected"  # the new theta does not lower the re-simulated output error
    FAILED = "failed"  # singular information, or no finite cost
    SET_ASIDE = "set aside"  # events in a row are not explained: the nominal model is carried meanwhile
    FROZEN = "frozen"  # the standstill contradicts the model: nothing learned from it may be used


def theta_bounds(pressure_scale: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest admissible theta (PARAMETERS,); pressure_scale p_0 [Pa]."""
    return LOWEST.vector(pressure_scale), HIGHEST.vector(pressure_scale)


@dataclass(frozen=True)
class Knowledge:
    """All that was learned, as one value that can be saved and restored.

    belief: about all parameters jointly; active: the gated columns in use; in_force: theta (m,) the observer carries,
    0 at start; noise: levels in use.
    """

    belief: Belief
    in_force: NDArray[np.float64]
    noise: NoiseLevels
    active: frozenset[int] = frozenset()
    phi_version: int = 0
    events: int = 0  # learned from
    statistics: PhaseStatistics = field(default_factory=no_statistics)


def no_knowledge(
    noise: NoiseLevels, pressure_scale: float, rules: LearningRules = DEFAULT_RULES
) -> Knowledge:
    """Knowledge of a new part: phi = 0 and the prior. pressure_scale p_0 [Pa]."""
    prior = prior_belief(np.zeros(PARAMETERS), np.diag(rules.prior.vector(pressure_scale) ** 2))
    return Knowledge(prior, np.zeros(PARAMETERS), noise)


@dataclass(frozen=True)
class Outcome:
    """Result of learning from one event: what to carry from the adoption point on, and what to say of the event.

    knowledge: its `in_force` is the new theta when adopted, else the old one. estimate: the new theta in any case,
    with the covariance (m, m) of its error, None where the training knows none. resimulated: the event with the
    estimate, None where nothing usable was learned from it. phi: what x^ is to carry.
    """

    verdict: Verdict
    knowledge: Knowledge
    schedule: GainSchedule
    findings: tuple[Finding, ...]
    estimate: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    resimulated: Resimulated | None = None
    phi: Phi = field(default_factory=StructuredPhi)


class EventLearner(Protocol):
    """What learns between events, whichever training it uses."""

    @property
    def schedule(self) -> GainSchedule:
        """Gains of the live x~."""

    @property
    def phi(self) -> Phi:
        """What x^ carries at the start, in arrays of its own."""

    def learn(
        self,
        window: Window,
        standstill: Standstill,
        in_force: NDArray[np.float64],
        constants: Constants | None = None,
    ) -> Outcome:
        """Learn from one event, during which `in_force` (m,) was carried; its constants, None: as they were."""
