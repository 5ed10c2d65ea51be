"""What an event injected, by the hypothesis that is carried and by the others, and how well that is known."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.predictor import follow
from observer_rt.engine.estimation.predictor import NO_SLOPES, Setting, Window, level_of
from observer_rt.engine.estimation.scalars import Theta, learned_of
from observer_rt.engine.learning.account import constants as c
from observer_rt.engine.learning.account.account import Account
from observer_rt.engine.learning.account.hypotheses import FLOWS
from observer_rt.engine.learning.interval import Resimulation
from observer_rt.engine.learning.posterior.event import ExplainedEvent
from observer_rt.foundation.units import Z_95

LEAD = 15  # samples before the opening
LEAST = 1e-13  # m3, of which shares are taken
FURTHER = 20  # samples after the last rate, by which another theta's may end later


@dataclass(frozen=True, eq=False)
class EventMass:
    """Volume [m3] of an event, run again with theta (m,), and its slopes (m,), as shares of it.

    flows_until: sample from which on nothing was injected.
    """

    window: Window
    setting: Setting
    theta: Theta
    volume: float
    slopes: Theta
    by_inputs: float
    flows_until: int

    def moved(self, theta: Theta) -> float:
        """Share by which the volume is larger with another theta (m,), along its slopes."""
        return float(self.slopes @ (theta - self.theta))

    def moved_far(self, theta: Theta) -> float:
        """The same, open loop where flows are others by much."""
        if np.max(np.abs(theta - self.theta)[list(FLOWS)]) <= c.FAR_FLOW:
            return self.moved(theta)
        return self.ratio(theta) - 1.0

    def ratio(self, theta: Theta) -> float:
        """Volume with another theta (m,), open loop, over this one."""
        if np.array_equal(theta, self.theta):
            return 1.0
        learned, window = learned_of(theta, self.setting.coefficients), self.window.until(self.flows_until)
        rate, errors = np.empty((2, window.output.size))
        follow(window, self.setting, learned, window.opening, errors, rate, None, NO_SLOPES)
        volume = float(np.trapezoid(rate[_part(window)])) * self.setting.interval
        return level_of(theta, self.setting) * volume / max(self.volume, LEAST)

    @property
    def controlled(self) -> float:
        """Control flow of a servo injector while its needle is open, over the injected volume."""
        c, inputs = learned_of(self.theta, self.setting.coefficients).coefficients, self.window.inputs
        opened = inputs[inputs[:, 1] > 0.0, 0] + c.chamber_pressure / c.pressure_scale
        flow: float = c.flow_scale * c.line.servo / c.line.a1
        return flow * float(np.sqrt(opened).sum()) * self.setting.interval / max(self.volume, LEAST)

    def variance(self, covariance: NDArray[np.float64]) -> float:
        """Variance of the volume, as a share, by a covariance (m, m) of theta."""
        return max(float(self.slopes @ covariance @ self.slopes), 0.0)


def mass_of(window: Window, setting: Setting, theta: Theta, again: Resimulation) -> EventMass:
    """Mass of an event that was run again with theta (m,)."""
    part = _part(window)
    volume = float(np.trapezoid(again.run.rate[part])) * setting.interval
    # where nothing flows at either end, as by trapezoids
    slopes = np.ones(window.output.size - part.start) @ again.run.slopes[part]
    slopes *= setting.interval / max(volume, LEAST)
    by_inputs = float(again.by_inputs.volume[-1]) / max(volume, LEAST) ** 2
    flows_until = int(np.flatnonzero(again.run.rate)[-1]) + FURTHER if volume > 0.0 else window.output.size
    return EventMass(window, setting, theta, volume, slopes, by_inputs, flows_until)


def _part(window: Window) -> slice:
    """Samples in which something is injected."""
    return slice(max(window.opening - LEAD, 0), window.output.size)


class Shares(NamedTuple):
    """Standard deviations of a volume, as shares of it: by belief, inputs and model alone, and in all."""

    from_belief: float
    total: float

    @property
    def remainder(self) -> float:
        """What belief, inputs and model do not explain."""
        return math.sqrt(max(self.total**2 - self.from_belief**2, 0.0))

    @property
    def agreement(self) -> float:
        """Share within which hypotheses agree on a mass."""
        return Z_95 * self.from_belief + c.OWN_SHARE


def shares_of(mass: EventMass, account: Account, explained: ExplainedEvent, systematic: float) -> Shares:
    """How well the mass of an event is known.

    systematic: share that the model gets wrong of a healthy injector, or far from where it was learned.
    """
    by_belief = mass.variance(explained.carried[0][1].learned.gated.covariance)
    by_stated = by_belief + mass.by_inputs + systematic**2
    factor = account.doubt.scatter.factor
    total = by_stated + (factor - 1.0) * by_belief + account.doubt.unexplained.variance
    mixed = _between(mass, by_belief, factor, explained)
    total = max(total + mixed, c.LEAST_OF_MIXED * total)
    return Shares(math.sqrt(by_stated), account.doubt.wander.widened(total))


def _between(mass: EventMass, by_belief: float, factor: float, explained: ExplainedEvent) -> float:
    """Variance that hypotheses about one injector have beyond that of the one that leads."""
    good = [(each.weight, one.learned) for each, one in explained.explanations if each.is_good]
    total, mixed = sum(weight for weight, _ in good), 0.0
    for weight, learned in good:
        if weight < c.LEAST_PART * total:
            continue
        moved = mass.moved(learned.theta)
        if abs(moved) > c.OTHER_INJECTOR:
            moved = 0.0
        mixed += weight / total * (factor * (mass.variance(learned.gated.covariance) - by_belief) + moved**2)
    return mixed
