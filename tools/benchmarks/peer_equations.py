"""The peers' model and filters: the nominal equations with a worn nozzle, joint UKF and EKF, a predictor; and a
recording as they take it, with its seat area, rests and events.

States are normalised as in (24). Shares no code, and so no mistake, with the package.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.parameters import Injector
from tests.plants.plant import Measured

SHUT_STEP = 0.1  # radians of the line's mode per step while nothing flows
RESTING_VARIANCE = 1e-10  # of a sac known to be at chamber pressure
DIFFERENCE = 1e-5  # of normalised states, for the Jacobian
RICCATI_STEPS = 400
PRESSURE_SCALE, FLOW_SCALE, AREA_SCALE = 1e8, 6e-5, 7e-7  # Pa, m3/s, m2
TRANSITION = 0.5e6  # Pa
OPEN_LIFT, LOOK_BACK = 2.5e-6, 3  # m, samples
SETTLED = 3e-3  # s of shut needle after which the sac is at chamber pressure
EVENT_GAP = 10e-3  # s
STEP = 2.0e-6  # s of RK4


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
    sac_follows: bool = False  # no volume of its own: x3 is where seat and nozzle flow are equal


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


class Span(NamedTuple):
    """Samples [first, end) of a recording, the predictor's gain in force until `release`."""

    first: int
    release: int
    end: int


@njit(cache=True, nogil=True)
def root(difference: float, transition: float) -> float:
    """Signed square root, linear far below the transition."""
    return difference / math.sqrt(math.sqrt(difference * difference + transition * transition))


@njit(cache=True, nogil=True)
def between(x1: float, area: float, v_h: float, m: Model) -> float:
    """x3 at which as much flows through the seat as through the nozzle."""
    seat, nozzle = m.a5 * area, m.a6 * (1.0 + v_h)
    share: float = seat * seat / (seat * seat + nozzle * nozzle)
    return x1 * share


@njit(cache=True, nogil=True)
def _rates(
    x1: float, x2: float, x3: float, rail: float, area: float, v_h: float, m: Model
) -> tuple[float, float, float]:
    line_flow = m.a3 * (rail - x1) - m.a4 * x2 * math.fabs(x2)
    inflow = m.a1 * x2
    if m.sac_follows:
        q_h = (1.0 + v_h) * root(between(x1, area, v_h, m), m.transition)
        return inflow - m.a2 * q_h, line_flow, 0.0
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
    if m.sac_follows:
        x3 = between(x1, stream.inputs[k + 1, 1], v_h, m)
    return x1, x2, x3


@njit(cache=True, nogil=True)
def _joint_advance(x: Array, k: int, stream: Stream, m: Model) -> None:
    """`joint_step` in place."""
    x[0], x[1], x[2] = advance(x[0], x[1], x[2], k, stream, x[3], m)


@njit(cache=True, nogil=True)
def joint_step(x: Array, k: int, stream: Stream, m: Model) -> Array:
    """[x1, x2, x3, v_H] one sample after sample k."""
    after = x.copy()
    _joint_advance(after, k, stream, m)
    return after


@njit(cache=True, nogil=True)
def joint_jacobian(x: Array, k: int, stream: Stream, m: Model) -> Array:
    """Derivative (4, 4) of `joint_step`, by central differences."""
    jacobian = np.empty((4, 4))
    for i in range(4):
        high, low = x.copy(), x.copy()
        high[i] += DIFFERENCE
        low[i] -= DIFFERENCE
        jacobian[:, i] = (joint_step(high, k, stream, m) - joint_step(low, k, stream, m)) / (2.0 * DIFFERENCE)
    return jacobian


@njit(cache=True, nogil=True)
def rest(x: Array, covariance: Array) -> None:
    """The sac is known to be at chamber pressure."""
    x[2] = 0.0
    covariance[2, :] = 0.0
    covariance[:, 2] = 0.0
    covariance[2, 2] = RESTING_VARIANCE


@njit(cache=True, nogil=True)
def unscented(
    stream: Stream, m: Model, start: Start, shape: tuple[float, float, float], states: Array
) -> bool:
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
            _joint_advance(points[i], k, stream, m)
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
            rest(x, covariance)
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


