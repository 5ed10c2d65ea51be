"""The predictor x~ over the window of an event: its gains, its innovations and their slopes, and x^ in open loop."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.gain import solve_riccati
from observer_rt.core.learning.predictor import follow, move_lift, propagate_noise
from observer_rt.core.model.laws import lagged_slopes, recorded_mean
from observer_rt.core.model.model import SENSOR_NUMBERS
from observer_rt.core.model.needle import NEEDLE_NUMBERS, NeedleLaw, NeedleStroke, commanded_areas, stroke_of
from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.engine.estimation.parameters import EVERY, SENSOR_LAW, LearnedModel, Parameter, by_theta, learned_of
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, Bools, Floats, Ints
from observer_rt.model.effective import LAG_UNIT, NO_CLOCK, NO_PROGRAM, Clock, Coefficients
from observer_rt.model.hydraulics import CONTROL_REFERENCE
from observer_rt.model.tangent import ByTheta, Tangent, tangent_of

START_DURATION = 2e-3  # s, after which the gain is steady
SHAPING = 3  # first-order lags that represent the smoothing of the rail pressure
SHAPE = 0.35  # time constant of each, in widths of the kernel: both halve the noise at the same frequency
SMOOTHED_BY = 50e-6  # s, of the rail pressure's kernel: it leaves what a rail does up to some 3 kHz
SMOOTHED_OVER = 4.0  # widths to either side
START_FLOW_SIGMA = 1e-5  # m3/s (10 mm3/ms), of Q_L when x~ starts anew in a ringing line
NO_RATE = np.empty(0)
NO_COMMANDS = NO_KNOTS = np.empty((0, 2))
NO_SLOPES = np.empty((0, 0))
NO_NEEDLE, NO_SHOTS = np.empty((0, NEEDLE_NUMBERS)), np.empty(0, np.int64)
DELAY_STEP = 2.5e-6  # s, forward and back, by which the lift is moved for a slope
SETTLE = 3e-3  # s of a shut needle, after which the sac is certainly at rest
DRAINING = 0.2e-3  # s of a shut needle, after which the sac is certainly drained


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
    """Kalman gains of x~, from a start with x1 = y, x2 = 0: row k is used k samples later, the last for good."""

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

    p_S gets no gain: it relaxes within microseconds. sample_rate [Hz], lag of the sensor [s]; late: share (0..1) of a
    sample interval by which the indicated pressure is recorded late; rail_every: samples to one of the rail pressure:
    the longer the lines between them, the more noise at low frequencies; rail_smoothing: kernel width [s], which
    colours that noise. The covariance carries the colour (Schmidt's filter): x~ has no states for it.
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
    return GainSchedule(np.ascontiguousarray(gains[:, [0, 1, m, *range(2, m)]]), math.sqrt(variance))


def _coloured(
    transition: Matrix, rail_effect: Matrix, covariance: Matrix, variance: float, kept: float
) -> tuple[Matrix, Matrix, Matrix]:
    """Model (transition, process noise, start covariance) with `SHAPING` lags, which keep `kept` of the noise."""
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


def smoothing_of(interval: float) -> float:
    """Width [s] of the kernel that smooths the rail pressure: at least a sample, else noise fixes the delay."""
    return max(SMOOTHED_BY, interval)


def smoothed(rail: Floats, interval: float, late: float = 0.0) -> Floats:
    """Rail pressure (n,) at samples of an interval [s], smoothed, of a channel that records it `late` samples late.

    The kernel is of fourth order, (3 - u2)/2 times a normal density: parabolas pass unchanged.
    """
    width = smoothing_of(interval) / interval
    reach = int(np.ceil(SMOOTHED_OVER * width + abs(late)))
    u = (np.arange(-reach, reach + 1) - late) / width
    weights = (3.0 - u**2) * np.exp(-0.5 * u**2)
    beyond = np.pad(rail, reach, mode="edge")
    return np.asarray(np.convolve(beyond, weights[::-1] / weights.sum(), "valid"), np.float64)


class Window(NamedTuple):
    """Consecutive samples round one event, normalised by (24); n samples."""

    inputs: Floats  # (n, 2) u = [p_R, A_S]
    output: Floats  # (n,) y, moved by the whole samples it is recorded late
    resting: Bools  # (n,) needle shut so long that p_S = p_C
    start: Floats  # (states + 1,) x~ and the indicated pressure at the first sample
    opening: int  # index of the first sample with an open needle
    knots: Floats = NO_KNOTS  # bends (n, 2) of the area as in `model.advance_over`; (0, 2): none
    masked: Bools = np.empty(0, np.bool_)  # (n,) y is an outlier and does not count; (0,): none is
    clock: Clock = NO_CLOCK  # time and openings up to the first sample
    commands: Floats = NO_COMMANDS  # (k, 2) first samples with and without energizing; inf: unknown
    needle: NeedleLaw | None = None  # answers the commands; None: its lift is recorded
    by_needle: Floats = NO_NEEDLE  # (n, NEEDLE_NUMBERS) slopes of A_S; (0, ..): none
    shots: Ints = NO_SHOTS  # (n,) numbers of the commands; (0,): none

    def until(self, end: int) -> "Window":
        """The first `end` samples of the window; its inputs go on, for a pilot valve is ahead of the lift."""
        return self._replace(**{name: getattr(self, name)[:end] for name in ("output", "resting", "masked")})

    def as_learned(self, learned: LearnedModel, setting: "Setting") -> "Window":
        """The window with the needle as learned: its answer to commands, or its recorded lift, which may be late."""
        if self.needle is None:
            return self.with_lift_earlier(learned.lift_delay / setting.interval)
        c, inputs, interval = setting.coefficients, self.inputs.copy(), setting.interval
        n, pressures = len(inputs), self._pressures(c)
        areas, slopes, shots = np.zeros(n), np.zeros((n, NEEDLE_NUMBERS)), np.zeros(n, np.int64)
        commanded_areas(self.commands, pressures, self.needle, learned.needle, c.seat, interval, areas, slopes, shots)
        inputs[:, 1] = areas
        is_open = areas > 0.0
        every, settled = np.arange(n), round(SETTLE / interval)
        last = np.maximum.accumulate(np.where(is_open, every, -settled - 1))
        resting = (every - last > settled) & ~np.append(is_open[1:], False)
        first = int(np.argmax(is_open)) if is_open.any() else self.opening
        return self._replace(
            inputs=inputs,
            resting=resting[: self.resting.size],
            opening=max(first, 1),
            knots=NO_KNOTS,
            by_needle=slopes,
            shots=shots,
        )

    def strokes(self, learned: LearnedModel, setting: "Setting") -> Iterator[NeedleStroke | None]:
        """Stroke of the needle as learned at each command, in s from the first sample on; None: it does not lift."""
        if self.needle is None:
            return
        spans = zip(*(setting.interval * self.commands).T, self._pressures(setting.coefficients), strict=True)
        for begin, end, rail in spans:
            answer = stroke_of(begin, end - begin, rail, self.needle, learned.needle)
            yield None if answer is None else NeedleStroke(**answer)

    def _pressures(self, c: Coefficients) -> Floats:
        """Rail pressures (k,) at the commands, in units of 100 MPa."""
        begun = np.clip(self.commands[:, 0], 0, len(self.inputs) - 1).astype(np.int64)
        return np.asarray((self.inputs[begun, 0] * c.pressure_scale + c.chamber_pressure) / CONTROL_REFERENCE)

    @property
    def shot_columns(self) -> int:
        """Number of columns of slopes by delays of shots: two for each command that a needle answers, else 0."""
        return 0 if self.needle is None else 2 * len(self.commands)

    def with_jitter(self, jitter: Floats, interval: float) -> "Window":
        """The window with shots that open and close later by `jitter` (2 shots,) [s]: two delays of each."""
        return self if not jitter.size else self._replace(commands=self.commands + jitter.reshape(-1, 2) / interval)

    def with_lift_earlier(self, samples: float) -> "Window":
        """The window with its lift earlier by so many samples, interpolated linearly between samples and knots."""
        if samples == 0.0:
            return self
        inputs, knots = move_lift(self.inputs, self.knots, samples)
        opening, resting, whole_samples = max(self.opening - math.ceil(samples), 1), self.resting, round(samples)
        if whole_samples != 0:
            last = resting.size - 1
            resting = resting[np.minimum(np.maximum(np.arange(last + 1) + whole_samples, 0), last)]
        return self._replace(inputs=inputs, resting=resting, opening=opening, knots=knots)


class Setting(NamedTuple):
    """Constants of a predictor while parameters are fitted."""

    interval: float  # of the samples [s]
    substeps: int  # of an interval
    coefficients: Coefficients
    gain: Floats  # (states,)
    late: float = 0.0  # share of an interval (0..1) by which the indicated pressure is recorded late
    lag: float = 0.0  # [s] of the sensor in force, to which a learned one is added
    offset: float = 0.0  # [p_0] likewise
    program: Floats = NO_PROGRAM  # terms in force
    rail_share: float = 0.0  # as of `StatedAccuracy`


class Gradient(NamedTuple):
    """Memory of the filtered gradient d e~/d theta; all arrays have as many columns as the state's tangent."""

    tangent: Tangent
    offset: int  # column of theta that is the offset of the line-pressure sensor
    sensor: Floats  # (SENSOR_NUMBERS, m) of the numbers of the sensor's law
    before: Floats  # (m,) of p_L one sample before
    indicated: Floats  # (m,) of the indicated pressure
    error: Floats  # (m,) of the innovation


