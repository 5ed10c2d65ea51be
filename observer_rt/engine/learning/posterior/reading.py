"""Readings of an event: linearised round one theta in one colour of the noise, for all hypotheses near it."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gain import GainSchedule
from observer_rt.engine.estimation.phases import PhaseStatistics, phase_statistics
from observer_rt.engine.estimation.prediction_error import EventCost, Linearisation
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.account.constants import NEAR
from observer_rt.engine.learning.account.fault_density import Densities, densities
from observer_rt.engine.learning.adequacy import CLIP
from observer_rt.engine.learning.disturbances.colour import is_same
from observer_rt.engine.learning.disturbances.noise_levels import mask_of
from observer_rt.engine.learning.fitting import EventFit
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.engine.learning.posterior.reader import Follows


class Left(NamedTuple):
    """What innovations an event leaves: their densities, and statistics against a healthy injector's."""

    densities: Densities
    statistics: PhaseStatistics


@dataclass(frozen=True, eq=False)
class EventReading:
    """An event read with what `learned` says: its cost, and that linearised.

    innovations, unfiltered: (n,) there, the latter with the colour of the noise; slopes: (n, m); phases: (n,);
    healthy: what is left of a healthy injector.
    """

    learned: LearnedInjector
    window: Window
    schedule: GainSchedule
    follows: Follows
    cost: EventCost
    first: Linearisation
    innovations: NDArray[np.float64]
    unfiltered: NDArray[np.float64]
    slopes: NDArray[np.float64]
    phases: NDArray[np.int8]
    healthy: Healthy
    _left: dict[bytes, Left] = field(default_factory=dict)

    @property
    def level(self) -> float:
        """Nats by the level of the noise: colours have others, and densities are compared in one unit."""
        return self.cost.terms * math.log(self.cost.sigma) / self.cost.temper

    def is_near(self, learned: LearnedInjector, longest_step: Theta) -> bool:
        """Whether the linearisation serves another belief, too; longest_step: (m,) up to which slopes hold."""
        away = np.abs(learned.theta - self.learned.theta)
        return is_same(learned.colour, self.learned.colour) and bool(np.all(away <= NEAR * longest_step))

    def innovations_at(self, theta: Theta, fit: EventFit | None) -> NDArray[np.float64]:
        """Innovations (n,) with theta (m,), to first order where it was not fitted."""
        if fit is not None:
            return fit.innovations
        return self.innovations + self.slopes @ (theta - self.first.theta)

    def leaves(self, theta: Theta, fit: EventFit | None) -> Left:
        """What theta (m,) leaves; the price of the offset at rest is part of either density."""
        key = theta.tobytes()
        if key not in self._left:
            innovations, cost = self.innovations_at(theta, fit), self.cost
            plain, clipped = (
                phase_statistics(
                    innovations, cost.sigma, self.phases, cost.burn_in, mask_of(self.window), limit
                )
                for limit in (math.inf, CLIP)
            )
            found = densities(plain, clipped, cost.temper, self.healthy)
            found = found._replace(at_fault=found.at_fault + cost.of_offset(theta) / cost.temper)
            self._left[key] = Left(found, self.healthy.relative(clipped))
        return self._left[key]