@njit(cache=True, nogil=True)
def extended(stream: Stream, m: Model, start: Start, states: Array) -> bool:
    """Joint extended Kalman filter into `states` (n, 4); False when a state stopped being a number."""
    x, covariance = start.x.copy(), start.covariance.copy()
    identity = np.eye(4)
    states[0] = x
    for k in range(stream.output.shape[0] - 1):
        jacobian = joint_jacobian(x, k, stream, m)
        _joint_advance(x, k, stream, m)
        covariance = start.process + jacobian @ covariance @ jacobian.T
        gain = covariance[:, 0] / (covariance[0, 0] + start.measurement)
        x += gain * (stream.output[k + 1] - x[0])
        kept = identity.copy()  # I - K C
        kept[:, 0] -= gain
        covariance = kept @ covariance @ kept.T + start.measurement * np.outer(gain, gain)
        if stream.resting[k + 1]:
            rest(x, covariance)
        if not np.all(np.isfinite(x)):
            return False
        states[k + 1] = x
    return True


@njit(cache=True, nogil=True)
def predict(stream: Stream, m: Model, gain: Array, span: Span, innovations: Array, sac: Array) -> None:
    """Predictor over a span, from x1 = y, x2 = 0; its gain is on [x1, x2].

    innovations and sac (x3) hold one value a sample; with `release` = end the gain never stops.
    """
    first, release, end = span
    x1, x2, x3 = stream.output[first], 0.0, 0.0
    innovations[0], sac[0] = 0.0, 0.0
    for k in range(first, end - 1):
        x1, x2, x3 = advance(x1, x2, x3, k, stream, 0.0, m)
        e = stream.output[k + 1] - x1
        if k + 1 < release:
            x1, x2 = x1 + gain[0] * e, x2 + gain[1] * e
        if stream.resting[k + 1]:
            x3 = 0.0
        innovations[k + 1 - first], sac[k + 1 - first] = e, x3


def line_gain(
    angle: float, impedance: float, late: float, rail_noise: float, line_noise: float
) -> tuple[Array, float]:
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


@dataclass(frozen=True, eq=False)
class PeerInputs:
    """A recording for the peers; `events` (m, 2): first open sample, and first sample 10 ms after the last."""

    model: Model
    stream: Stream
    events: NDArray[np.int64]


def lump_model(part: Injector, sac_follows: bool = False) -> Model:
    """Coefficients of an injector with a lumped line; its sac may follow without delay."""
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
        sac_follows=sac_follows,
    )


def peer_inputs(measured: Measured, model: Model | None = None) -> PeerInputs:
    """The recording as every peer takes it; the model is the nominal injector's unless another is given."""
    part = Injector()
    interval = float(measured.time[1] - measured.time[0])
    opened = _open(measured.needle_lift)
    lift = np.where(opened, np.maximum(measured.needle_lift, 0.0), 0.0)
    sine, taper = math.sin(part.seat_half_angle), math.sin(2.0 * part.seat_half_angle)
    area = math.pi * lift * sine * (part.seat_diameter - 0.5 * lift * taper)
    sample = np.arange(opened.size)
    last_open = np.maximum.accumulate(np.where(opened, sample, -opened.size))
    shut_for = sample - last_open
    stream = Stream(
        np.stack(
            ((measured.rail_pressure - part.chamber_pressure) / PRESSURE_SCALE, area / AREA_SCALE), axis=1
        ),
        (measured.line_pressure - part.chamber_pressure) / PRESSURE_SCALE,
        shut_for > SETTLED / interval,
        interval,
        max(5, math.ceil(interval / STEP)),
    )
    return PeerInputs(model or lump_model(part), stream, _events(opened, round(EVENT_GAP / interval)))


def _open(lift: Array) -> NDArray[np.bool_]:
    """Dead band: open where two samples in a row are above it, and a few positive samples round that."""
    above = lift > OPEN_LIFT
    pair = above[1:] & above[:-1]
    core = np.concatenate((pair, [False])) | np.concatenate(([False], pair))
    opened = core.copy()
    for shift in range(1, LOOK_BACK + 1):
        opened[:-shift] |= core[shift:] & (lift[:-shift] > 0.0)
        opened[shift:] |= core[:-shift] & (lift[shift:] > 0.0)
    return opened


def _events(opened: NDArray[np.bool_], gap: int) -> NDArray[np.int64]:
    samples = np.flatnonzero(opened)
    starts = samples[np.concatenate(([True], np.diff(samples) > gap))]
    ends = samples[np.concatenate((np.diff(samples) > gap, [True]))]
    return np.stack((starts, np.minimum(ends + gap, opened.size - 1)), axis=1)
