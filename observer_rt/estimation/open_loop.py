"""The observer x^ over an event, open loop: its injection rate with slopes, and what noise of inputs makes of it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.estimation.predictor import (
    NO_RATE,
    NO_SLOPES,
    Setting,
    Window,
    follow,
    forced_before,
)
from observer_rt.estimation.scalars import SCALARS, Learned, Scalars, by_theta, learned_of
from observer_rt.foundation.compiled import compiled, inner_separate
from observer_rt.foundation.small_arrays import copy_matrix, copy_vector, product, propagate
from observer_rt.model.borrowed import borrowed, borrowed_network, borrowed_tangent
from observer_rt.model.forcing import Clock, Forcing, borrowed_forcing, forcing_of
from observer_rt.model.hydraulics import Sac, Seat, empty_sac, seat_area_slope
from observer_rt.model.integrator import advance_over
from observer_rt.model.right_hand_side import (
    ByTheta,
    FlowSlopes,
    Tangent,
    flow_slopes,
    is_at_rest,
    tangent_of,
)
from observer_rt.model.sensor import lagged_slopes

DRAINING = 0.2e-3  # s, in which the sac is certainly empty behind a shut needle


class OpenLoop(NamedTuple):
    """x^ over a window of n samples: it follows x~ up to the opening, and runs open loop from there.

    rate: (n,) Q_H^ [m3/s]; slopes: (n, m) its derivatives with respect to theta; gradient: (n, states + 1)
    with respect to x and A_S [m3/s]; transition: (n, states, states) derivatives of x with respect to x one sample
    before; relaxation: (n,) rate [1/s] at which p_S goes where the needle leads it; by_area: (n,) dp_S/dA_S there,
    normalised by (24). All 0 where nothing flows.
    """

    rate: NDArray[np.float64]
    slopes: NDArray[np.float64]
    gradient: NDArray[np.float64]
    transition: NDArray[np.float64]
    relaxation: NDArray[np.float64]
    by_area: NDArray[np.float64]


def open_loop(
    window: Window, setting: Setting, theta: NDArray[np.float64], scalars: Scalars = SCALARS
) -> OpenLoop:
    """x^ with the parameters theta (m,) over a window, its sensitivities starting at 0 at the opening."""
    n, m, states = window.output.size, theta.size, setting.coefficients.states
    learned = learned_of(theta, setting.coefficients, scalars)
    result = OpenLoop(
        rate=np.zeros(n),
        slopes=np.zeros((n, m)),
        gradient=np.zeros((n, states + 1)),
        transition=np.zeros((n, states, states)),
        relaxation=np.zeros(n),
        by_area=np.zeros(n),
    )
    before = window.until(max(window.opening, 1))
    x = follow(before, setting, learned, window.opening, np.empty(n), NO_RATE, None, NO_SLOPES)
    by = by_theta(theta, setting.coefficients, scalars)
    tangent = tangent_of(learned.coefficients, learned.network, by, m + states)
    _run(window, setting, learned, x, tangent, result)
    return result


@compiled
def _run(
    window: Window,
    setting: Setting,
    learned: Learned,
    state: NDArray[np.float64],
    tangent: Tangent,
    result: OpenLoop,
) -> None:
    """Fill `result`, which holds zeros, from the opening on; state: one sample before, moved on with it."""
    first = max(window.opening, 1)
    clock = Clock(window.clock.time + (first - 1) * setting.interval, window.clock.injections)
    forcing = forcing_of(setting.program, clock, len(learned.coefficients.line))
    _run_from(first, window, setting, learned, state, tangent, result, forcing)


@inner_separate
def _run_from(
    first: int,
    window: Window,
    setting: Setting,
    learned: Learned,
    state: NDArray[np.float64],
    tangent: Tangent,
    result: OpenLoop,
    forcing: Forcing,
) -> None:
    """`_run`, on arrays that are lent to it: what it made itself would be freed before the loop."""
    states, m = state.shape[0], result.slopes.shape[1]
    x, tangent, forcing = borrowed(state), borrowed_tangent(tangent), borrowed_forcing(forcing)
    learned = Learned(borrowed_network(learned.network), learned.coefficients, learned.offset, learned.lag)
    unit = np.eye(states)
    last = window.output.shape[0] - 1
    while last > 0 and window.inputs[last, 1] <= 0.0:
        last -= 1
    drained = last + 1 + math.ceil(DRAINING / setting.interval)
    for k in range(first, min(drained, window.output.shape[0])):
        forced = forced_before(window, setting, learned, x, k, forcing)
        copy_matrix(unit, tangent.by[:, m : m + states])
        interval, c, network = forced.interval, forced.coefficients, forced.network
        advance_over(x, interval, forced.knot, c, network, tangent)
        if window.resting[k] and interval.end[1] <= 0.0:
            empty_sac(x, tangent)
        copy_matrix(tangent.by[:, m : m + states], result.transition[k])
        u = (interval.end[0], max(interval.end[1], 0.0))
        if is_at_rest(x, u):
            continue
        flows = flow_slopes(x, u, c, network, tangent.sigmas)
        _take_flows(flows, u[1], c.nozzle.flow, c.sac, tangent.theta, tangent.sigmas, tangent.by, result, k)


@inner_separate
def _take_flows(
    flows: FlowSlopes,
    area: float,
    nozzle_flow: float,
    sac: Sac,
    theta: ByTheta,
    sigmas: NDArray[np.float64],
    by: NDArray[np.float64],
    result: OpenLoop,
    k: int,
) -> None:
    """Sample k of `result` after its flows, their slopes and the state's, `by` (n, m); whichever line there is."""
    states = result.gradient.shape[1] - 1
    result.rate[k] = nozzle_flow * flows.q_h
    for i in range(3):
        result.gradient[k, i] = nozzle_flow * flows.h_x[i]
    result.gradient[k, states] = nozzle_flow * flows.h_area
    result.slopes[k, theta.nozzle_bias] = nozzle_flow * flows.h_change
    for neuron in range(sigmas.shape[0]):
        by_weight = nozzle_flow * flows.h_change * sigmas[neuron]
        result.slopes[k, theta.nozzle_weight + neuron] = by_weight
    result.slopes[k, theta.back_pressure] = nozzle_flow * flows.h_back_pressure
    result.slopes[k, theta.back_pressure + 1] = nozzle_flow * flows.h_back_pressure * area
    for j in range(result.slopes.shape[1]):
        for i in range(3):
            result.slopes[k, j] += result.gradient[k, i] * by[i, j]
    # the sac by itself: how its pressure's rate of change goes with that pressure, and with the area
    result.relaxation[k] = sac.a6 * flows.h_x[2] - sac.a5 * flows.s_x[2]
    if area > 0.0:
        by_area = sac.a5 * flows.s_area - sac.a6 * flows.h_area
        result.by_area[k] = by_area / result.relaxation[k]


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


