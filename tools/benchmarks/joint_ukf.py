"""The peer: a joint unscented Kalman filter on the nominal equations, v_H as a fourth state, on every sample.

States are normalised as in (24). Shares no code, and so no mistake, with the package. Its noise settings were chosen
from a grid (v_H walking 1e-6 to 1e-4 a sample, model noise .01 to .1 MPa, line noise one to four times the true one),
on cases of a seed used for nothing else, by the mean logarithm of the rate's RMSE, over one case of every class that
must be estimated well. The ten best differ by 1 %; of these, one whose v_H may walk fastest follows wear best.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.parameters import Injector
from tests.plants.plant import LINE_NOISE, RAIL_NOISE, Signals

SHUT_STEP = 0.1  # radians of the line's mode per step while nothing flows
RESTING_VARIANCE = 1e-10  # of a sac known to be at chamber pressure
PRESSURE_SCALE, FLOW_SCALE, AREA_SCALE = 1e8, 6e-5, 7e-7  # Pa, m3/s, m2
TRANSITION = 0.5e6  # Pa
OPEN_LIFT, LOOK_BACK = 2.5e-6, 3  # m, samples
SETTLED = 3e-3  # s of shut needle after which the sac is at chamber pressure
STEP = 2.0e-6  # s of RK4
UNSCENTED_SHAPE = (0.5, 2.0, 0.0)  # alpha, beta, kappa
WEAR_WALK, MODEL_NOISE, MEASURED_NOISE = 1e-5, 3e4, 2.0
"""Sigmas a sample at 100 kHz: of v_H; of p_L and p_S [Pa]; of the measured p_L, in multiples of the true one."""


class Model(NamedTuple):
    """Coefficients of (25) [1/s], and what turns x3 into a rate."""

    a1: float
    a2: float
    a3: float
    a4: float
    a5: float
    a6: float
    transition: float  # of the orifice laws, in units of p0
    nozzle_flow: float  # m3/s at x3 = 1


class Stream(NamedTuple):
    """A recording as the filters take it, n samples: inputs (n, 2) [p_R, A_S], output (n,) p_L, resting (n,)."""

    inputs: Array
    output: Array
    resting: NDArray[np.bool_]
    interval: float  # s
    substeps: int


class Start(NamedTuple):
    """Of a joint filter: state (4,) and covariance (4, 4) at the first sample, noise of process (4, 4) and output."""

    x: Array
    covariance: Array
    process: Array
    measurement: float


@njit(cache=True, nogil=True)
def root(difference: float, transition: float) -> float:
    """Signed square root, linear far below the transition."""
    return difference / math.sqrt(math.sqrt(difference * difference + transition * transition))


@njit(cache=True, nogil=True)
def _rates(
    x1: float, x2: float, x3: float, rail: float, area: float, v_h: float, m: Model
) -> tuple[float, float, float]:
    line_flow = m.a3 * (rail - x1) - m.a4 * x2 * math.fabs(x2)
    inflow = m.a1 * x2
    if area == 0.0 and x3 == 0.0:
        return inflow, line_flow, 0.0
    q_h = (1.0 + v_h) * root(x3, m.transition)
    q_s = area * root(x1 - x3, m.transition)
    return inflow - m.a2 * q_h, line_flow, m.a5 * q_s - m.a6 * q_h


@njit(cache=True, nogil=True)
def advance(
    x1: float, x2: float, x3: float, k: int, stream: Stream, v_h: float, m: Model
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
        k1 = _rates(x1, x2, x3, r0 + s0 * dr, a0 + s0 * da, v_h, m)
        g = 0.5 * h
        k2 = _rates(x1 + g * k1[0], x2 + g * k1[1], x3 + g * k1[2], r0 + s1 * dr, a0 + s1 * da, v_h, m)
        k3 = _rates(x1 + g * k2[0], x2 + g * k2[1], x3 + g * k2[2], r0 + s1 * dr, a0 + s1 * da, v_h, m)
        k4 = _rates(x1 + h * k3[0], x2 + h * k3[1], x3 + h * k3[2], r0 + s2 * dr, a0 + s2 * da, v_h, m)
        x1 += h / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0])
        x2 += h / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1])
        x3 += h / 6.0 * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2])
    return x1, x2, x3


@njit(cache=True, nogil=True)
def set_at_rest(x: Array, covariance: Array) -> None:
    """The sac is known to be at chamber pressure."""
    x[2] = 0.0
    covariance[2, :] = 0.0
    covariance[:, 2] = 0.0
    covariance[2, 2] = RESTING_VARIANCE


@njit(cache=True, nogil=True)
def unscented(stream: Stream, m: Model, start: Start, shape: tuple[float, float, float], states: Array) -> bool:
    """Joint unscented Kalman filter (van der Merwe's points; shape: alpha, beta, kappa) into `states` (n, 4).

    Returns False when the covariance stopped being one; the remaining states are not written.
    """
    alpha, beta, kappa = shape
    spread = alpha * alpha * (4.0 + kappa)
    of_mean, of_covariance = np.full(9, 0.5 / spread), np.full(9, 0.5 / spread)
    of_mean[0] = (spread - 4.0) / spread
    of_covariance[0] = of_mean[0] + 1.0 - alpha * alpha + beta
    x, covariance = start.x.copy(), start.covariance.copy()
    states[0] = x
    points = np.empty((9, 4))
    for k in range(stream.output.shape[0] - 1):
        if not _points(x, covariance, spread, points):
            return False
        for i in range(9):
            x1, x2, x3 = advance(points[i, 0], points[i, 1], points[i, 2], k, stream, points[i, 3], m)
            points[i, 0], points[i, 1], points[i, 2] = x1, x2, x3
        x = of_mean @ points
        away = points - x
        covariance = start.process + (of_covariance * away.T) @ away
        if not _points(x, covariance, spread, points):
            return False
        away = points - x
        predicted = np.sum(of_mean * points[:, 0])
        weighted = of_covariance * (points[:, 0] - predicted)
        variance = start.measurement + np.sum(weighted * (points[:, 0] - predicted))
        cross = weighted @ away
        x += cross / variance * (stream.output[k + 1] - predicted)
        covariance -= np.outer(cross, cross) / variance
        if stream.resting[k + 1]:
            set_at_rest(x, covariance)
        states[k + 1] = x
    return True


@njit(cache=True, nogil=True)
def _points(x: Array, covariance: Array, spread: float, points: Array) -> bool:
    """Sigma points (9, 4); False unless the covariance is positive definite."""
    try:
        lower = np.linalg.cholesky(spread * covariance)
    except Exception:  # all that compiled code can name
        return False
    points[0] = x
    for i in range(4):
        points[1 + i] = x + lower[:, i]
        points[5 + i] = x - lower[:, i]
    return True


def lump_model(part: Injector) -> Model:
    """Coefficients of an injector with a lumped line."""
    jet = math.sqrt(2.0 * PRESSURE_SCALE / part.density)
    line = part.bulk_modulus_line / part.line_volume
    sac = part.bulk_modulus_sac / part.sac_volume
    nozzle = part.nozzle_area * jet
    return Model(
        a1=line * FLOW_SCALE / PRESSURE_SCALE,
        a2=line * nozzle / PRESSURE_SCALE,
        a3=part.line_area * PRESSURE_SCALE / (part.density * part.line_length * FLOW_SCALE),
        a4=part.line_loss * FLOW_SCALE / (2.0 * part.line_area * part.line_length),
        a5=sac * part.seat_coefficient * AREA_SCALE * jet / PRESSURE_SCALE,
        a6=sac * nozzle / PRESSURE_SCALE,
        transition=TRANSITION / PRESSURE_SCALE,
        nozzle_flow=nozzle,
    )


def stream_of(measured: Signals, part: Injector) -> Stream:
    """The recording as the filter takes it."""
    interval = float(measured.time[1] - measured.time[0])
    opened = _open(measured.needle_lift)
    lift = np.where(opened, np.maximum(measured.needle_lift, 0.0), 0.0)
    sine, taper = math.sin(part.seat_half_angle), math.sin(2.0 * part.seat_half_angle)
    area = math.pi * lift * sine * (part.seat_diameter - 0.5 * lift * taper)
    sample = np.arange(opened.size)
    last_open = np.maximum.accumulate(np.where(opened, sample, -opened.size))
    shut_for = sample - last_open
    return Stream(
        np.stack(((measured.rail_pressure - part.chamber_pressure) / PRESSURE_SCALE, area / AREA_SCALE), axis=1),
        (measured.line_pressure - part.chamber_pressure) / PRESSURE_SCALE,
        shut_for > SETTLED / interval,
        interval,
        max(5, math.ceil(interval / STEP)),
    )


def ukf_rate(measured: Signals) -> Array:
    """Injection rate [m3/s] (n,) by the nominal injector's filter; 0 from where its covariance stopped being one."""
    part = Injector()
    model, stream = lump_model(part), stream_of(measured, part)
    states = np.full((stream.output.size, 4), np.nan)
    unscented(stream, model, start_of(stream, model), UNSCENTED_SHAPE, states)
    sac = states[:, 2]
    difference = sac / np.sqrt(np.sqrt(sac**2 + model.transition**2))
    return np.nan_to_num(model.nozzle_flow * (1.0 + states[:, 3]) * difference)


def start_of(stream: Stream, m: Model) -> Start:
    """The line at rest, v_H within +-.5; a sample adds rail noise through the line's inertia, wear, model."""
    t, line = stream.interval, LINE_NOISE / PRESSURE_SCALE
    rail = np.array([0.5 * m.a1 * m.a3 * t * t, m.a3 * t, 0.0, 0.0]) * RAIL_NOISE / PRESSURE_SCALE
    scale = t / 1e-5
    model = (MODEL_NOISE / PRESSURE_SCALE) ** 2 * scale
    return Start(
        np.array([stream.output[0], 0.0, 0.0, 0.0]),
        np.diag([line**2, 0.1**2, 1e-10, 0.3**2]),
        np.outer(rail, rail) + np.diag([model, 0.0, model, WEAR_WALK**2 * scale]),
        (MEASURED_NOISE * LINE_NOISE / PRESSURE_SCALE) ** 2,
    )


def _open(lift: Array) -> NDArray[np.bool_]:
    """Dead band: open where two samples in a row are above it, and a few positive samples round that."""
    above = lift > OPEN_LIFT
    pair = above[1:] & above[:-1]
    core = np.append(pair, False) | np.append(False, pair)
    near = np.convolve(core, np.ones(2 * LOOK_BACK + 1), "same") > 0.5
    return np.asarray(core | (near & (lift > 0.0)), np.bool_)
