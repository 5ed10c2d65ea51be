"""What the noise of the inputs makes of the open-loop injection rate: covariances along the trajectory."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.estimation.open_loop import OpenLoop
from observer_rt.estimation.predictor import Setting, Window
from observer_rt.model.laws import seat_area_slope
from observer_rt.model.sensor import lagged_slopes

_AREA, _VOLUME, _SIZE = 3, 4, 5  # after x: the area's error at the sample, the volume [m3] since the opening


@dataclass(frozen=True)
class InputVariance:
    """Variances by input noise alone, both (n,): of the rate [m6/s2], of the volume since the last opening [m6]."""

    rate: NDArray[np.float64]
    volume: NDArray[np.float64]


def input_variance(window: Window, run: OpenLoop, setting: Setting, noise: NoiseLevels) -> InputVariance:
    """Noise of lift and rail pressure, and of x~ at the opening, through `run` over the window."""
    n = window.output.shape[0]
    result = InputVariance(np.zeros(n), np.zeros(n))
    c = setting.coefficients
    line_pressure = noise.line_pressure / c.pressure_scale
    _propagate(
        window,
        run,
        setting,
        setting.gain[0] * line_pressure**2,
        noise.rail_pressure / c.pressure_scale,
        noise.needle_lift / c.area_scale,
        result.rate,
        result.volume,
    )
    return result


@njit(cache=True, nogil=True)
def _propagate(
    window: Window,
    run: OpenLoop,
    setting: Setting,
    start: float,
    rail: float,
    lift: float,
    rate: NDArray[np.float64],
    volume: NDArray[np.float64],
) -> None:
    """Covariance of [x, A_S, volume] from sample to sample; start: variance of x~_1; rail, lift: sigmas.

    x~ at the opening errs as the steady Kalman filter says: K R, as much in Q_L as in p_L, for the line hardly damped
    turns one into the other. Rail noise, linear between samples, is white to Q_L. The area reaches p_S with the lag
    of the sac.
    """
    c, interval = setting.coefficients, setting.interval
    covariance = np.zeros((_SIZE, _SIZE))
    covariance[0, 0] = start
    covariance[1, 1] = start * c.a3 / c.a1
    to_line_flow = c.a3 * interval * rail
    change = np.zeros((_SIZE, _SIZE))
    by_rail, by_area, gradient = np.zeros(_SIZE), np.zeros(_SIZE), np.zeros(_SIZE)
    by_area[_AREA] = 1.0
    for k in range(max(window.opening, 1), rate.shape[0]):
        if not run.transition[k].any():  # drained: x^ was followed no further
            volume[k:] = covariance[_VOLUME, _VOLUME]
            break
        relaxation = run.relaxation[k]
        by_start, by_end = 0.0, 0.0
        if relaxation > 0.0:
            _, by_start, by_end, _ = lagged_slopes(0.0, 0.0, 0.0, interval, 1.0 / relaxation)
        half = 0.5 * interval * run.gradient[k]
        change[:3, :3] = run.transition[k]
        change[2, _AREA] = run.by_area[k] * by_start
        by_rail[1] = to_line_flow
        by_area[2] = run.by_area[k] * by_end
        change[_VOLUME, :_VOLUME] = 0.5 * interval * run.gradient[k - 1]
        for i in range(3):
            change[_VOLUME, :_VOLUME] += half[i] * change[i, :_VOLUME]
        change[_VOLUME, _VOLUME] = 1.0
        by_rail[_VOLUME] = half[1] * by_rail[1]
        by_area[_VOLUME] = half[2] * by_area[2] + half[_AREA]
        area = lift * seat_area_slope(window.inputs[k, 1] * c.area_scale, c.seat_diameter, c.half_cone_angle)
        covariance = (
            change @ covariance @ change.T + np.outer(by_rail, by_rail) + area**2 * np.outer(by_area, by_area)
        )
        gradient[:_VOLUME] = run.gradient[k]
        rate[k] = gradient @ covariance @ gradient
        volume[k] = covariance[_VOLUME, _VOLUME]
        if window.inputs[k, 1] > 0.0 and window.inputs[k - 1, 1] <= 0.0:
            covariance[_VOLUME, :] = 0.0
            covariance[:, _VOLUME] = 0.0
