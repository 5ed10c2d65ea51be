"""The peers' model and filters: the nominal equations with named parameters, joint UKF and EKF, a predictor.

States are normalised as in (24): x = [(p_L - p_C)/p0, Q_L/Q0, (p_S - p_C)/p0]. Written apart from the package, so
that the peers share no mistake with the observer.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

SHUT_STEP = 0.1  # radians of the line's mode per step while nothing flows
RESTING_VARIANCE = 1e-10  # of a sac known to be at chamber pressure
DIFFERENCE = 1e-5  # of normalised states, for the Jacobian
V_H, V_S, FRICTION, LEAK, OFFSET, LAG, STIFFNESS = range(7)
PARAMETERS = 7


class Model(NamedTuple):
    """Coefficients of (25) [1/s], and what turns x3 into a rate."""

    a1: float
    a2: float
    a3: float
    a4: float
    a5: float
    a6: float
    leak: float  # K_L/V_L, Pa/m3
    transition: float  # of the orifice laws, in units of p0
    nozzle_flow: float  # m3/s at x3 = 1


class Stream(NamedTuple):
    """A recording as the filters take it, n samples: inputs (n, 2) [p_R, A_S], output (n,) p_L, resting (n,)."""

    inputs: NDArray[np.float64]
    output: NDArray[np.float64]
    resting: NDArray[np.bool_]
    interval: float  # s
    substeps: int


@njit(cache=True, nogil=True)
def root(difference: float, transition: float) -> float:
    """Signed square root, linear far below the transition."""
    return difference / math.sqrt(math.sqrt(difference * difference + transition * transition))


@njit(cache=True, nogil=True)
def _rates(
    x1: float, x2: float, x3: float, rail: float, area: float, theta: NDArray[np.float64], m: Model
) -> tuple[float, float, float]:
    line_flow = m.a3 * (rail - x1) - m.a4 * (1.0 + theta[FRICTION]) * x2 * math.fabs(x2)
    stiffness = 1.0 + theta[STIFFNESS]
    inflow = m.a1 * x2 - m.leak * theta[LEAK] * x1
    if area == 0.0 and x3 == 0.0:
        return stiffness * inflow, line_flow, 0.0
    q_h = (1.0 + theta[V_H]) * root(x3, m.transition)
    q_s = (1.0 + theta[V_S]) * area * root(x1 - x3, m.transition)
    return stiffness * (inflow - m.a2 * q_h), line_flow, m.a5 * q_s - m.a6 * q_h


@njit(cache=True, nogil=True)
def advance(
    x1: float, x2: float, x3: float, k: int, stream: Stream, theta: NDArray[np.float64], m: Model
) -> tuple[float, float, float]:
    """State one sample after sample k: RK4, inputs linear."""
    r0, a0 = stream.inputs[k, 0], stream.inputs[k, 1]
    dr, da = stream.inputs[k + 1, 0] - r0, stream.inputs[k + 1, 1] - a0
    steps = stream.substeps
    if a0 == 0.0 and da == 0.0 and x3 == 0.0:
        steps = min(steps, math.ceil(stream.interval * math.sqrt(m.a1 * m.a3) / SHUT_STEP))
    h = stream.interval / steps
    for i in range(steps):
        s0, s1, s2 = i / steps, (i + 0.5) / steps, (i + 1.0) / steps
        k1 = _rates(x1, x2, x3, r0 + s0 * dr, a0 + s0 * da, theta, m)
        g = 0.5 * h
        k2 = _rates(x1 + g * k1[0], x2 + g * k1[1], x3 + g * k1[2], r0 + s1 * dr, a0 + s1 * da, theta, m)
        k3 = _rates(x1 + g * k2[0], x2 + g * k2[1], x3 + g * k2[2], r0 + s1 * dr, a0 + s1 * da, theta, m)
        k4 = _rates(x1 + h * k3[0], x2 + h * k3[1], x3 + h * k3[2], r0 + s2 * dr, a0 + s2 * da, theta, m)
        x1 += h / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0])
        x2 += h / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1])
        x3 += h / 6.0 * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2])
    return x1, x2, x3


@njit(cache=True, nogil=True)
def joint_step(x: NDArray[np.float64], k: int, stream: Stream, m: Model) -> NDArray[np.float64]:
    """[x1, x2, x3, v_H] one sample after sample k."""
    theta = np.zeros(PARAMETERS)
    theta[V_H] = x[3]
    y1, y2, y3 = advance(x[0], x[1], x[2], k, stream, theta, m)
    return np.array([y1, y2, y3, x[3]])


@njit(cache=True, nogil=True)
def joint_jacobian(x: NDArray[np.float64], k: int, stream: Stream, m: Model) -> NDArray[np.float64]:
    """Derivative (4, 4) of `joint_step`, by central differences."""
    jacobian = np.zeros((4, 4))
    for i in range(4):
        shifted = x.copy()
        shifted[i] += DIFFERENCE
        high = joint_step(shifted, k, stream, m)
        shifted[i] -= 2.0 * DIFFERENCE
        jacobian[:, i] = (high - joint_step(shifted, k, stream, m)) / (2.0 * DIFFERENCE)
    return jacobian


@njit(cache=True, nogil=True)
def rest(x: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
    """The sac is known to be at chamber pressure."""
    x[2] = 0.0
    covariance[2, :] = 0.0
    covariance[:, 2] = 0.0
    covariance[2, 2] = RESTING_VARIANCE


@njit(cache=True, nogil=True)
def unscented(
    stream: Stream,
    m: Model,
    x: NDArray[np.float64],
    covariance: NDArray[np.float64],
    process: NDArray[np.float64],
    measurement: float,
    shape: tuple[float, float, float],
    states: NDArray[np.float64],
) -> bool:
    """Joint unscented Kalman filter (van der Merwe's points; shape: alpha, beta, kappa) into `states` (n, 4).

    Returns False when the covariance stopped being one; the remaining states are not written.
    """
    alpha, beta, kappa = shape
    spread = alpha * alpha * (4.0 + kappa)
    weight = 0.5 / spread
    mean_0 = (spread - 4.0) / spread
    covariance_0 = mean_0 + 1.0 - alpha * alpha + beta
    states[0] = x
    points = np.empty((9, 4))
    for k in range(stream.output.shape[0] - 1):
        if not _points(x, covariance, spread, points):
            return False
        for i in range(9):
            points[i] = joint_step(points[i], k, stream, m)
        x = mean_0 * points[0]
        for i in range(1, 9):
            x = x + weight * points[i]
        covariance = process.copy()
        for i in range(9):
            d = points[i] - x
            covariance += (covariance_0 if i == 0 else weight) * np.outer(d, d)
        if not _points(x, covariance, spread, points):
            return False
        predicted = mean_0 * points[0, 0]
        for i in range(1, 9):
            predicted += weight * points[i, 0]
        variance, cross = measurement, np.zeros(4)
        for i in range(9):
            w = covariance_0 if i == 0 else weight
            variance += w * (points[i, 0] - predicted) ** 2
            cross += w * (points[i, 0] - predicted) * (points[i] - x)
        gain = cross / variance
        x = x + gain * (stream.output[k + 1] - predicted)
        covariance = covariance - variance * np.outer(gain, gain)
        if stream.resting[k + 1]:
            rest(x, covariance)
        states[k + 1] = x
    return True


@njit(cache=True, nogil=True)
def _points(
    x: NDArray[np.float64], covariance: NDArray[np.float64], spread: float, points: NDArray[np.float64]
) -> bool:
    """Sigma points (9, 4); False unless the covariance is positive definite."""
    lower = np.zeros((4, 4))
    for i in range(4):
        for j in range(i + 1):
            total = spread * covariance[i, j]
            for h in range(j):
                total -= lower[i, h] * lower[j, h]
            if i == j:
                if not total > 0.0:
                    return False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    points[0] = x
    for i in range(4):
        points[1 + i] = x + lower[:, i]
        points[5 + i] = x - lower[:, i]
    return True


@njit(cache=True, nogil=True)
def extended(
    stream: Stream,
    m: Model,
    x: NDArray[np.float64],
    covariance: NDArray[np.float64],
    process: NDArray[np.float64],
    measurement: float,
    states: NDArray[np.float64],
) -> bool:
    """Joint extended Kalman filter into `states` (n, 4); False when a state stopped being a number."""
    states[0] = x
    for k in range(stream.output.shape[0] - 1):
        jacobian = joint_jacobian(x, k, stream, m)
        x = joint_step(x, k, stream, m)
        covariance = jacobian @ covariance @ jacobian.T + process
        variance = covariance[0, 0] + measurement
        gain = covariance[:, 0] / variance
        x = x + gain * (stream.output[k + 1] - x[0])
        left = np.eye(4)
        left[:, 0] -= gain
        covariance = left @ covariance @ left.T + measurement * np.outer(gain, gain)
        if stream.resting[k + 1]:
            rest(x, covariance)
        if not np.isfinite(x).all():
            return False
        states[k + 1] = x
    return True


@njit(cache=True, nogil=True)
def predict(
    stream: Stream,
    m: Model,
    theta: NDArray[np.float64],
    gain: NDArray[np.float64],
    first: int,
    release: int,
    end: int,
    innovations: NDArray[np.float64],
    sac: NDArray[np.float64],
) -> None:
    """Predictor over samples [first, end), from x1 = y, x2 = 0; its gain (3,) on [x1, x2, lagged x1] until `release`.

    innovations and sac (x3) hold one value a sample; with `release` = end the gain never stops.
    """
    x1, x2, x3 = stream.output[first] - theta[OFFSET], 0.0, 0.0
    seen = x1
    innovations[0], sac[0] = 0.0, 0.0
    lag = theta[LAG]
    decay = math.exp(-stream.interval / lag) if lag > 0.0 else 0.0
    for k in range(first, end - 1):
        before = x1
        x1, x2, x3 = advance(x1, x2, x3, k, stream, theta, m)
        late = lag * (x1 - before) / stream.interval
        seen = x1 - late + (seen - before + late) * decay
        e = stream.output[k + 1] - theta[OFFSET] - seen
        if k + 1 < release:
            x1, x2, seen = x1 + gain[0] * e, x2 + gain[1] * e, seen + gain[2] * e
        if stream.resting[k + 1]:
            x3 = 0.0
        innovations[k + 1 - first], sac[k + 1 - first] = e, x3
