"""Kalman gains of the identification system x~, from its start to the steady state, by noise levels."""

import math
from dataclasses import dataclass

import numpy as np

from observer_rt.core.learning.gain import solve_riccati
from observer_rt.core.model.laws import lagged_slopes, recorded_mean
from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.model.effective import Coefficients

START_DURATION = 2e-3  # s, after which the gain is steady
SHAPING = 3  # first-order lags that represent the smoothing of the rail pressure
SHAPE = 0.35  # time constant of each, in widths of the kernel: both halve the noise at the same frequency
START_FLOW_SIGMA = 1e-5  # m3/s (10 mm3/ms), of Q_L when x~ starts anew in a ringing line


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviation of a sample's white noise at the recording's sample rate."""

    rail_pressure: float  # Pa
    line_pressure: float  # Pa
    needle_lift: float  # m

    @property
    def implausible(self) -> tuple[str, ...]:
        """Names of signals without noise, or so noisy that a sensor is broken, or no opening of the needle shows."""
        return tuple(name for name, level in vars(self).items() if not 0.0 < level <= getattr(LARGEST_NOISE, name))


LARGEST_NOISE = NoiseLevels(rail_pressure=5 * MEGAPASCAL, line_pressure=5 * MEGAPASCAL, needle_lift=20 * MICROMETRE)


@dataclass(frozen=True)
class GainSchedule:
    """Kalman gains of x~, from a start with x1 = y, x2 = 0 to the steady state.

    Row k is used k samples after the start, the last row from then on.
    """

    gains: Matrix  # (n, states) on p_L, Q_L, indicated pressure, further states of the line
    innovation_sigma: float  # steady standard deviation of e~ [p_0]


def gain_schedule(
    c: Coefficients,
    noise: NoiseLevels,
    sample_rate: float,
    lag: float = 0.0,
    late: float = 0.0,
    rail_every: float = 1.0,
    rail_smoothing: float = 0.0,
) -> GainSchedule:
    """Gains for the line at rest (friction 0), rail-pressure noise driving it and line noise on y.

    p_S gets no gain: it relaxes within microseconds. sample_rate in Hz, lag of the sensor in s; late: by which share
    of a sample interval (0..1) the indicated pressure is recorded late; rail_every: samples to one of the rail
    pressure, whose noise is the stronger at low frequencies the longer straight lines lead from one to the next;
    rail_smoothing: width of the kernel [s] that the rail pressure was smoothed by, whose noise is then coloured.
    The colour is carried along in the covariance, and not estimated (Schmidt's filter): x~ has no states for it.
    """
    interval = 1.0 / sample_rate
    line, rail = c.line.transition(interval)
    by_self, by_start, by_end, _ = lagged_slopes(0.0, 0.0, 0.0, interval, lag)
    m = len(line)
    transition = np.zeros((m + 1, m + 1))
    transition[:m, :m] = line
    transition[m, :m] = by_end * line[0]
    transition[m, 0] += by_start
    transition[m, m] = by_self
    rail_effect = np.append(rail, by_end * rail[0])
    shown, shown_before = _measurement(c, m + 1, interval, lag, late)
    measurement = (noise.line_pressure / c.pressure_scale) ** 2
    covariance = np.zeros((m + 1, m + 1))
    covariance[[0, 0, m, m], [0, m, 0, m]] = measurement
    covariance[1, 1] = (START_FLOW_SIGMA / c.flow_scale) ** 2
    covariance[range(2, m), range(2, m)] = c.line.further_variance(covariance[1, 1])
    rail_variance = rail_every * (noise.rail_pressure / c.pressure_scale) ** 2
    process = np.outer(rail_effect, rail_effect) * rail_variance
    if rail_smoothing > 0.0:
        transition, process, covariance = _coloured(
            transition, rail_effect, covariance, rail_variance, math.exp(-interval / (SHAPE * rail_smoothing))
        )
        shown, shown_before = (np.append(one, np.zeros(SHAPING)) for one in (shown, shown_before))
    gains = np.zeros((max(2, round(START_DURATION * sample_rate)), m + 1))
    matrices = transition, process, measurement, shown, shown_before, covariance, gains
    variance = solve_riccati(*matrices, False)
    if not (variance >= measurement and np.isfinite(gains).all()):
        variance = solve_riccati(*matrices, True)
    columns = [0, 1, m, *range(2, m)]
    return GainSchedule(np.ascontiguousarray(gains[:, columns]), math.sqrt(variance))


def _coloured(
    transition: Matrix, rail_effect: Matrix, covariance: Matrix, variance: float, kept: float
) -> tuple[Matrix, Matrix, Matrix]:
    """Transition, process noise and start covariance with the states of the noise's shaping filter at the end.

    Equal first-order lags, one behind the other, `kept` of each from sample to sample; the last drives the line.
    """
    size = len(transition)
    moved = np.zeros((size + SHAPING, size + SHAPING))
    moved[:size, :size] = transition
    moved[:size, -1] = rail_effect
    enters = np.zeros(size + SHAPING)
    share = 1.0 - kept
    for i in range(SHAPING):
        enters[size + i] = share ** (i + 1)
        for j in range(i + 1):
            moved[size + i, size + j] = kept * share ** (i - j)
    process = np.outer(enters, enters) * variance
    grown = np.zeros_like(moved)
    grown[:size, :size] = covariance
    shaping = moved[size:, size:]
    lasting = np.eye(SHAPING**2) - np.kron(shaping, shaping)  # of the discrete Lyapunov equation
    grown[size:, size:] = np.linalg.solve(lasting, process[size:, size:].ravel()).reshape(SHAPING, SHAPING)
    return moved, process, grown


def _measurement(c: Coefficients, size: int, interval: float, lag: float, late: float) -> tuple[Vector, Vector]:
    """Rows (size,) that make the measurement of the states at a sample, and of those one sample before.

    The last state is the indicated pressure; of an averaged line, the one before it the integral of p_L.
    """
    now, before = np.zeros(size), np.zeros(size)
    if c.line.averaged:
        share = lag / interval
        now[-2] = recorded_mean(0.0, 0.0, 1.0 / interval, share, late)
        now[-1] = recorded_mean(0.0, 1.0, 0.0, share, late)
        before[-1] = recorded_mean(1.0, 0.0, 0.0, share, late)
    else:
        now[-1], before[-1] = 1.0 - late, late
    return now, before
