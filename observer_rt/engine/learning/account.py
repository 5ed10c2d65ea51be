"""The belief about injector and noise, and the account of its changes: its modes, and the scatter of events beyond.

A quasi-likelihood: what an event says of the parameters counts for less by the factor by which such events were seen
to differ (McCullagh, Nelder, Generalized Linear Models, 2nd ed., section 4.5).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.belief import Belief, GatedBelief, held_at
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics
from observer_rt.engine.estimation.run import Run
from observer_rt.engine.estimation.scalars import EXACTLY, SCALARS, Parameter, Theta, with_gain
from observer_rt.engine.learning.disturbances.colour import Colour, RestingNoise
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.hypotheses import Mode, Velocity
from observer_rt.engine.learning.learned_range import EventPoint
from observer_rt.engine.learning.scales import shrink
from observer_rt.foundation.records import NOT_KEPT

USUAL_SCORE = 1.2  # of events that scatter by noise alone; their mean is 1
REMEMBERED = 0.95  # weight of the scores before an event
PRIOR_EVENTS = 10.0  # for which the factor of the fit counts at first
LARGEST_RATIO = 2.5  # of a score to the usual one, up to which it is scatter and no change of the injector
LARGEST = 8.0  # factor; a model worse than that is inadequate
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
    return min(max(factor, 1.0), LARGEST)


def _ratio(score: float) -> float:
    """Ratio of a score to the usual one, LARGEST_RATIO at most."""
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
        return Overdispersion(REMEMBERED * self.sum + _ratio(score) * self.factor, REMEMBERED * self.weight + 1.0)


def of_healthy(factor: float) -> Overdispersion:
    """Overdispersion before any event, by the factor of the healthy injector, 1 of a model that is exact."""
    return Overdispersion(PRIOR_EVENTS * factor)


class TemperedEvent(NamedTuple):
    """The run of an event with the belief before it, and the covariance (m, m) of that belief."""

    run: Run
    covariance: NDArray[np.float64]

    def ratio(self, factor: float) -> float:
        """Ratio of a score to the usual one, tempered by a factor."""
        return _ratio(self.run.tempered(factor).score(self.covariance))


def overdispersion_of(events: Sequence[TemperedEvent]) -> float:
    """The factor with which the scores of events are the usual ones on the mean, 1 .. LARGEST."""
    factor = 1.0
    for _ in range(_ROUNDS):
        mean = float(np.mean([event.ratio(factor) for event in events]))
        factor = _within(factor * mean)
    return factor
