"""The identification system x~: prediction by the model with phi, correction by the gain, its innovations."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.learned import Learned
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter, advance_over_with_sensitivity
from observer_rt.model.coefficients import Coefficients, with_line_terms
from observer_rt.model.integrator import advance_over
from observer_rt.model.right_hand_side import injection_rate
from observer_rt.model.sensor import LAG_UNIT, lagged, lagged_slopes, recorded

_OFFSET = int(Parameter.LINE_PRESSURE_OFFSET)
_LAG = int(Parameter.SENSOR_LAG)


class Window(NamedTuple):
    """Consecutive samples round one event, normalised by (24); n samples.

    inputs: (n, 2) u = [p_R, A_S]; output: (n,) y, moved by the whole samples it is recorded late; resting:
    (n,) needle shut so long that p_S = p_C; start: (4,) x~ and the indicated pressure at the first sample; opening:
    index of the first sample with an open needle; knots: (n, 2), where the area bends after each sample, as in
    `integrator.advance_over`, for a lift that was sampled between the samples. (0, 2): it was not.
    """

    inputs: NDArray[np.float64]
    output: NDArray[np.float64]
    resting: NDArray[np.bool_]
    start: NDArray[np.float64]
    opening: int
    knots: NDArray[np.float64] = np.empty((0, 2))


class Setting(NamedTuple):
    """What stays the same while parameters are sought: sample interval [s], substeps, model, gain (3,).

    late: by which share of an interval (0..1) the indicated pressure is recorded late; lag [s] and offset (in units
    of p_0): of the sensor of the model in force, what is learned comes on top.
    """

    interval: float
    substeps: int
    coefficients: Coefficients
    gain: NDArray[np.float64]
    late: float = 0.0
    lag: float = 0.0
    offset: float = 0.0


@njit(cache=True, nogil=True, inline="always")
def knot_before(window: Window, k: int) -> tuple[float, float]:
    """Where the area bends between sample k and the one before it; a share of 0 where it does not."""
    if window.knots.shape[0] == 0:
        return 0.0, 0.0
    return window.knots[k - 1, 0], window.knots[k - 1, 1]


@njit(cache=True, nogil=True)
def correct(
    x: tuple[float, float, float], innovation: float, gain_pressure: float, gain_flow: float
) -> tuple[float, float, float]:
    """x~ after a measurement: x~ + K e~, the plus sign of an observer (the paper prints (5) with a minus)."""
    return x[0] + gain_pressure * innovation, x[1] + gain_flow * innovation, x[2]


@njit(cache=True, nogil=True)
def follow(
    window: Window,
    setting: Setting,
    learned: Learned,
    corrected: int,
    errors: NDArray[np.float64],
    rate: NDArray[np.float64],
) -> tuple[float, float, float]:
    """x~ before sample `corrected`, from there on x^: it follows x~ and then runs open loop; its last state.

    errors: (n,) y - o - (indicated pressure), before the correction, errors[0] is 0; rate: of injection, before the
    correction [m3/s], (n,), or (0,) if not wanted.
    """
    c = with_line_terms(setting.coefficients, learned.line)
    lag, offset = setting.lag + learned.lag, setting.offset + learned.offset
    x = (window.start[0], window.start[1], window.start[2])
    indicated = window.start[3]
    inputs, output, resting, network = window.inputs, window.output, window.resting, learned.network
    gain = (setting.gain[0], setting.gain[1], setting.gain[2])
    errors[:1] = 0.0
    rate[:1] = 0.0
    for k in range(1, output.shape[0]):
        u_start = (inputs[k - 1, 0], inputs[k - 1, 1])
        u_end = (inputs[k, 0], inputs[k, 1])
        before = x[0]
        x = advance_over(
            x, u_start, knot_before(window, k), u_end, setting.interval, setting.substeps, c, network
        )
        if rate.shape[0] > 0:
            rate[k] = injection_rate(x, (u_end[0], max(u_end[1], 0.0)), c, network)
        indicated_before = indicated
        indicated = lagged(indicated, before, x[0], setting.interval, lag)
        error = output[k] - offset - recorded(indicated_before, indicated, setting.late)
        errors[k] = error
        if k < corrected:
            x = correct(x, error, gain[0], gain[1])
            indicated += gain[2] * error
        if resting[k]:
            x = (x[0], x[1], 0.0)
    return x


@njit(cache=True, nogil=True)
def innovations(window: Window, setting: Setting, learned: Learned, result: NDArray[np.float64]) -> None:
    """Innovations e~ = y - o - (indicated pressure of x~) of every sample into `result` (n,); result[0] is 0."""
    follow(window, setting, learned, window.output.shape[0], result, np.empty(0))


@njit(cache=True, nogil=True)
def open_loop_error(window: Window, setting: Setting, learned: Learned) -> float:
    """Sum of squared output errors of the observer re-simulated over a window, through the sensor's lag.

    x^ follows x~ up to the opening and runs open loop from there, as it does live.
    """
    errors = np.empty(window.output.shape[0])
    follow(window, setting, learned, window.opening, errors, np.empty(0))
    total = 0.0
    for error in errors[window.opening :]:
        total += error * error
    return total


@njit(cache=True, nogil=True)
def innovations_with_sensitivity(
    window: Window,
    setting: Setting,
    learned: Learned,
    result: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """`innovations` and their derivatives de~/dtheta into `slopes` (n, PARAMETERS): the filtered gradient."""
    c = with_line_terms(setting.coefficients, learned.line)
    lag, offset = setting.lag + learned.lag, setting.offset + learned.offset
    x = (window.start[0], window.start[1], window.start[2])
    indicated = window.start[3]
    sensitivity = np.zeros((3, PARAMETERS))
    before_slope = np.zeros(PARAMETERS)
    indicated_slope = np.zeros(PARAMETERS)
    work = np.zeros((6, 3, PARAMETERS))
    result[0] = 0.0
    slopes[0, :] = 0.0
    for k in range(1, window.output.shape[0]):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u_end = (window.inputs[k, 0], window.inputs[k, 1])
        before = x[0]
        before_slope[:] = sensitivity[0]
        x = advance_over_with_sensitivity(
            x,
            u_start,
            knot_before(window, k),
            u_end,
            setting.interval,
            setting.substeps,
            setting.coefficients,
            c,
            learned.network,
            sensitivity,
            work,
        )
        by_self, by_start, by_end, by_lag = lagged_slopes(indicated, before, x[0], setting.interval, lag)
        indicated_before = indicated
        indicated = lagged(indicated, before, x[0], setting.interval, lag)
        innovation = window.output[k] - offset - recorded(indicated_before, indicated, setting.late)
        result[k] = innovation
        x = correct(x, innovation, setting.gain[0], setting.gain[1])
        indicated += setting.gain[2] * innovation
        for j in range(PARAMETERS):
            predicted = by_self * indicated_slope[j] + by_start * before_slope[j] + by_end * sensitivity[0, j]
            if j == _LAG:
                predicted += by_lag * LAG_UNIT
            slope = -recorded(indicated_slope[j], predicted, setting.late)
            if j == _OFFSET:
                slope -= 1.0
            slopes[k, j] = slope
            sensitivity[0, j] += setting.gain[0] * slope
            sensitivity[1, j] += setting.gain[1] * slope
            indicated_slope[j] = predicted + setting.gain[2] * slope
        if window.resting[k]:
            x = (x[0], x[1], 0.0)
            sensitivity[2, :] = 0.0
