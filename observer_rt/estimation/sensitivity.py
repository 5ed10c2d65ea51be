"""How the state moves with named parameters: the tangent of the right-hand side, through RK4."""

import math
from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.model.coefficients import Coefficients
from observer_rt.model.flows import line_stiffness, line_stiffness_slopes, nozzle_law, nozzle_law_slopes
from observer_rt.model.integrator import along, at_knot, between, emptied, is_bent, step_end, steps_in
from observer_rt.model.laws import root, root_slope
from observer_rt.model.network import HIDDEN, Network, activation, back_pressure_at
from observer_rt.model.right_hand_side import is_at_rest


class Parameter(IntEnum):
    """Columns of every sensitivity and of the parameter vector theta."""

    NOZZLE_BIAS = 0  # b_H
    NOZZLE_WEIGHT = 1  # w_1; w_2 .. w_q follow
    SEAT_BIAS = 1 + HIDDEN  # b_S
    LINE_PRESSURE_OFFSET = 2 + HIDDEN  # o, in units of p_0; acts in the sensor only
    LINE_FRICTION = 3 + HIDDEN  # k
    GUIDE_LEAKAGE = 4 + HIDDEN  # c p_0 / Q_0
    BULK_MODULUS = 5 + HIDDEN  # r
    SENSOR_LAG = 6 + HIDDEN  # tau, in units of LAG_UNIT; acts in the sensor only
    ENTRAINED_AIR = 7 + HIDDEN  # K g / p_0
    BACK_PRESSURE = 8 + HIDDEN  # rise of p_C while injecting, in units of p_0; with the seat area follows


PARAMETERS = 10 + HIDDEN
_NOZZLE_BIAS = int(Parameter.NOZZLE_BIAS)
_NOZZLE_WEIGHT = int(Parameter.NOZZLE_WEIGHT)
_SEAT_BIAS = int(Parameter.SEAT_BIAS)
_FRICTION = int(Parameter.LINE_FRICTION)
_LEAKAGE = int(Parameter.GUIDE_LEAKAGE)
_STIFFNESS = int(Parameter.BULK_MODULUS)
_AIR = int(Parameter.ENTRAINED_AIR)
_BACK_PRESSURE = int(Parameter.BACK_PRESSURE)


