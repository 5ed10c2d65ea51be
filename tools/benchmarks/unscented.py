"""The peer: a textbook's unscented Kalman filter of seven states on the nominal equations, on every sample.

States: p_L, Q_L and p_S, normalised as in (24), changes of nozzle flow, seat flow and line friction, offset of the
line-pressure sensor. Shares no code, and so no mistake, with the package: imports nothing of `observer_rt`.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.parameters import Injector
from tests.plants.plant import LINE_NOISE, RAIL_NOISE, Signals

STATES = 7
PRESSURE_SCALE, FLOW_SCALE, AREA_SCALE = 1e8, 6e-5, 7e-7  # Pa, m3/s, m2
TRANSITION = 0.5e6 / PRESSURE_SCALE  # of the orifice laws
SHUT_STEP = 0.1  # radians of the line's mode per step while nothing flows
OPEN_LIFT, LOOK_BACK = 2.5e-6, 3  # m, samples
SETTLED = 3e-3  # s of shut needle after which the sac is at chamber pressure
STEP = 2.0e-6  # s of RK4
SHAPE = (0.5, 2.0, 0.0)  # alpha, beta, kappa of van der Merwe's points
MODEL_NOISE, MEASURED_NOISE = 3e4 / PRESSURE_SCALE, 2.0  # sigma a sample of p_L and p_S; multiple of the line's
WALKS = np.array([1e-5, 3e-5, 1e-4, 1e-7])  # sigmas a sample of the last four states
PRIORS = np.array([1.5e-3, 0.1, 1e-5, 0.3, 0.3, 1.0, 0.01])  # sigmas at the first sample
RESTING = 1e-10  # variance of a sac that is known to be at chamber pressure
Stream = tuple[Array, Array, NDArray[np.bool_]]
"""A recording of n samples: inputs (n, 2) [p_R, A_S], output (n,) p_L, whether the sac is at rest (n,)."""


@njit(cache=True, nogil=True)
def root(difference: float) -> float:
    """Signed square root, linear far below the transition."""
    return difference / math.sqrt(math.sqrt(difference * difference + TRANSITION * TRANSITION))


@njit(cache=True, nogil=True)
def _rates(
    p: float, q: float, sac: float, rail: float, area: float, changed: Array, a: Array
) -> tuple[float, float, float]:
    line_flow = a[2] * (rail - p) - a[3] * (1.0 + changed[2]) * q * math.fabs(q)
    if area == 0.0 and sac == 0.0:
        return a[0] * q, line_flow, 0.0
    q_h = (1.0 + changed[0]) * root(sac)
    q_s = (1.0 + changed[1]) * area * root(p - sac)
    return a[0] * q - a[1] * q_h, line_flow, a[4] * q_s - a[5] * q_h


@njit(cache=True, nogil=True)
def advance(x: Array, before: Array, after: Array, interval: float, a: Array) -> None:
    """Make x (7,) the state one sample later: RK4, inputs (2,) linear from `before` to `after`."""
    steps = math.ceil(interval / STEP)
    if before[1] == 0.0 and after[1] == 0.0 and x[2] == 0.0:
        steps = min(steps, math.ceil(interval * math.sqrt(a[0] * a[2]) / SHUT_STEP))
    h, (p, q, sac), changed = interval / steps, (x[0], x[1], x[2]), x[3:]
    r0, a0, dr, da = before[0], before[1], after[0] - before[0], after[1] - before[1]
    for i in range(steps):
        s0, s1, s2 = i / steps, (i + 0.5) / steps, (i + 1.0) / steps
        g, middle = 0.5 * h, (r0 + s1 * dr, a0 + s1 * da)
        k1 = _rates(p, q, sac, r0 + s0 * dr, a0 + s0 * da, changed, a)
        k2 = _rates(p + g * k1[0], q + g * k1[1], sac + g * k1[2], middle[0], middle[1], changed, a)
        k3 = _rates(p + g * k2[0], q + g * k2[1], sac + g * k2[2], middle[0], middle[1], changed, a)
        k4 = _rates(p + h * k3[0], q + h * k3[1], sac + h * k3[2], r0 + s2 * dr, a0 + s2 * da, changed, a)
        p += h / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0])
        q += h / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1])
        sac += h / 6.0 * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2])
    x[0], x[1], x[2] = p, q, sac


@njit(cache=True, nogil=True)
def _points(x: Array, covariance: Array, spread: float) -> Array:
    """Sigma points (15, 7)."""
    lower = np.linalg.cholesky(spread * covariance)
    points = np.empty((2 * STATES + 1, STATES))
    points[0] = x
    for i in range(STATES):
        points[1 + i], points[1 + STATES + i] = x + lower[:, i], x - lower[:, i]
    return points


@njit(cache=True, nogil=True)
def filtered(stream: Stream, a: Array, interval: float, start: Array, covariance: Array, process: Array) -> Array:
    """States (n, 7) from the state and covariance at the first sample on."""
    inputs, output, resting = stream
    spread = SHAPE[0] ** 2 * (STATES + SHAPE[2])
    of_mean = np.full(2 * STATES + 1, 0.5 / spread)
    of_covariance = of_mean.copy()
    of_mean[0] = 1.0 - STATES / spread
    of_covariance[0] = of_mean[0] + 1.0 - SHAPE[0] ** 2 + SHAPE[1]
    measured = (MEASURED_NOISE * LINE_NOISE / PRESSURE_SCALE) ** 2
    states = np.empty((output.size, STATES))
    x = states[0] = start
    for k in range(output.size - 1):
        points = _points(x, covariance, spread)
        for i in range(points.shape[0]):
            advance(points[i], inputs[k], inputs[k + 1], interval, a)
        x = of_mean @ points
        away = points - x
        covariance = process + (of_covariance * away.T) @ away
        away = _points(x, covariance, spread) - x
        weighted = of_covariance * (away[:, 0] + away[:, 6])
        cross = weighted @ away
        variance = measured + cross[0] + cross[6]
        x = x + cross / variance * (output[k + 1] - x[0] - x[6])
        covariance = covariance - np.outer(cross, cross) / variance
        if resting[k + 1]:
            x[2] = covariance[2, :] = covariance[:, 2] = 0.0
            covariance[2, 2] = RESTING
        states[k + 1] = x
    return states


def coefficients(part: Injector) -> Array:
    """a_1 to a_6 of (25) [1/s] for a lumped line."""
    line, sac = part.bulk_modulus_line / part.line_volume, part.bulk_modulus_sac / part.sac_volume
    inertance = part.density * part.line_length / part.line_area
    jet = math.sqrt(2.0 * PRESSURE_SCALE / part.density)
    nozzle, seat = part.nozzle_area * jet, part.seat_coefficient * AREA_SCALE * jet
    of_pressures = np.array([line * FLOW_SCALE, line * nozzle, sac * seat, sac * nozzle]) / PRESSURE_SCALE
    friction = part.line_loss * FLOW_SCALE / (2.0 * part.line_area * part.line_length)
    return np.array([*of_pressures[:2], PRESSURE_SCALE / inertance / FLOW_SCALE, friction, *of_pressures[2:]])


def stream_of(measured: Signals, part: Injector) -> Stream:
    interval, above = measured.time[1] - measured.time[0], measured.needle_lift > OPEN_LIFT
    pair = above[1:] & above[:-1]
    core = np.append(pair, False) | np.append(False, pair)
    near = np.convolve(core, np.ones(2 * LOOK_BACK + 1), "same") > 0.5
    opened = core | (near & (measured.needle_lift > 0.0))
    lift, sine = np.where(opened, measured.needle_lift, 0.0), math.sin(part.seat_half_angle)
    area = math.pi * lift * sine * (part.seat_diameter - 0.5 * lift * math.sin(2.0 * part.seat_half_angle))
    sample = np.arange(opened.size)
    shut_for = sample - np.maximum.accumulate(np.where(opened, sample, -opened.size))
    return (
        np.stack(((measured.rail_pressure - part.chamber_pressure) / PRESSURE_SCALE, area / AREA_SCALE), axis=1),
        (measured.line_pressure - part.chamber_pressure) / PRESSURE_SCALE,
        shut_for > SETTLED / interval,
    )


def noise_of(a: Array, interval: float) -> Array:
    """Process noise (7, 7) a sample: of the rail, through the line's inertia, of model and walks."""
    rail = np.zeros(STATES)
    rail[:2] = np.array([0.5 * a[0] * a[2] * interval**2, a[2] * interval]) * RAIL_NOISE / PRESSURE_SCALE
    own = np.diag(np.array([MODEL_NOISE, 0.0, MODEL_NOISE, *WALKS]) ** 2)
    return np.outer(rail, rail) + own * (interval / 1e-5)


def unscented_rate(measured: Signals) -> Array:
    """Injection rate [m3/s] (n,) by the filter of the nominal injector."""
    part, interval = Injector(), float(measured.time[1] - measured.time[0])
    a, stream = coefficients(part), stream_of(measured, part)
    start = np.append(stream[1][0], np.zeros(STATES - 1))
    states = filtered(stream, a, interval, start, np.diag(PRIORS**2), noise_of(a, interval))
    sac = states[:, 2] / np.sqrt(np.hypot(states[:, 2], TRANSITION))
    return np.asarray(part.nozzle_area * math.sqrt(2.0 * PRESSURE_SCALE / part.density) * (1.0 + states[:, 3]) * sac)