@compiled
def _propagate(
    areas: NDArray[np.float64],
    opening: int,
    run: OpenLoop,
    interval: float,
    seat: Seat,
    start: tuple[float, float],
    rail: NDArray[np.float64],
    lift: float,
    rate: NDArray[np.float64],
    volume: NDArray[np.float64],
) -> None:
    """Covariance of [x, A_S, volume] from sample to sample, whichever line there is.

    areas: (n,) A_S; start: variances of x~_1 and x~_2; rail: sigma of the rail pressure's noise in x (states,); lift:
    sigma.

    x~ at the opening errs as the steady Kalman filter says: K R, as much in Q_L as in p_L, for the line hardly damped
    turns one into the other. Rail noise, linear between samples, is white to Q_L. The area reaches p_S with the lag
    of the sac.
    """
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
    for k in range(max(opening, 1), rate.shape[0]):
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
        opened = lift * seat_area_slope(areas[k], seat)
        propagate(change, covariance, moved, scratch)
        for i in range(states + 2):
            for j in range(states + 2):
                covariance[i, j] += by_rail[i] * by_rail[j] + opened**2 * by_area[i] * by_area[j]
        copy_vector(run.gradient[k], gradient[:end])
        for i in range(end):
            rate[k] += gradient[i] * product(covariance, gradient, i)
        volume[k] = covariance[end, end]
        if areas[k] > 0.0 and areas[k - 1] <= 0.0:
            covariance[end, :] = 0.0
            covariance[:, end] = 0.0
