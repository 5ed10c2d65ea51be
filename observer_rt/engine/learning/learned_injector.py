"""Estimate of an injector and of the noise of its bench, as one frozen value; its weights shrunk towards 0.

A belief has the whole prior, so that any law is learned when it comes. The carried theta has the likely scales, s
times the prior, of each curve of the network by itself: s is `NONE`, `SMALL` or 1, weighed by marginal likelihood
(MacKay, Information Theory, Inference, and Learning Algorithms, chapter 28), and of the likely ones the mixture.
"""

import itertools
import math
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.evidence import weigh_scales
from observer_rt.core.learning.gating import inverse_of
from observer_rt.engine.estimation.gating import Belief, GatedBelief, held_at, symmetric
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics
from observer_rt.engine.estimation.scalars import EXACTLY, SCALARS, WEIGHTS, Parameter, Theta, with_gain
from observer_rt.engine.learning import constants as c
from observer_rt.engine.learning.disturbances.colour import Colour, RestingNoise
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.learned_range import EventPoint
from observer_rt.model.network import HIDDEN, NEURONS, OF_NOZZLE

Vector = NDArray[np.float64]
NONE, SMALL, WHOLE = 1e-3, 0.1, math.sqrt(0.999)  # of the prior: no law at all, small ones, any
_PRIOR = SCALARS.prior(1.0)[WEIGHTS]
_SCALES = np.array([NONE, SMALL, WHOLE]) ** 2
_NOISES = _SCALES / (1.0 - _SCALES)
_ENDS = np.cumsum(NEURONS)
_OF_NOZZLE = int(np.searchsorted(_ENDS, OF_NOZZLE)) + 1  # curves
_CHOICES = np.array([*itertools.product(range(_SCALES.size), repeat=NEURONS.size)])  # of a scale for every curve
_SQUARES = np.repeat(_SCALES[_CHOICES], NEURONS, axis=1)
NOISE = _SQUARES / (1.0 - _SQUARES)
"""Variances (choices, HIDDEN) with which weights of each choice of scales were 0, in units of the prior's."""
_ALL = np.arange(HIDDEN)


def _offered(scales: NDArray[np.int64]) -> Vector:
    """Logarithms of how likely choices (k, curves) of a flow's scales are before any event.

    Of a flow with a law all curves have one scale as likely as not: a law over one input is nearly one over others.
    """
    choices = _SCALES.size ** scales.shape[1] - 1
    one_scale = (scales == scales[:, :1]).all(axis=1) / (_SCALES.size - 1)
    lawful = (1.0 - c.LAWLESS) * (c.ONE_SCALE * one_scale + (1.0 - c.ONE_SCALE) / choices)
    return np.log(np.where(scales.any(axis=1), lawful, c.LAWLESS))


_BEFORE = _offered(_CHOICES[:, :_OF_NOZZLE]) + _offered(_CHOICES[:, _OF_NOZZLE:])
_BEFORE -= 0.5 * np.log1p(-_SQUARES).sum(axis=1)


def weighed_scales(mean: Vector, covariance: Vector, offered: Vector | float = 0.0) -> tuple[Vector, Vector]:
    """Logarithms of how likely each choice of scales is by a mean (m,) and covariance (m, m) with the whole prior.

    A prior smaller by s is the whole one after each weight was measured to be 0 with s^2/(1 - s^2) of its variance; s
    is as likely as that, and as `offered` says. And the mean (m,) at the likeliest. Raises numpy.linalg.LinAlgError
    when not positive definite.
    """
    logs = _BEFORE + offered
    return logs, weigh_scales(mean, covariance, WEIGHTS, _PRIOR, _ENDS, _NOISES, logs)


def _choice_weights(belief: Belief) -> Vector:
    """Probability (choices,) of each choice of scales."""
    logs, _ = weighed_scales(belief.mean, belief.covariance)
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


def law_probabilities(belief: Belief) -> Vector:
    """Probability (curves,) that a flow goes by the input of each curve of the network."""
    return np.asarray(_choice_weights(belief) @ (_CHOICES > 0))


@lru_cache(8)
def shrink(belief: Belief) -> Belief:
    """The belief with weights of the likely scales: moments of the mixture over their likeliest choices."""
    weights = _choice_weights(belief)
    order = np.argsort(-weights, kind="stable")[: c.CHOICES]
    order = order[: int(np.searchsorted(np.cumsum(weights[order]), c.CHOSEN)) + 1]
    shares = weights[order] / weights[order].sum()
    parts = [at_scale(belief, NOISE[choice]) for choice in order]
    mean = shares @ np.array([part.mean for part in parts])
    away = np.array([part.mean - mean for part in parts])
    between = (shares * away.T) @ away
    covariance = sum((share * part.covariance for share, part in zip(shares, parts, strict=True)), between)
    error = sum((share * part.error_covariance for share, part in zip(shares, parts, strict=True)), between)
    return Belief(mean, symmetric(covariance), symmetric(error))


def at_scale(belief: Belief, noise: Vector) -> Belief:
    """The belief after each weight was measured to be 0, with a variance (HIDDEN,) in units of its prior's."""
    across = belief.covariance[WEIGHTS] / _PRIOR[:, None]  # in units of the weights' prior
    variance = across[:, WEIGHTS] / _PRIOR
    variance[_ALL, _ALL] += noise
    gain = (inverse_of(variance)[0] @ across).T
    by_error = gain @ (belief.error_covariance[WEIGHTS] / _PRIOR[:, None])
    error = belief.error_covariance - by_error - by_error.T
    error += (by_error[:, WEIGHTS] / _PRIOR + gain * noise) @ gain.T
    mean = belief.mean - gain @ (belief.mean[WEIGHTS] / _PRIOR)
    return Belief(mean, symmetric(belief.covariance - gain @ across), symmetric(error))


@dataclass(frozen=True, eq=False)
class LearnedInjector:
    """Belief about injector and noise.

    belief: about all parameters jointly; theta (m,): where the last event was explained; statistics: of recent
    innovations; active: the gated columns in use; is_prior: nothing was learned yet, or all of it was forgotten;
    colour: of the innovations, None while they are white; at_rest: by which it is found; learned_at: the operating
    points of the last events.
    """

    belief: Belief
    theta: Theta
    statistics: PhaseStatistics = field(default_factory=no_statistics)
    active: frozenset[int] = frozenset()
    is_prior: bool = True
    colour: Colour | None = None
    at_rest: RestingNoise = field(default_factory=RestingNoise)
    learned_at: tuple[EventPoint, ...] = ()

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
