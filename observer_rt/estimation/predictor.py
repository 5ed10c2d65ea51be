"""The identification system x~: prediction by the model with phi, correction by the gain, its innovations."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.sensitivity import PARAMETERS, Parameter, advance_with_sensitivity
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.integrator import advance
from observer_rt.model.network import Network

_OFFSET = int(Parameter.LINE_PRESSURE_OFFSET)


class Window(NamedTuple):
    """Consecutive samples round one event, normalised by (24); n samples.

    inputs: (n, 2) u = [p_R, A_S]; output: (n,) y; resting: (n,) needle shut so long that p_S = p_C;
    start: (3,) x~ at the first sample; opening: index of the first sample with an open needle.
    """

    inputs: NDArray[np.float64]
    output: NDArray[np.float64]
    resting: NDArray[np.bool_]
    start: NDArray[np.float64]
    opening: int


class Setting(NamedTuple):
    """What stays the same while parameters are sought: sample interval [s], substeps, model, gain (2,)."""

    interval: float
    substeps: int
    coefficients: Coefficients
    gain: NDArray[np.float64]


@njit(cache=True, nogil=True)
def correct(
    x: tuple[float, float, float], innovation: float, gain_pressure: float, gain_flow: float
) -> tuple[float, float, float]:
    """x~ after a measurement: x~ + K e~, the plus sign of an observer (the paper prints (5) with a minus)."""
    return x[0] + gain_pressure * innovation, x[1] + gain_flow * innovation, x[2]


@njit(cache=True, nogil=True)
def innovations(
    window: Window, setting: Setting, network: Network, offset: float, result: NDArray[np.float64]
) -> None:
    """Innovations e~ = y - o - C x~ of every sample into `result` (n,); result[0] is 0."""
    x = (window.start[0], window.start[1], window.start[2])
    result[0] = 0.0
    for k in range(1, window.output.shape[0]):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u_end = (window.inputs[k, 0], window.inputs[k, 1])
        x = advance(x, u_start, u_end, setting.interval, setting.substeps, setting.coefficients, network)
        result[k] = window.output[k] - offset - x[0]
        x = correct(x, result[k], setting.gain[0], setting.gain[1])
        if window.resting[k]:
            x = (x[0], x[1], 0.0)


@njit(cache=True, nogil=True)
def innovations_with_sensitivity(
    window: Window,
    setting: Setting,
    network: Network,
    offset: float,
    result: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """`innovations` and their derivatives de~/dtheta into `slopes` (n, PARAMETERS): the filtered gradient."""
    x = (window.start[0], window.start[1], window.start[2])
    sensitivity = np.zeros((3, PARAMETERS))
    work = np.zeros((5, 3, PARAMETERS))
    result[0] = 0.0
    slopes[0, :] = 0.0
    for k in range(1, window.output.shape[0]):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u_end = (window.inputs[k, 0], window.inputs[k, 1])
        x = advance_with_sensitivity(
            x,
            u_start,
            u_end,
            setting.interval,
            setting.substeps,
            setting.coefficients,
            network,
            sensitivity,
            work,
        )
        result[k] = window.output[k] - offset - x[0]
        x = correct(x, result[k], setting.gain[0], setting.gain[1])
        for j in range(PARAMETERS):
            slope = -sensitivity[0, j] - (1.0 if j == _OFFSET else 0.0)
            slopes[k, j] = slope
            sensitivity[0, j] += setting.gain[0] * slope
            sensitivity[1, j] += setting.gain[1] * slope
        if window.resting[k]:
            x = (x[0], x[1], 0.0)
            sensitivity[2, :] = 0.0


@njit(cache=True, nogil=True)
def open_loop_error(window: Window, setting: Setting, network: Network, offset: float) -> float:
    """Sum of squared output errors (y - o - C x^)^2 of the observer re-simulated over a window.

    x^ follows x~ up to the opening and runs open loop from there, as it does live.
    """
    x = (window.start[0], window.start[1], window.start[2])
    total = 0.0
    for k in range(1, window.output.shape[0]):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u_end = (window.inputs[k, 0], window.inputs[k, 1])
        x = advance(x, u_start, u_end, setting.interval, setting.substeps, setting.coefficients, network)
        error = window.output[k] - offset - x[0]
        if k < window.opening:
            x = correct(x, error, setting.gain[0], setting.gain[1])
        else:
            total += error * error
        if window.resting[k]:
            x = (x[0], x[1], 0.0)
    return total
