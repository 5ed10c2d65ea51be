"""The identification system x~: prediction by the model with phi, correction by the gain, its innovations."""

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from observer_rt.estimation.scalars import SCALARS, Learned, Parameter, Scalars, by_theta, learned_of
from observer_rt.foundation.compiled import compiled, inlined, inner, inner_separate, separate
from observer_rt.foundation.small_arrays import WIDTH, load, store
from observer_rt.model.borrowed import borrowed, borrowed_network, borrowed_tangent
from observer_rt.model.effective import Coefficients
from observer_rt.model.forcing import (
    NO_CLOCK,
    NO_PROGRAM,
    Clock,
    Forced,
    Forcing,
    borrowed_forcing,
    forcing_of,
    rate_after,
    shown_under_terms,
    trusted_under_terms,
    under_terms,
)
from observer_rt.model.hydraulics import empty_sac
from observer_rt.model.integrator import Interval, advance_over
from observer_rt.model.line.interface import begin_mean
from observer_rt.model.right_hand_side import Tangent, tangent_of
from observer_rt.model.sensor import LAG_UNIT, lagged, lagged_slopes, recorded, recorded_mean

NO_RATE = np.empty(0)
NO_SLOPES = np.empty((0, 0))
_OFFSET = int(Parameter.LINE_PRESSURE_OFFSET)
_LAG = int(Parameter.SENSOR_LAG)
_SAC = 2  # place of p_S in x


class Window(NamedTuple):
    """Consecutive samples round one event, normalised by (24); n samples.

    inputs: (n, 2) u = [p_R, A_S]; output: (n,) y, moved by the whole samples it is recorded late; resting:
    (n,) needle shut so long that p_S = p_C; start: (states + 1,) x~ and the indicated pressure at the first sample;
    opening: index of the first sample with an open needle; knots: (n, 2), where the area bends after each sample, as
    in `integrator.advance_over`, for a lift that was sampled between the samples. (0, 2): it was not. masked:
    (n,) y is an outlier and does not count; (0,): none is. clock: time and openings up to the first sample.
    """

    inputs: NDArray[np.float64]
    output: NDArray[np.float64]
    resting: NDArray[np.bool_]
    start: NDArray[np.float64]
    opening: int
    knots: NDArray[np.float64] = np.empty((0, 2))
    masked: NDArray[np.bool_] = np.empty(0, np.bool_)
    clock: Clock = NO_CLOCK

    def until(self, end: int) -> "Window":
        """Its first samples, so many."""
        return Window(
            self.inputs[:end],
            self.output[:end],
            self.resting[:end],
            self.start,
            self.opening,
            self.knots[:end],
            self.masked[:end],
            self.clock,
        )


class Setting(NamedTuple):
    """What stays the same while parameters are sought: sample interval [s], substeps, model, gain (states,).

    late: by which share of an interval (0..1) the indicated pressure is recorded late; lag [s] and offset (in units
    of p_0): of the sensor of the model in force, what is learned comes on top. program: of the terms in force.
    """

    interval: float
    substeps: int
    coefficients: Coefficients
    gain: NDArray[np.float64]
    late: float = 0.0
    lag: float = 0.0
    offset: float = 0.0
    program: NDArray[np.float64] = NO_PROGRAM


@inlined
def knot_before(window: Window, k: int) -> tuple[float, float]:
    """Where the area bends between sample k and the one before it; a share of 0 where it does not."""
    if window.knots.shape[0] == 0:
        return 0.0, 0.0
    return window.knots[k - 1, 0], window.knots[k - 1, 1]


@inlined
def is_masked(window: Window, k: int) -> bool:
    """Whether y of sample k does not count."""
    return bool(k < window.masked.shape[0] and window.masked[k])


@inlined
def interval_before(window: Window, setting: Setting, k: int) -> Interval:
    """Between sample k and the one before it."""
    inputs = window.inputs
    start, end = (inputs[k - 1, 0], inputs[k - 1, 1]), (inputs[k, 0], inputs[k, 1])
    return Interval(start, end, setting.interval, setting.substeps)


@inlined
def forced_before(
    window: Window, setting: Setting, learned: Learned, x: NDArray[np.float64], k: int, forcing: Forcing
) -> Forced:
    """`interval_before` and the model from a state x (n,) on, under the terms in force."""
    interval, knot = interval_before(window, setting, k), knot_before(window, k)
    forced: Forced = under_terms(x, interval, knot, learned.coefficients, learned.network, forcing)
    return forced


class Gradient(NamedTuple):
    """What carries the filtered gradient d e~/d theta along; all but the state's tangent as wide as that is."""

    tangent: Tangent
    lag: NDArray[np.float64]  # of the sensor's lag [s]
    before: NDArray[np.float64]  # of p_L one sample before
    indicated: NDArray[np.float64]
    error: NDArray[np.float64]  # of the innovation


