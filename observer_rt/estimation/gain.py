"""The steady and the starting gain of the identification system, from noise levels and sample rate."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.model.coefficients import Coefficients
from observer_rt.model.sensor import lagged_slopes

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
    """Kalman gains of x~ on (p_L, Q_L, indicated pressure), from a start with x1 = y, x2 = 0 to the steady state.

    gains: (n, 3), normalised; row k is used k samples after the start, the last row from then on.
    innovation_sigma: steady standard deviation of e~, in units of p_0.
    """

    gains: NDArray[np.float64]
    innovation_sigma: float


def gain_schedule(
    c: Coefficients, noise: NoiseLevels, sample_rate: float, lag: float = 0.0, late: float = 0.0
) -> GainSchedule:
    """Gains for the line at rest (friction 0), rail-pressure noise driving it and line noise on y.

    p_S gets no gain: it relaxes within microseconds. sample_rate in Hz, lag of the sensor in s; late: by which share
    of a sample interval (0..1) the indicated pressure is recorded late.
    """
    interval = 1.0 / sample_rate
    angle = math.sqrt(c.a1 * c.a3) * interval
    impedance = math.sqrt(c.a1 / c.a3)
    cosine, sine = math.cos(angle), math.sin(angle)
    by_self, by_start, by_end, _ = lagged_slopes(0.0, 0.0, 0.0, interval, lag)
    transition = np.array(
        [
            [cosine, impedance * sine, 0.0],
            [-sine / impedance, cosine, 0.0],
            [by_start + by_end * cosine, by_end * impedance * sine, by_self],
        ]
    )
    rail_effect = np.array([1.0 - cosine, sine / impedance, by_end * (1.0 - cosine)])
    measurement = (noise.line_pressure / c.pressure_scale) ** 2
    covariance = np.zeros((3, 3))
    covariance[[0, 0, 2, 2], [0, 2, 0, 2]] = measurement
    covariance[1, 1] = (START_FLOW_SIGMA / c.flow_scale) ** 2
    process = np.outer(rail_effect, rail_effect) * (noise.rail_pressure / c.pressure_scale) ** 2
    gains = np.zeros((max(2, round(START_DURATION * sample_rate)), 3))
    variance = _riccati(transition, process, measurement, late, covariance, gains)
    return GainSchedule(gains, math.sqrt(variance))


@njit(cache=True, nogil=True)
def _riccati(
    transition: NDArray[np.float64],
    process: NDArray[np.float64],
    measurement: float,
    late: float,
    covariance: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> float:
    """Fill `gains` from a start `covariance` on; returns the last innovation variance.

    Measured is (1 - late) times the indicated pressure and `late` times the one before.
    """
    variance = measurement
    newer = 1.0 - late
    for k in range(gains.shape[0]):
        moved = transition @ covariance  # of the state with the one before
        earlier = newer * moved[2, 2] + late * covariance[2, 2]
        covariance = moved @ transition.T + process
        column = newer * covariance[:, 2] + late * moved[:, 2]
        row = newer * covariance[2] + late * moved[:, 2]
        variance = newer * column[2] + late * earlier + measurement
        gains[k] = column / variance
        covariance = covariance - np.outer(gains[k], row)
    return variance