def gradient_of(acting: ByTheta, c: Coefficients, columns: int, is_commanded: bool = False) -> Gradient:
    """A gradient of 0 with room for `columns` at least; is_commanded: the needle answers commands."""
    tangent = tangent_of(c, acting, columns, is_commanded)
    width = tangent.by.shape[1]
    sensor, (before, indicated, error) = np.zeros((SENSOR_NUMBERS, width)), np.zeros((3, width))
    sensor[np.arange(SENSOR_NUMBERS), acting.sensor] = SENSOR_LAW.sizes
    return Gradient(tangent, acting.offset, sensor, before, indicated, error)


def innovations(window: Window, setting: Setting, learned: LearnedModel, result: Floats) -> None:
    """Innovations e~ = y - o - (indicated pressure of x~) of every sample into `result` (n,); result[0] is 0."""
    window = window.as_learned(learned, setting)
    follow(window, setting, learned, window.output.size, result, NO_RATE, None, NO_SLOPES)


def innovations_with_sensitivity(
    window: Window, setting: Setting, theta: Floats, result: Floats, slopes: Floats, columns: Ints = EVERY
) -> None:
    """`innovations` for theta (m,), and their filtered derivatives de~/dtheta into `slopes` (n, k).

    columns (k,): of theta, those of the needle included where it answers commands; the window's `shot_columns` come
    last. The delay of the lift has a difference quotient, for the lift has corners between samples.
    """
    c, extra = setting.coefficients, window.shot_columns
    learned, acting = learned_of(theta, c), by_theta(theta, c, columns, extra // 2)
    gradient = gradient_of(acting, c, acting.elsewhere + 1, window.needle is not None)
    here = window.as_learned(learned, setting)
    follow(here, setting, learned, window.output.size, result, NO_RATE, gradient, slopes)
    if window.needle is not None:
        return
    later, earlier = np.empty((2, window.output.size))
    innovations(window, setting, learned._replace(lift_delay=learned.lift_delay + DELAY_STEP), later)
    innovations(window, setting, learned._replace(lift_delay=learned.lift_delay - DELAY_STEP), earlier)
    slopes[:, columns == Parameter.LIFT_DELAY] = ((later - earlier) * (0.5 * LAG_UNIT / DELAY_STEP))[:, None]


class OpenLoop(NamedTuple):
    """x^ over a window of n samples: it is x~ up to the opening, and open loop from there; all 0 without flow."""

    rate: Floats  # (n,) Q_H^ [m3/s]
    slopes: Floats  # (n, m) of the rate by theta
    gradient: Floats  # (n, states + 1) of the rate by x and A_S [m3/s]
    transition: Floats  # (k, states, states) of x by x one sample before, until the sac is drained
    relaxation: Floats  # (n,) rate [1/s] at which p_S approaches its steady value
    by_area: Floats  # (n,) slope of that value by A_S, normalised by (24)
    fullness: Floats  # (n,) p_S over p_L


def open_loop(window: Window, setting: Setting, theta: Floats) -> OpenLoop:
    """x^ with the parameters theta (m,) over a window, its sensitivities starting at 0 at the opening."""
    n, m, states = window.output.size, theta.size, setting.coefficients.states
    learned = learned_of(theta, setting.coefficients)
    window = window.as_learned(learned, setting)
    opened = np.flatnonzero(window.inputs[:n, 1] > 0.0)
    drained = min(int(opened[-1] if opened.size else 0) + 1 + math.ceil(DRAINING / setting.interval), n)
    result = OpenLoop(
        rate=np.zeros(n),
        slopes=np.zeros((n, m)),
        gradient=np.zeros((n, states + 1)),
        transition=np.zeros((drained, states, states)),
        relaxation=np.zeros(n),
        by_area=np.zeros(n),
        fullness=np.zeros(n),
    )
    acting = by_theta(theta, setting.coefficients)
    gradient = gradient_of(acting, setting.coefficients, m + states, window.needle is not None)
    follow(window, setting, learned, window.opening, np.empty(n), NO_RATE, gradient, NO_SLOPES, run=result)
    if window.needle is None:
        result.slopes[:, Parameter.LIFT_DELAY] = np.gradient(result.rate) * (LAG_UNIT / setting.interval)
    if setting.rail_share == 0.0:
        return result
    level = level_of(theta, setting)
    for flow in (result.rate, result.slopes, result.gradient):
        flow *= level
    result.slopes[:, Parameter.LINE_PRESSURE_GAIN] += setting.rail_share / level * result.rate
    return result


def level_of(theta: Floats, setting: Setting) -> float:
    """Factor on flows with theta (m,), which are computed in the rail sensor's units."""
    return 1.0 + setting.rail_share * float(theta[Parameter.LINE_PRESSURE_GAIN])


@dataclass(frozen=True)
class InputVariance:
    """Variances (n,) by input noise alone: of the rate [m6/s2], and of the volume since the last opening [m6]."""

    rate: Floats
    volume: Floats


def input_variance(window: Window, run: OpenLoop, setting: Setting, noise: NoiseLevels) -> InputVariance:
    """Variances by noise of lift and rail pressure, and of x~ at the opening, through `run` over the window."""
    n = window.output.shape[0]
    result = InputVariance(np.zeros(n), np.zeros(n))
    c = setting.coefficients
    line_pressure = noise.line_pressure / c.pressure_scale
    pressure = setting.gain[0] * line_pressure**2
    propagate_noise(
        window.inputs[:, 1],
        window.opening,
        run,
        setting.interval,
        c.seat,
        (pressure, pressure / c.line.impedance**2),
        c.line.by_rail * (setting.interval * noise.rail_pressure / c.pressure_scale),
        noise.needle_lift / c.area_scale,
        result.rate,
        result.volume,
    )
    return result