def gradient_of(
    theta: NDArray[np.float64], c: Coefficients, learned: Learned, scalars: Scalars = SCALARS
) -> Gradient:
    """A gradient of 0 for theta (m,) on the model `c`."""
    tangent = tangent_of(c, learned.network, by_theta(theta, c, scalars), theta.size)
    lag, before, indicated, error = np.zeros((4, tangent.by.shape[1]))
    lag[_LAG] = LAG_UNIT
    return Gradient(tangent, lag, before, indicated, error)


@inlined
def predict(
    x: NDArray[np.float64],
    indicated: float,
    forced: Forced,
    late: float,
    lag: float,
    gradient: Any,
) -> tuple[float, float]:
    """x (n,) one sample on, in place; what the sensor indicates then, and what is recorded of it without terms.

    gradient: `Gradient` to be moved with it, None for none.
    """
    before = x[0]
    interval, knot, c, network = forced.interval, forced.knot, forced.coefficients, forced.network
    if gradient is None:
        begin_mean(x, None, c.line)
        advance_over(x, interval, knot, c, network, None)
        moved = lagged(indicated, before, x[0], interval.length, lag)
    else:
        for first in range(0, gradient.before.shape[0], WIDTH):
            store(gradient.before, first, load(gradient.tangent.by, first))
        begin_mean(x, gradient.tangent, c.line)
        advance_over(x, interval, knot, c, network, gradient.tangent)
        moved = lagged(indicated, before, x[0], interval.length, lag)
        slopes = lagged_slopes(indicated, before, x[0], interval.length, lag)
        _predict_gradient(gradient, slopes, late, interval.length, lag, moved - indicated, c.line)
    return moved, _shown(indicated, moved, x[-1], interval.length, lag, late, c.line)


def _shown(
    indicated_before: float,
    indicated: float,
    integral: float,
    interval: float,
    lag: float,
    late: float,
    line: Any,
) -> float:
    """What is recorded of a signal, and of its slopes: its value or its mean, by the line. For compiled code.

    integral: of the pressure over the interval, of an averaged line.
    """
    raise NotImplementedError


@overload(_shown, strict=False)
def _shown_compiled(
    indicated_before: Any, indicated: Any, integral: Any, interval: Any, lag: Any, late: Any, line: Any
) -> Any:
    def mean(
        indicated_before: Any, indicated: Any, integral: Any, interval: Any, lag: Any, late: Any, line: Any
    ) -> Any:
        return recorded_mean(indicated_before, indicated, integral / interval, lag / interval, late)

    def value(
        indicated_before: Any, indicated: Any, integral: Any, interval: Any, lag: Any, late: Any, line: Any
    ) -> Any:
        return recorded(indicated_before, indicated, late)

    return mean if line.instance_class.averaged else value


@inner
def _predict_gradient(
    gradient: Gradient,
    slopes: tuple[float, float, float, float],
    late: float,
    interval: float,
    lag: float,
    rise: float,
    line: Any,
) -> None:
    """The gradient through the sensor, with its slopes as `lagged_slopes` has them; rise: of what it indicates."""
    by_self, by_start, by_end, by_lag = slopes
    by, by_theta = gradient.tangent.by, gradient.lag
    last = (by.shape[0] - 1) * by.shape[1]
    for first in range(0, by.shape[1], WIDTH):
        before = load(gradient.indicated, first)
        predicted = by_self * before + by_start * load(gradient.before, first) + by_end * load(by, first)
        predicted = predicted + by_lag * load(by_theta, first)
        integrated = load(by, last + first) - rise * load(by_theta, first)
        shown = _shown(before, predicted, integrated, interval, lag, late, line)
        store(gradient.error, first, -1.0 * shown)
        store(gradient.indicated, first, predicted)
    gradient.error[_OFFSET] -= 1.0


@inlined
def correct(
    x: NDArray[np.float64], indicated: float, innovation: float, gain: NDArray[np.float64], gradient: Any
) -> float:
    """x~ (n,) after a measurement, in place, and the indicated pressure: x~ + K e~.

    The plus sign is that of an observer (the paper prints (5) with a minus). p_S gets no gain; its place in `gain`
    (n,) is the indicated pressure's.
    """
    for i in range(x.shape[0]):
        if i != _SAC:
            x[i] += gain[i] * innovation
            if gradient is not None:
                _add_times(gain[i], gradient.error, gradient.tangent.by, i * gradient.error.shape[0])
    if gradient is not None:
        _add_times(gain[_SAC], gradient.error, gradient.indicated, 0)
    return float(indicated + gain[_SAC] * innovation)


@inner
def _add_times(factor: float, values: NDArray[np.float64], result: NDArray[np.float64], place: int) -> None:
    """Values (m,) times a factor onto those of an array from a place on."""
    for first in range(0, values.shape[0], WIDTH):
        store(result, place + first, load(result, place + first) + factor * load(values, first))


