"""Linearisations of an event about one theta, with one noise model, that serve all hypotheses near it."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gain import GainSchedule
from observer_rt.engine.estimation.phases import PhaseStatistics, phase_statistics
from observer_rt.engine.estimation.prediction_error import EventCost, Linearisation
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.account.constants import NEAR
from observer_rt.engine.learning.account.fault_density import at_fault
from observer_rt.engine.learning.adequacy import CLIP
from observer_rt.engine.learning.disturbances.colour import is_same
from observer_rt.engine.learning.disturbances.noise_levels import mask_of
from observer_rt.engine.learning.fitting import EventFit
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.engine.learning.posterior.reader import Follows
from observer_rt.engine.learning.posterior.resting_pressure import RestingPressure


@dataclass(frozen=True, eq=False)
class EventReading:
    """Cost of an event at the theta of `learned`, and its linearisation there.

    schedule: gains by the noise at rest; innovations (n,): whitened; unfiltered (n,): with the colour of the noise;
    slopes (n, m): of the innovations; phases (n,); healthy: residuals of a healthy injector; resting: line pressure
    at rest around the event.
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
    resting: RestingPressure
    _left: dict[bytes, PhaseStatistics] = field(default_factory=dict)

    @cached_property
    def level(self) -> float:
        """Nats that the noise level adds: it differs from colour to colour, and densities must share one unit."""
        return self.cost.terms * math.log(self.cost.sigma) / self.cost.temper

    def is_near(self, learned: LearnedInjector, longest_step: Theta) -> bool:
        """Whether the linearisation also serves another belief; longest_step (m,): up to which slopes hold."""
        away = np.abs(learned.theta - self.learned.theta)
        return is_same(learned.colour, self.learned.colour) and bool(np.all(away <= NEAR * longest_step))

    def innovations_at(self, theta: Theta, fit: EventFit | None) -> NDArray[np.float64]:
        """Innovations (n,) at theta (m,): those of its fit, to first order without one."""
        if fit is not None:
            return fit.innovations
        return self.innovations + self.slopes @ (theta - self.first.theta)

    def leaves(self, theta: Theta, fit: EventFit | None) -> PhaseStatistics:
        """Statistics of the clipped innovations at theta (m,)."""
        key = theta.tobytes()
        if key not in self._left:
            self._left[key] = self._statistics(theta, fit, CLIP)
        return self._left[key]

    def at_fault(self, theta: Theta, fit: EventFit | None) -> float:
        """Cost [nats] of the innovations at theta (m,) if the event is at fault, and of the offset at rest."""
        temper = self.cost.temper
        return at_fault(self._statistics(theta, fit), temper) + self.cost.of_offset(theta) / temper

    def _statistics(self, theta: Theta, fit: EventFit | None, limit: float = math.inf) -> PhaseStatistics:
        innovations, cost = self.innovations_at(theta, fit), self.cost
        mask = mask_of(self.window)
        return phase_statistics(innovations, cost.sigma, self.phases, cost.burn_in, mask, limit)
