"""Steady Kalman gain of a predictor of the resting line. Imports nothing of `observer_rt`."""

import math

import numpy as np
from numpy.typing import NDArray

RICCATI_STEPS = 400


def line_gain(
    angle: float, impedance: float, late: float, rail_noise: float, line_noise: float
) -> tuple[NDArray[np.float64], float]:
    """Gain (3,) on [p_L, Q_L, p_L behind the sensor's lag], and the innovation's sigma.

    angle: of the line's mode in one sample; impedance: pressure over flow of the mode; late: lag in samples; noise in
    the unit of the pressure.
    """
    cosine, sine = math.cos(angle), math.sin(angle)
    decay = math.exp(-1.0 / late) if late > 0.0 else 0.0
    now, before = 1.0 - late * (1.0 - decay), late * (1.0 - decay) - decay
    row = np.array([cosine, impedance * sine, 0.0])
    transition = np.array([row, [-sine / impedance, cosine, 0.0], now * row + [before, 0.0, decay]])
    drive = np.array([1.0 - cosine, sine / impedance, now * (1.0 - cosine)])
    process = np.outer(drive, drive) * rail_noise**2
    measurement = line_noise**2
    covariance = np.diag([measurement, measurement / impedance**2, measurement])
    gain, variance = np.zeros(3), measurement
    for _ in range(RICCATI_STEPS):
        covariance = transition @ covariance @ transition.T + process
        variance = covariance[2, 2] + measurement
        gain = covariance[:, 2] / variance
        covariance = covariance - np.outer(gain, covariance[2])
    return gain, math.sqrt(variance)