@njit(cache=True, nogil=True)
def rate_and_tangent(
    x: tuple[float, float, float],
    u: tuple[float, float],
    nominal: Coefficients,
    c: Coefficients,
    network: Network,
    direction: NDArray[np.float64],
    rate: NDArray[np.float64],
    sigmas: NDArray[np.float64],
) -> tuple[float, float, float]:
    """x' = f + phi, and its derivative along state directions and parameters, into `rate`.

    direction, rate: (3, PARAMETERS) or wider; column j of `direction` is dx/dtheta_j, of `rate` d(x')/dtheta_j
    [1/s]; the columns beyond are those of a change of the state alone.
    c: coefficients with the line terms in force, `nominal` without them; sigmas: (q,) scratch.
    """
    friction_slope = 2.0 * c.a4 * math.fabs(x[1])
    friction = x[1] * math.fabs(x[1])
    second = c.a3 * (u[0] - x[0]) - c.a4 * x[1] * math.fabs(x[1])
    stiffer = c.a1 / nominal.a1
    soft = line_stiffness(x[0], c)
    soft_x, soft_air = line_stiffness_slopes(x[0], c)
    if is_at_rest(x, u):
        inflow = c.a1 * x[1] - c.leak * x[0]
        by_pressure = soft_x * inflow - soft * c.leak
        for j in range(direction.shape[1]):
            rate[0, j] = soft * c.a1 * direction[1, j] + by_pressure * direction[0, j]
            rate[1, j] = -c.a3 * direction[0, j] - friction_slope * direction[1, j]
            rate[2, j] = 0.0
        rate[0, _LEAKAGE] -= soft * c.a1 * x[0]
        rate[0, _STIFFNESS] += soft * inflow / stiffer
        rate[0, _AIR] += soft_air * inflow
        rate[1, _FRICTION] -= nominal.a4 * friction
        return soft * inflow, second, 0.0
    nozzle_flow = nozzle_law(x[2], u[1], back_pressure_at(u[1], network), c)
    seat_flow = u[1] * root(x[0] - x[2], c.transition)
    nozzle_change = network.bias[0]
    seat_change = network.bias[1]
    # dq_H/dx and dq_S/dx: of the network first, of the orifice laws below
    h_1, h_2, h_3, s_1, s_2, s_3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for neuron in range(network.hidden.shape[0]):
        sigma = activation(x, u, network.hidden, neuron)
        sigmas[neuron] = sigma
        nozzle_change += network.output[0, neuron] * sigma
        seat_change += network.output[1, neuron] * sigma
        bend = 1.0 - sigma * sigma
        to_nozzle = nozzle_flow * network.output[0, neuron] * bend
        to_seat = seat_flow * network.output[1, neuron] * bend
        h_1 += to_nozzle * network.hidden[neuron, 0]
        h_2 += to_nozzle * network.hidden[neuron, 1]
        h_3 += to_nozzle * network.hidden[neuron, 2]
        s_1 += to_seat * network.hidden[neuron, 0]
        s_2 += to_seat * network.hidden[neuron, 1]
        s_3 += to_seat * network.hidden[neuron, 2]
    seat_slope = u[1] * root_slope(x[0] - x[2], c.transition) * (1.0 + seat_change)
    by_sac, by_chamber = nozzle_law_slopes(x[2], u[1], back_pressure_at(u[1], network), c)
    h_3 += by_sac * (1.0 + nozzle_change)
    s_1 += seat_slope
    s_3 -= seat_slope
    q_h = nozzle_flow * (1.0 + nozzle_change)
    q_s = seat_flow * (1.0 + seat_change)
    inflow = c.a1 * x[1] - c.a2_nozzle * q_h - c.a2_seat * q_s - c.leak * x[0]
    # the rows of the Jacobian df/dx
    j_11 = soft * (-c.a2_nozzle * h_1 - c.a2_seat * s_1 - c.leak) + soft_x * inflow
    j_12 = soft * (c.a1 - c.a2_nozzle * h_2 - c.a2_seat * s_2)
    j_13 = soft * (-c.a2_nozzle * h_3 - c.a2_seat * s_3)
    j_31 = c.a5 * s_1 - c.a6 * h_1
    j_32 = c.a5 * s_2 - c.a6 * h_2
    j_33 = c.a5 * s_3 - c.a6 * h_3
    for j in range(direction.shape[1]):
        d_1, d_2, d_3 = direction[0, j], direction[1, j], direction[2, j]
        rate[0, j] = j_11 * d_1 + j_12 * d_2 + j_13 * d_3
        rate[1, j] = -c.a3 * d_1 - friction_slope * d_2
        rate[2, j] = j_31 * d_1 + j_32 * d_2 + j_33 * d_3
    rate[0, _NOZZLE_BIAS] -= soft * c.a2_nozzle * nozzle_flow
    rate[2, _NOZZLE_BIAS] -= c.a6 * nozzle_flow
    for neuron in range(network.hidden.shape[0]):
        rate[0, _NOZZLE_WEIGHT + neuron] -= soft * c.a2_nozzle * nozzle_flow * sigmas[neuron]
        rate[2, _NOZZLE_WEIGHT + neuron] -= c.a6 * nozzle_flow * sigmas[neuron]
    for j, share in enumerate((1.0, u[1])):
        by_back_pressure = by_chamber * (1.0 + nozzle_change) * share
        rate[0, _BACK_PRESSURE + j] -= soft * c.a2_nozzle * by_back_pressure
        rate[2, _BACK_PRESSURE + j] -= c.a6 * by_back_pressure
    rate[0, _SEAT_BIAS] -= soft * c.a2_seat * seat_flow
    rate[2, _SEAT_BIAS] += c.a5 * seat_flow
    rate[0, _LEAKAGE] -= soft * c.a1 * x[0]
    rate[0, _STIFFNESS] += soft * inflow / stiffer
    rate[0, _AIR] += soft_air * inflow
    rate[1, _FRICTION] -= nominal.a4 * friction
    return soft * inflow, second, c.a5 * q_s - c.a6 * q_h


