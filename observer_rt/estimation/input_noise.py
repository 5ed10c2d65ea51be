"""What the noise of the inputs makes of the open-loop injection rate: covariances along the trajectory."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.estimation.open_loop import OpenLoop
from observer_rt.estimation.predictor import Setting, Window
from observer_rt.foundation.compiled import compiled
from observer_rt.foundation.small_arrays import copy_matrix, copy_vector, product, propagate
from observer_rt.model.seat import seat_area_slope
from observer_rt.model.sensor import lagged_slopes


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
    pressure = setting.gain[0] * line_pressure**2
    _propagate(
        window,
        run,
        setting,
        (pressure, pressure / c.line.impedance**2),
        c.line.by_rail * (setting.interval * noise.rail_pressure / c.pressure_scale),
        noise.needle_lift / c.area_scale,
        result.rate,
        result.volume,
    )
    return result


@compiled
def _propagate(
    window: Window,
    run: OpenLoop,
    setting: Setting,
    start: tuple[float, float],
    rail: NDArray[np.float64],
    lift: float,
    rate: NDArray[np.float64],
    volume: NDArray[np.float64],
) -> None:
    """Covariance of [x, A_S, volume] from sample to sample.

    start: variances of x~_1 and x~_2; rail: sigma of the rail pressure's noise in x (states,); lift: sigma.

    x~ at the opening errs as the steady Kalman filter says: K R, as much in Q_L as in p_L, for the line hardly damped
    turns one into the other. Rail noise, linear between samples, is white to Q_L. The area reaches p_S with the lag
    of the sac.
    """
    c, interval = setting.coefficients, setting.interval
    states = rail.shape[0]
    area, end = (
        states,
        states + 1,
    )  # after x: the area's error at the sample, the volume [m3] since the opening
    covariance = np.zeros((states + 2, states + 2))
    covariance[0, 0], covariance[1, 1] = start
    change, moved, scratch = (
        np.zeros((states + 2, states + 2)),
        np.zeros((states + 2, states + 2)),
        np.zeros((states + 2, states + 2)),
    )
    by_rail, by_area, gradient = np.zeros(states + 2), np.zeros(states + 2), np.zeros(states + 2)
    copy_vector(rail, by_rail[:states])
    by_area[area] = 1.0
    for k in range(max(window.opening, 1), rate.shape[0]):
        if not run.transition[k].any():  # drained: x^ was followed no further
            volume[k:] = covariance[end, end]
            break
        relaxation = run.relaxation[k]
        by_start, by_end = 0.0, 0.0
        if relaxation > 0.0:
            _, by_start, by_end, _ = lagged_slopes(0.0, 0.0, 0.0, interval, 1.0 / relaxation)
        half = 0.5 * interval * run.gradient[k]
        copy_matrix(run.transition[k], change[:states, :states])
        change[2, area] = run.by_area[k] * by_start
        by_area[2] = run.by_area[k] * by_end
        for j in range(end):
            change[end, j] = 0.5 * interval * run.gradient[k - 1, j]
            for i in range(states):
                change[end, j] += half[i] * change[i, j]
        change[end, end] = 1.0
        by_rail[end] = half[:states] @ rail
        by_area[end] = half[2] * by_area[2] + half[area]
        opened = lift * seat_area_slope(window.inputs[k, 1], c.seat)
        propagate(change, covariance, moved, scratch)
        for i in range(states + 2):
            for j in range(states + 2):
                covariance[i, j] += by_rail[i] * by_rail[j] + opened**2 * by_area[i] * by_area[j]
        copy_vector(run.gradient[k], gradient[:end])
        for i in range(end):
            rate[k] += gradient[i] * product(covariance, gradient, i)
        volume[k] = covariance[end, end]
        if window.inputs[k, 1] > 0.0 and window.inputs[k - 1, 1] <= 0.0:
            covariance[end, :] = 0.0
            covariance[:, end] = 0.0
