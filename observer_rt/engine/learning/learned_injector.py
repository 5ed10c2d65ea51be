"""Estimate of an injector and of the noise of its bench, as one frozen value."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from observer_rt.engine.estimation.belief import Belief, held_at
from observer_rt.engine.estimation.gating import GatedBelief
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics
from observer_rt.engine.estimation.scalars import EXACTLY, SCALARS, Parameter, Theta, with_gain
from observer_rt.engine.learning.disturbances.colour import Colour, RestingNoise
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.learned_range import EventPoint
from observer_rt.engine.learning.scales import shrink


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
