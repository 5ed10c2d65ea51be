"""The observer x^ over an event, open loop, with the sensitivity of its injection rate."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.learned import Learned
from observer_rt.estimation.predictor import Setting, Window, follow, knot_before
from observer_rt.estimation.sensitivity import (
    PARAMETERS,
    Parameter,
    advance_over_with_sensitivity,
    rate_and_tangent,
)
from observer_rt.model.coefficients import with_line_terms
from observer_rt.model.flows import nozzle_law, nozzle_law_slopes
from observer_rt.model.network import activation, back_pressure_at, flow_changes
from observer_rt.model.right_hand_side import is_at_rest

DRAINING = 0.2e-3  # s, in which the sac is certainly empty behind a shut needle
_COLUMNS = PARAMETERS + 3  # of the sensitivity: by theta, and by the state one sample before
_NOZZLE_BIAS = int(Parameter.NOZZLE_BIAS)
_NOZZLE_WEIGHT = int(Parameter.NOZZLE_WEIGHT)
_SEAT_BIAS = int(Parameter.SEAT_BIAS)
_BACK_PRESSURE = int(Parameter.BACK_PRESSURE)


class OpenLoop(NamedTuple):
    """x^ over a window of n samples: it follows x~ up to the opening, and runs open loop from there.

    rate: (n,) Q_H^ [m3/s]; slopes: (n, PARAMETERS) its derivatives with respect to theta; gradient: (n, 4) with
    respect to x and A_S [m3/s]; transition: (n, 3, 3) derivatives of x with respect to x one sample before;
    relaxation: (n,) rate [1/s] at which p_S goes where the needle leads it; by_area: (n,) dp_S/dA_S there, normalised
    by (24). All 0 where nothing flows.
    """

    rate: NDArray[np.float64]
    slopes: NDArray[np.float64]
    gradient: NDArray[np.float64]
    transition: NDArray[np.float64]
    relaxation: NDArray[np.float64]
    by_area: NDArray[np.float64]


def open_loop(window: Window, setting: Setting, learned: Learned) -> OpenLoop:
    """x^ with the parameters `learned` over a window, its sensitivities starting at 0 at the opening."""
    n = window.output.shape[0]
    result = OpenLoop(
        rate=np.zeros(n),
        slopes=np.zeros((n, PARAMETERS)),
        gradient=np.zeros((n, 4)),
        transition=np.zeros((n, 3, 3)),
        relaxation=np.zeros(n),
        by_area=np.zeros(n),
    )
    x = follow(_before_opening(window), setting, learned, window.opening, np.empty(n), np.empty(0))
    _run(window, setting, learned, x, result)
    return result


def _before_opening(window: Window) -> Window:
    """The part of a window before its opening; at least its first sample."""
    end = max(window.opening, 1)
    return window._replace(
        inputs=window.inputs[:end], output=window.output[:end], resting=window.resting[:end]
    )


@njit(cache=True, nogil=True)
def _run(
    window: Window, setting: Setting, learned: Learned, x: tuple[float, float, float], result: OpenLoop
) -> None:
    """Fill `result`, which holds zeros, from the opening on; x: the state one sample before."""
    c = with_line_terms(setting.coefficients, learned.line)
    network = learned.network
    sensitivity = np.zeros((3, _COLUMNS))
    by_itself = np.zeros((3, _COLUMNS))
    by_itself[:, PARAMETERS:] = np.eye(3)
    work = np.zeros((6, 3, _COLUMNS))
    last = window.output.shape[0] - 1
    while last > 0 and window.inputs[last, 1] <= 0.0:
        last -= 1
    drained = last + 1 + math.ceil(DRAINING / setting.interval)
    for k in range(max(window.opening, 1), min(drained, window.output.shape[0])):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u = (window.inputs[k, 0], max(window.inputs[k, 1], 0.0))
        sensitivity[:, PARAMETERS:] = np.eye(3)
        x = advance_over_with_sensitivity(
            x,
            u_start,
            knot_before(window, k),
            (window.inputs[k, 0], window.inputs[k, 1]),
            setting.interval,
            setting.substeps,
            setting.coefficients,
            c,
            network,
            sensitivity,
            work,
        )
        if window.resting[k]:
            x = (x[0], x[1], 0.0)
            sensitivity[2, :] = 0.0
        result.transition[k] = sensitivity[:, PARAMETERS:]
        if is_at_rest(x, u):
            continue
        flow = nozzle_law(x[2], u[1], back_pressure_at(u[1], network), c)
        change = network.bias[0]
        h_1, h_2, h_3, h_area = 0.0, 0.0, 0.0, 0.0
        for neuron in range(network.hidden.shape[0]):
            sigma = activation(x, u, network.hidden, neuron)
            weight = network.output[0, neuron]
            change += weight * sigma
            bent = flow * weight * (1.0 - sigma * sigma)
            h_1 += bent * network.hidden[neuron, 0]
            h_2 += bent * network.hidden[neuron, 1]
            h_3 += bent * network.hidden[neuron, 2]
            h_area += bent * network.hidden[neuron, 4]
            result.slopes[k, _NOZZLE_WEIGHT + neuron] = c.nozzle_flow * flow * sigma
        result.slopes[k, _NOZZLE_BIAS] = c.nozzle_flow * flow
        by_sac, by_chamber = nozzle_law_slopes(x[2], u[1], back_pressure_at(u[1], network), c)
        h_3 += by_sac * (1.0 + change)
        by_chamber *= 1.0 + change
        if u[1] < 1.0:
            h_area += by_chamber * network.back_pressure[1]
        result.slopes[k, _BACK_PRESSURE] = c.nozzle_flow * by_chamber
        result.slopes[k, _BACK_PRESSURE + 1] = c.nozzle_flow * by_chamber * u[1]
        result.rate[k] = c.nozzle_flow * flow * (1.0 + change)
        for i, h in enumerate((h_1, h_2, h_3, h_area)):
            result.gradient[k, i] = c.nozzle_flow * h
        for j in range(PARAMETERS):
            for i in range(3):
                result.slopes[k, j] += result.gradient[k, i] * sensitivity[i, j]
        # the sac by itself: how its pressure's rate of change goes with that pressure, and with the area
        rate_and_tangent(x, u, setting.coefficients, c, network, by_itself, work[0], work[5, 0])
        result.relaxation[k] = -work[0, 2, PARAMETERS + 2]
        if u[1] > 0.0:
            inflow = work[0, 2, _SEAT_BIAS] * (1.0 + flow_changes(x, u, network)[1])
            result.by_area[k] = (inflow / u[1] - c.a6 * h_area) / result.relaxation[k]
