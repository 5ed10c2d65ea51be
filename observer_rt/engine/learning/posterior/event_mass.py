"""Volume of an event's injections by its own pressures, and how it changes with theta."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.predictor import follow
from observer_rt.engine.estimation.predictor import NO_SLOPES, Setting, Window, level_of
from observer_rt.engine.estimation.scalars import Theta, learned_of
from observer_rt.engine.learning import constants as c
from observer_rt.engine.learning.hypotheses import FLOWS
from observer_rt.engine.learning.interval import Resimulation

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
        learned, interval = learned_of(theta, self.setting.coefficients), self.setting.interval
        window = self.window.as_learned(learned, self.setting).until(self.flows_until)
        rate, errors = np.empty((2, window.output.size))
        follow(window, self.setting, learned, window.opening, errors, rate, None, NO_SLOPES)
        volume = float(np.trapezoid(rate[_part(window)])) * interval
        return level_of(theta, self.setting) * volume / max(self.volume, LEAST) - 1.0

    @property
    def controlled(self) -> float:
        """Control flow of a servo injector while its needle is open, over the injected volume."""
        model, inputs = learned_of(self.theta, self.setting.coefficients).coefficients, self.window.inputs
        opened = inputs[inputs[:, 1] > 0.0, 0] + model.chamber_pressure / model.pressure_scale
        flow: float = model.flow_scale * model.line.control_flow / model.line.a1
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