@inner
def _keep_slopes(error: NDArray[np.float64], is_measured: bool, slopes: NDArray[np.float64], k: int) -> None:
    """The derivatives of the innovation into row k of `slopes`, 0 where it does not count."""
    for j in range(slopes.shape[1]):
        slopes[k, j] = error[j] if is_measured else 0.0


def _borrowed_gradient(gradient: Any) -> Any:
    """A gradient of borrowed arrays; None of None. For compiled code."""
    raise NotImplementedError


@overload(_borrowed_gradient, strict=False)
def _borrowed_gradient_compiled(gradient: Any) -> Any:
    if isinstance(gradient, types.NoneType):
        return lambda gradient: None
    return lambda gradient: Gradient(
        borrowed_tangent(gradient.tangent),
        borrowed(gradient.lag),
        borrowed(gradient.before),
        borrowed(gradient.indicated),
        borrowed(gradient.error),
    )


@inner_separate
def _follow(
    window: Window,
    setting: Setting,
    learned: Learned,
    corrected: int,
    errors: NDArray[np.float64],
    rate: NDArray[np.float64],
    gradient: Any,
    slopes: NDArray[np.float64],
    forcing: Forcing,
) -> NDArray[np.float64]:
    """`follow`, on arrays that are lent to it."""
    forcing = borrowed_forcing(forcing)
    lag, offset = setting.lag + learned.lag, setting.offset + learned.offset
    output = window.output
    state = window.start[:-1].copy()
    x = borrowed(state)
    indicated = window.start[-1]
    errors[:1] = 0.0
    rate[:1] = 0.0
    slopes[:1] = 0.0
    for k in range(1, output.shape[0]):
        forced = forced_before(window, setting, learned, x, k, forcing)
        indicated, shown = predict(x, indicated, forced, setting.late, lag, gradient)
        shown = shown_under_terms(shown, forced, forcing)
        if rate.shape[0] > 0:
            rate[k] = rate_after(x, forced)
        is_measured = not is_masked(window, k)
        errors[k] = output[k] - offset - shown if is_measured else 0.0
        if gradient is not None:
            _keep_slopes(gradient.error, is_measured, slopes, k)
        if k < corrected and is_measured:
            trusted = trusted_under_terms(errors[k], setting.interval, forcing)
            indicated = correct(x, indicated, trusted, setting.gain, gradient)
        if window.resting[k] and forced.interval.end[1] <= 0.0:
            empty_sac(x, None if gradient is None else gradient.tangent)
    return state


@separate
def follow(
    window: Window,
    setting: Setting,
    learned: Learned,
    corrected: int,
    errors: NDArray[np.float64],
    rate: NDArray[np.float64],
    gradient: Any,
    slopes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """x~ before sample `corrected`, from there on x^: it follows x~ and then runs open loop; its last state (n,).

    errors: (n,) y - o - (indicated pressure), before the correction, errors[0] is 0; rate: of injection, before the
    correction [m3/s], (n,), or (0,) if not wanted. With a `Gradient` of 0 (else None), slopes (n, m) becomes
    d(errors)/dtheta.
    """
    lent = Learned(borrowed_network(learned.network), learned.coefficients, learned.offset, learned.lag)
    forcing = forcing_of(setting.program, window.clock, len(learned.coefficients.line))
    x: NDArray[np.float64] = _follow(
        window, setting, lent, corrected, errors, rate, _borrowed_gradient(gradient), slopes, forcing
    )
    return x


def innovations(window: Window, setting: Setting, learned: Learned, result: NDArray[np.float64]) -> None:
    """Innovations e~ = y - o - (indicated pressure of x~) of every sample into `result` (n,); result[0] is 0."""
    follow(window, setting, learned, window.output.size, result, NO_RATE, None, NO_SLOPES)


def innovations_with_sensitivity(
    window: Window,
    setting: Setting,
    theta: NDArray[np.float64],
    result: NDArray[np.float64],
    slopes: NDArray[np.float64],
    scalars: Scalars = SCALARS,
) -> None:
    """`innovations` for theta (m,) and their derivatives de~/dtheta into `slopes` (n, m): the filtered gradient."""
    learned = learned_of(theta, setting.coefficients, scalars)
    gradient = gradient_of(theta, setting.coefficients, learned, scalars)
    follow(window, setting, learned, window.output.size, result, NO_RATE, gradient, slopes)


def open_loop_errors(window: Window, setting: Setting, learned: Learned) -> NDArray[np.float64]:
    """Output errors (n,) of the observer re-simulated over a window, through the sensor's lag.

    x^ follows x~ up to the opening and runs open loop from there, as it does live.
    """
    errors = np.empty(window.output.size)
    follow(window, setting, learned, window.opening, errors, NO_RATE, None, NO_SLOPES)
    return errors


@compiled
def sum_of_squares(errors: NDArray[np.float64]) -> float:
    """In the order of the samples."""
    total = 0.0
    for error in errors:
        total += error * error
    return total
