"""The steady and the starting gain of the identification system, from noise levels and sample rate."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.model.coefficients import Coefficients

START_DURATION = 2e-3  # s, after which the gain is steady
START_FLOW_SIGMA = 1e-5  # m3/s (10 mm3/ms), of Q_L when x~ starts anew in a ringing line


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviation of a sample's white noise at the recording's sample rate."""

    rail_pressure: float  # Pa
    line_pressure: float  # Pa
    needle_lift: float  # m


@dataclass(frozen=True)
class GainSchedule:
    """Kalman gains of x~ on (p_L, Q_L), normalised, from a start with x1 = y, x2 = 0 to the steady state.

    gains: (n, 2), row k is used k samples after the start, the last row from then on.
    innovation_sigma: steady standard deviation of e~ = y - C x~, in units of p_0.
    """

    gains: NDArray[np.float64]
    innovation_sigma: float


def gain_schedule(c: Coefficients, noise: NoiseLevels, sample_rate: float) -> GainSchedule:
    """Gains for the line at rest (friction 0), rail-pressure noise driving it and line noise on y.

    p_S gets no gain: it relaxes within microseconds. sample_rate in Hz.
    """
    interval = 1.0 / sample_rate
    angle = math.sqrt(c.a1 * c.a3) * interval
    impedance = math.sqrt(c.a1 / c.a3)
    transition = np.array(
        [
            [math.cos(angle), impedance * math.sin(angle)],
            [-math.sin(angle) / impedance, math.cos(angle)],
        ]
    )
    rail_effect = np.array([1.0 - math.cos(angle), math.sin(angle) / impedance])
    process = np.outer(rail_effect, rail_effect) * (noise.rail_pressure / c.pressure_scale) ** 2
    measurement = (noise.line_pressure / c.pressure_scale) ** 2
    covariance = np.diag([measurement, (START_FLOW_SIGMA / c.flow_scale) ** 2])
    gains = np.zeros((max(2, round(START_DURATION * sample_rate)), 2))
    innovation_variance = measurement
    for row in gains:
        covariance = transition @ covariance @ transition.T + process
        innovation_variance = float(covariance[0, 0]) + measurement
        row[:] = covariance[:, 0] / innovation_variance
        covariance = covariance - np.outer(row, covariance[0])
    return GainSchedule(gains, math.sqrt(innovation_variance))