@njit(cache=True, nogil=True)
def advance_with_sensitivity(
    x: tuple[float, float, float],
    u_start: tuple[float, float],
    u_end: tuple[float, float],
    interval: float,
    substeps: int,
    nominal: Coefficients,
    c: Coefficients,
    network: Network,
    sensitivity: NDArray[np.float64],
    work: NDArray[np.float64],
) -> tuple[float, float, float]:
    """`integrator.advance`, carrying dx/dtheta with it: the exact derivative of the RK4 step.

    sensitivity: (3, PARAMETERS) or wider, updated in place; work: (6, 3, as wide) scratch. Columns beyond those of
    the parameters are carried as changes of the state: dx/dx(start) if they are the unit matrix at the start.
    """
    steps = steps_in(x, u_start, u_end, interval, substeps, c)
    step = interval / steps
    sixth = step / 6.0
    k_1, k_2, k_3, k_4, moved, sigmas = work[0], work[1], work[2], work[3], work[4], work[5, 0]
    for i in range(steps):
        u_0 = between(u_start, u_end, i / steps)
        u_mid = between(u_start, u_end, (i + 0.5) / steps)
        u_1 = between(u_start, u_end, (i + 1.0) / steps)
        r_1 = rate_and_tangent(x, u_0, nominal, c, network, sensitivity, k_1, sigmas)
        _move(sensitivity, 0.5 * step, k_1, moved)
        r_2 = rate_and_tangent(along(x, 0.5 * step, r_1), u_mid, nominal, c, network, moved, k_2, sigmas)
        _move(sensitivity, 0.5 * step, k_2, moved)
        r_3 = rate_and_tangent(along(x, 0.5 * step, r_2), u_mid, nominal, c, network, moved, k_3, sigmas)
        _move(sensitivity, step, k_3, moved)
        r_4 = rate_and_tangent(along(x, step, r_3), u_1, nominal, c, network, moved, k_4, sigmas)
        x = step_end(x, step, r_1, r_2, r_3, r_4)
        for row in range(3):
            for j in range(sensitivity.shape[1]):
                sensitivity[row, j] += sixth * (k_1[row, j] + 2.0 * (k_2[row, j] + k_3[row, j]) + k_4[row, j])
    x = emptied(x, u_start, u_end)
    if x[2] == 0.0 and u_end[1] <= 0.0:
        sensitivity[2, :] = 0.0
    return x


@njit(cache=True, nogil=True)
def advance_over_with_sensitivity(
    x: tuple[float, float, float],
    u_start: tuple[float, float],
    knot: tuple[float, float],
    u_end: tuple[float, float],
    interval: float,
    substeps: int,
    nominal: Coefficients,
    c: Coefficients,
    network: Network,
    sensitivity: NDArray[np.float64],
    work: NDArray[np.float64],
) -> tuple[float, float, float]:
    """`integrator.advance_over`, carrying dx/dtheta with it as `advance_with_sensitivity` does."""
    share, u_knot = 1.0, u_end
    if is_bent(u_start, knot, u_end):
        share, u_knot = knot[0], at_knot(u_start, knot, u_end)
    steps = math.ceil(share * substeps)
    x = advance_with_sensitivity(
        x, u_start, u_knot, share * interval, steps, nominal, c, network, sensitivity, work
    )
    if share == 1.0:
        return x
    rest = 1.0 - share
    steps = math.ceil(rest * substeps)
    beyond: tuple[float, float, float] = advance_with_sensitivity(
        x, u_knot, u_end, rest * interval, steps, nominal, c, network, sensitivity, work
    )
    return beyond


@njit(cache=True, nogil=True)
def _move(
    start: NDArray[np.float64], step: float, rate: NDArray[np.float64], result: NDArray[np.float64]
) -> None:
    for row in range(3):
        for j in range(start.shape[1]):
            result[row, j] = start[row, j] + step * rate[row, j]
