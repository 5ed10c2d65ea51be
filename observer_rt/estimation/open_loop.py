"""The observer x^ over an event, open loop, with the sensitivity of its injection rate."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.learned import Learned
from observer_rt.estimation.predictor import Setting, Window, correct
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter, advance_with_sensitivity
from observer_rt.estimation.sensor import lagged, recorded
from observer_rt.model.coefficients import with_line_terms
from observer_rt.model.flows import nozzle_law, nozzle_law_slopes
from observer_rt.model.network import activation, back_pressure_at
from observer_rt.model.right_hand_side import is_at_rest

DRAINING = 0.2e-3  # s, in which the sac is certainly empty behind a shut needle
_NOZZLE_BIAS = int(Parameter.NOZZLE_BIAS)
_NOZZLE_WEIGHT = int(Parameter.NOZZLE_WEIGHT)
_BACK_PRESSURE = int(Parameter.BACK_PRESSURE)


@njit(cache=True, nogil=True)
def rate_with_sensitivity(
    window: Window,
    setting: Setting,
    learned: Learned,
    rate: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """Injection rate Q_H^ [m3/s] (n,) of x^ over a window, and its derivatives (n, PARAMETERS).

    x^ follows x~ up to the opening, where its sensitivities start at 0, and runs open loop from there.
    """
    c = with_line_terms(setting.coefficients, learned.line)
    lag, offset = setting.lag + learned.lag, setting.offset + learned.offset
    network = learned.network
    x = (window.start[0], window.start[1], window.start[2])
    indicated = window.start[3]
    sensitivity = np.zeros((3, PARAMETERS))
    work = np.zeros((6, 3, PARAMETERS))
    rate[:] = 0.0
    slopes[:, :] = 0.0
    last = window.output.shape[0] - 1
    while last > 0 and window.inputs[last, 1] <= 0.0:
        last -= 1
    drained = last + 1 + math.ceil(DRAINING / setting.interval)
    for k in range(1, min(drained, window.output.shape[0])):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u = (window.inputs[k, 0], max(window.inputs[k, 1], 0.0))
        before = x[0]
        x = advance_with_sensitivity(
            x,
            u_start,
            (window.inputs[k, 0], window.inputs[k, 1]),
            setting.interval,
            setting.substeps,
            setting.coefficients,
            c,
            network,
            sensitivity,
            work,
        )
        if k < window.opening:
            indicated_before = indicated
            indicated = lagged(indicated, before, x[0], setting.interval, lag)
            innovation = window.output[k] - offset - recorded(indicated_before, indicated, setting.late)
            x = correct(x, innovation, setting.gain[0], setting.gain[1])
            indicated += setting.gain[2] * innovation
            sensitivity[:, :] = 0.0
        if window.resting[k]:
            x = (x[0], x[1], 0.0)
            sensitivity[2, :] = 0.0
        if is_at_rest(x, u):
            continue
        flow = nozzle_law(x[2], u[1], back_pressure_at(u[1], network), c)
        change = network.bias[0]
        h_1, h_2, h_3 = 0.0, 0.0, 0.0
        for neuron in range(network.hidden.shape[0]):
            sigma = activation(x, u, network.hidden, neuron)
            weight = network.output[0, neuron]
            change += weight * sigma
            bent = flow * weight * (1.0 - sigma * sigma)
            h_1 += bent * network.hidden[neuron, 0]
            h_2 += bent * network.hidden[neuron, 1]
            h_3 += bent * network.hidden[neuron, 2]
            slopes[k, _NOZZLE_WEIGHT + neuron] = c.nozzle_flow * flow * sigma
        slopes[k, _NOZZLE_BIAS] = c.nozzle_flow * flow
        by_sac, by_chamber = nozzle_law_slopes(x[2], u[1], back_pressure_at(u[1], network), c)
        h_3 += by_sac * (1.0 + change)
        by_chamber *= c.nozzle_flow * (1.0 + change)
        slopes[k, _BACK_PRESSURE] = by_chamber
        slopes[k, _BACK_PRESSURE + 1] = by_chamber * min(u[1], 1.0)
        rate[k] = c.nozzle_flow * flow * (1.0 + change)
        for j in range(PARAMETERS):
            slopes[k, j] += c.nozzle_flow * (
                h_1 * sensitivity[0, j] + h_2 * sensitivity[1, j] + h_3 * sensitivity[2, j]
            )
