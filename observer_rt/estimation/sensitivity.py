"""How state and flows move with named parameters: the tangent of the right-hand side, through RK4."""

from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.model.coefficients import Coefficients
from observer_rt.model.integrator import along, between, steps_in
from observer_rt.model.laws import root, root_slope
from observer_rt.model.network import HIDDEN, Network, activation, flow_changes
from observer_rt.model.right_hand_side import is_at_rest, right_hand_side


class Parameter(IntEnum):
    """Columns of every sensitivity and of the parameter vector theta."""

    NOZZLE_BIAS = 0  # b_H
    NOZZLE_WEIGHT = 1  # w_1; w_2 .. w_q follow
    SEAT_BIAS = 1 + HIDDEN  # b_S
    LINE_PRESSURE_OFFSET = 2 + HIDDEN  # o, in units of p_0; acts in the sensor only


PARAMETERS = 3 + HIDDEN
_NOZZLE_BIAS = int(Parameter.NOZZLE_BIAS)
_NOZZLE_WEIGHT = int(Parameter.NOZZLE_WEIGHT)
_SEAT_BIAS = int(Parameter.SEAT_BIAS)


@njit(cache=True, nogil=True)
def tangent(
    x: tuple[float, float, float],
    u: tuple[float, float],
    c: Coefficients,
    network: Network,
    direction: NDArray[np.float64],
    rate: NDArray[np.float64],
) -> None:
    """Derivative of f + phi along state directions and parameters, into `rate`.

    direction, rate: (3, PARAMETERS); column j of `direction` is dx/dtheta_j, of `rate` d(x')/dtheta_j [1/s].
    """
    friction_slope = 2.0 * c.a4 * abs(x[1])
    if is_at_rest(x, u):
        for j in range(PARAMETERS):
            rate[0, j] = c.a1 * direction[1, j]
            rate[1, j] = -c.a3 * direction[0, j] - friction_slope * direction[1, j]
            rate[2, j] = 0.0
        return
    nozzle_flow = root(x[2], c.transition)
    nozzle_slope = root_slope(x[2], c.transition)
    seat_flow = u[1] * root(x[0] - x[2], c.transition)
    seat_slope = u[1] * root_slope(x[0] - x[2], c.transition)
    nozzle_change, seat_change = flow_changes(x, u, network)
    # dq_H/dx and dq_S/dx, with the network's own dependence on the state
    h_1, h_2, h_3 = 0.0, 0.0, nozzle_slope * (1.0 + nozzle_change)
    s_1, s_2, s_3 = seat_slope * (1.0 + seat_change), 0.0, -seat_slope * (1.0 + seat_change)
    for neuron in range(network.hidden.shape[0]):
        sigma = activation(x, u, network.hidden, neuron)
        bend = 1.0 - sigma * sigma
        to_nozzle = nozzle_flow * network.output[0, neuron] * bend
        to_seat = seat_flow * network.output[1, neuron] * bend
        h_1 += to_nozzle * network.hidden[neuron, 0]
        h_2 += to_nozzle * network.hidden[neuron, 1]
        h_3 += to_nozzle * network.hidden[neuron, 2]
        s_1 += to_seat * network.hidden[neuron, 0]
        s_2 += to_seat * network.hidden[neuron, 1]
        s_3 += to_seat * network.hidden[neuron, 2]
        rate[2, _NOZZLE_WEIGHT + neuron] = nozzle_flow * sigma  # explicit part of dq_H, completed below
    for j in range(PARAMETERS):
        d_1, d_2, d_3 = direction[0, j], direction[1, j], direction[2, j]
        d_q_h = h_1 * d_1 + h_2 * d_2 + h_3 * d_3
        d_q_s = s_1 * d_1 + s_2 * d_2 + s_3 * d_3
        if j == _NOZZLE_BIAS:
            d_q_h += nozzle_flow
        elif j == _SEAT_BIAS:
            d_q_s += seat_flow
        elif _NOZZLE_WEIGHT <= j < _SEAT_BIAS:
            d_q_h += rate[2, j]
        rate[0, j] = c.a1 * d_2 - c.a2_nozzle * d_q_h - c.a2_seat * d_q_s
        rate[1, j] = -c.a3 * d_1 - friction_slope * d_2
        rate[2, j] = c.a5 * d_q_s - c.a6 * d_q_h


@njit(cache=True, nogil=True)
def advance_with_sensitivity(
    x: tuple[float, float, float],
    u_start: tuple[float, float],
    u_end: tuple[float, float],
    interval: float,
    substeps: int,
    c: Coefficients,
    network: Network,
    sensitivity: NDArray[np.float64],
    work: NDArray[np.float64],
) -> tuple[float, float, float]:
    """`integrator.advance`, carrying dx/dtheta with it: the exact derivative of the RK4 step.

    sensitivity: (3, PARAMETERS), updated in place; work: (5, 3, PARAMETERS) scratch.
    """
    steps = steps_in(x, u_start, u_end, interval, substeps, c)
    step = interval / steps
    k_1, k_2, k_3, k_4, moved = work[0], work[1], work[2], work[3], work[4]
    for i in range(steps):
        u_0 = between(u_start, u_end, i / steps)
        u_mid = between(u_start, u_end, (i + 0.5) / steps)
        u_1 = between(u_start, u_end, (i + 1.0) / steps)
        rate_1 = right_hand_side(x, u_0, c, network)
        tangent(x, u_0, c, network, sensitivity, k_1)
        x_2 = along(x, 0.5 * step, rate_1)
        rate_2 = right_hand_side(x_2, u_mid, c, network)
        _move(sensitivity, 0.5 * step, k_1, moved)
        tangent(x_2, u_mid, c, network, moved, k_2)
        x_3 = along(x, 0.5 * step, rate_2)
        rate_3 = right_hand_side(x_3, u_mid, c, network)
        _move(sensitivity, 0.5 * step, k_2, moved)
        tangent(x_3, u_mid, c, network, moved, k_3)
        x_4 = along(x, step, rate_3)
        rate_4 = right_hand_side(x_4, u_1, c, network)
        _move(sensitivity, step, k_3, moved)
        tangent(x_4, u_1, c, network, moved, k_4)
        sixth = step / 6.0
        x = (
            x[0] + sixth * (rate_1[0] + 2.0 * (rate_2[0] + rate_3[0]) + rate_4[0]),
            x[1] + sixth * (rate_1[1] + 2.0 * (rate_2[1] + rate_3[1]) + rate_4[1]),
            x[2] + sixth * (rate_1[2] + 2.0 * (rate_2[2] + rate_3[2]) + rate_4[2]),
        )
        for row in range(3):
            for j in range(PARAMETERS):
                sensitivity[row, j] += sixth * (k_1[row, j] + 2.0 * (k_2[row, j] + k_3[row, j]) + k_4[row, j])
    return x


@njit(cache=True, nogil=True)
def _move(
    start: NDArray[np.float64], step: float, rate: NDArray[np.float64], result: NDArray[np.float64]
) -> None:
    for row in range(3):
        for j in range(PARAMETERS):
            result[row, j] = start[row, j] + step * rate[row, j]
