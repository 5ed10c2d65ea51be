"""The state equations (25) with phi, composed from the elements, and their derivatives; any flow, any needle."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inlined, inner, inner_inlined
from observer_rt.foundation.small_arrays import whole_vectors
from observer_rt.model.effective import Coefficients
from observer_rt.model.hydraulics import nozzle_law, nozzle_law_slopes, sac_rate, seat_law, seat_law_slopes
from observer_rt.model.line.interface import Slopes, line_rates, line_slopes, no_slopes
from observer_rt.model.network import Network, activation, back_pressure_at, flow_changes


@inlined
def model_flows(x: Any, u: tuple[float, float], c: Coefficients) -> tuple[float, float]:
    """Normalised flows of the model alone: q_H of (23) through the nozzle, q_S of (21) through the seat."""
    return nozzle_law(x[2], u[1], 0.0, c.nozzle), seat_law(x[0], x[2], u[1], c.seat)


@inlined
def changed_flows(x: Any, u: tuple[float, float], c: Coefficients, network: Network) -> tuple[float, float]:
    """Normalised flows with phi: q_H through the nozzle, q_S through the seat."""
    nozzle_change, seat_change = flow_changes(x, u, network)
    q_h = nozzle_law(x[2], u[1], back_pressure_at(u[1], network), c.nozzle) * (1.0 + nozzle_change)
    q_s = seat_law(x[0], x[2], u[1], c.seat) * (1.0 + seat_change)
    return q_h, q_s


@inlined
def is_at_rest(x: Any, u: tuple[float, float]) -> bool:
    """Needle shut and sac at chamber pressure: no flow, so phi vanishes whatever the network says."""
    return u[1] <= 0.0 and x[2] == 0.0


@inlined
def right_hand_side(x: Any, u: tuple[float, float], c: Coefficients, network: Network) -> Any:
    """x' = f(x, u) + phi(x, u) of (25)-(26) [1/s], a tuple as x is.

    x = [p_L, Q_L, p_S, further states of the line], u = [p_R, A_S], normalised by (24). phi = G(x, u) N with G the
    nozzle and seat flows: the network changes q_H and q_S by the factors 1 + N_H and 1 + N_S.
    """
    q_h, q_s = 0.0, 0.0
    if not is_at_rest(x, u):
        q_h, q_s = changed_flows(x, u, c, network)
    line = line_rates(x, u[0], q_h, q_s, c.line)
    return (line[0], line[1], sac_rate(q_h, q_s, c.sac)) + line[2:]  # noqa: RUF005 - compiled code cannot unpack


@compiled
def fault_and_rate(
    x: Any, u: tuple[float, float], c: Coefficients, network: Network
) -> tuple[tuple[float, float, float], float]:
    """phi(x, u) = G(x, u) N of (2), (27), its three rows [1/s], and the injection rate Q_H^ [m3/s].

    Q_H^ is the model's nozzle flow plus what phi says of it. Nozzle form: Q_H,model - (V_L p0/K_L) phi_1; seat form:
    Q_H,model - (V_S p0/K_C) phi_3 - (V_L p0/K_L) phi_1. Both balances give Q_H,model (1 + N_H) when phi = G N, which
    is what is computed.
    """
    if is_at_rest(x, u):
        return (0.0, 0.0, 0.0), 0.0
    nozzle_flow, seat_flow = model_flows(x, u, c)
    q_h, q_s = changed_flows(x, u, c, network)
    d_q_h = q_h - nozzle_flow
    d_q_s = q_s - seat_flow
    line = c.line
    phi = (-line.a2_nozzle * d_q_h - line.a2_seat * d_q_s, 0.0, sac_rate(d_q_h, d_q_s, c.sac))
    return phi, float(c.nozzle.flow * q_h)


@compiled
def injection_rate(x: Any, u: tuple[float, float], c: Coefficients, network: Network) -> float:
    """Q_H^ of `fault_and_rate` [m3/s]."""
    if is_at_rest(x, u):
        return 0.0
    nozzle_flow, _ = changed_flows(x, u, c, network)
    return float(c.nozzle.flow * nozzle_flow)


class FlowSlopes(NamedTuple):
    """Flows with phi and their derivatives with respect to x_1..x_3, u_2, and what the network adds."""

    q_h: float
    q_s: float
    h_x: tuple[float, float, float]
    s_x: tuple[float, float, float]
    h_area: float
    s_area: float
    h_change: float  # by N_H: the flow without it
    s_change: float  # by N_S
    h_back_pressure: float


@inner_inlined
def flow_slopes(
    x: Any, u: tuple[float, float], c: Coefficients, network: Network, sigmas: NDArray[np.float64]
) -> FlowSlopes:
    """`changed_flows` with their derivatives; sigmas (q,) becomes the activations of the hidden neurons."""
    back_pressure = back_pressure_at(u[1], network)
    nozzle_flow = nozzle_law(x[2], u[1], back_pressure, c.nozzle)
    seat_flow = seat_law(x[0], x[2], u[1], c.seat)
    nozzle_change = network.bias[0]
    seat_change = network.bias[1]
    h_1, h_2, h_3, h_area, s_1, s_2, s_3, s_area = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
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
        h_area += to_nozzle * network.hidden[neuron, 4]
        s_1 += to_seat * network.hidden[neuron, 0]
        s_2 += to_seat * network.hidden[neuron, 1]
        s_3 += to_seat * network.hidden[neuron, 2]
        s_area += to_seat * network.hidden[neuron, 4]
    by_sac, by_chamber = nozzle_law_slopes(x[2], u[1], back_pressure, c.nozzle)
    by_chamber *= 1.0 + nozzle_change
    by_difference, by_area = seat_law_slopes(x[0], x[2], u[1], c.seat)
    by_difference *= 1.0 + seat_change
    return FlowSlopes(
        nozzle_flow * (1.0 + nozzle_change),
        seat_flow * (1.0 + seat_change),
        (h_1, h_2, h_3 + by_sac * (1.0 + nozzle_change)),
        (s_1 + by_difference, s_2, s_3 - by_difference),
        h_area + by_chamber * (c.nozzle.chamber_rise_with_seat + network.back_pressure[1]),
        s_area + by_area * (1.0 + seat_change),
        nozzle_flow,
        seat_flow,
        by_chamber,
    )


SAC = 2  # place of p_S in x
_NO_FLOW = FlowSlopes(0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0)


class ByTheta(NamedTuple):
    """How a parameter vector theta acts: the columns of the network's parameters, the slopes of the line's.

    line_slopes: d(coefficient)/d(theta) of every pair (line_coefficients, line_columns) that is not 0, all (k,);
    those of a column follow each other.
    """

    nozzle_bias: int
    nozzle_weight: int
    seat_bias: int
    back_pressure: int
    line_columns: NDArray[np.int64]
    line_coefficients: NDArray[np.int64]
    line_slopes: NDArray[np.float64]


class Tangent(NamedTuple):
    """Derivatives carried with a state: `by` (n, m), of n states by m numbers, theta first; the rest is scratch.

    Columns beyond those of theta are those of a change of the state: dx/dx(start), if the unit matrix at the start.
    m fills vectors: the last columns may be of nothing.
    """

    by: NDArray[np.float64]
    moved: NDArray[np.float64]  # (n, m)
    by_state: NDArray[np.float64]  # (4, n, n), of x' by x at the stages of a step
    by_number: NDArray[np.float64]  # (4, n, m), of x' by the numbers, x held
    slopes: Slopes
    sigmas: NDArray[np.float64]  # (q,)
    theta: ByTheta


def tangent_of(c: Coefficients, network: Network, theta: ByTheta, columns: int) -> Tangent:
    """A tangent of 0, at least so many columns wide."""
    n, m = c.states, whole_vectors(columns)
    return Tangent(
        np.zeros((n, m)),
        np.zeros((n, m)),
        np.zeros((4, n, n)),
        np.zeros((4, n, m)),
        no_slopes(c.line),
        np.zeros(network.hidden.shape[0]),
        theta,
    )


@inner_inlined
def tangent_rates(
    x: Any,
    u: tuple[float, float],
    c: Coefficients,
    network: Network,
    tangent: Tangent,
    by_state: NDArray[np.float64],
    by_number: NDArray[np.float64],
) -> Any:
    """x' = f + phi and its derivatives [1/s]: by_state (n, n), and by the tangent's numbers by_number (n, m).

    Of by_number, which holds 0 at first, only what may differ from 0 is written.
    """
    theta, sigmas = tangent.theta, tangent.sigmas
    by_flow, by_coefficient = tangent.slopes.by_flow, tangent.slopes.by_coefficient
    slopes = Slopes(by_state, tangent.slopes.by_rail, by_flow, by_coefficient)
    _clear(by_state)
    flows = _NO_FLOW
    if not is_at_rest(x, u):
        flows = flow_slopes(x, u, c, network, sigmas)
    q_h, q_s = flows.q_h, flows.q_s
    line_slopes(x, u[0], q_h, q_s, c.line, slopes)
    by_flow[SAC, 0], by_flow[SAC, 1] = -c.sac.a6, c.sac.a5
    for row in range(by_number.shape[0]):
        by_h, by_s = by_flow[row, 0], by_flow[row, 1]
        if by_h == 0.0 and by_s == 0.0:
            continue
        for i in range(3):
            by_state[row, i] += by_h * flows.h_x[i] + by_s * flows.s_x[i]
        by_number[row, theta.nozzle_bias] = by_h * flows.h_change
        for neuron in range(sigmas.shape[0]):
            by_number[row, theta.nozzle_weight + neuron] = by_h * flows.h_change * sigmas[neuron]
        by_number[row, theta.seat_bias] = by_s * flows.s_change
        by_number[row, theta.back_pressure] = by_h * flows.h_back_pressure
        by_number[row, theta.back_pressure + 1] = by_h * flows.h_back_pressure * u[1]
    columns, coefficients, by_theta = theta.line_columns, theta.line_coefficients, theta.line_slopes
    for row in range(by_number.shape[0]):
        if row == SAC:  # nothing of the line fills it
            continue
        total = 0.0
        for k in range(by_theta.shape[0]):
            total += by_coefficient[row, coefficients[k]] * by_theta[k]
            if k + 1 == by_theta.shape[0] or columns[k + 1] != columns[k]:
                by_number[row, columns[k]] = total
                total = 0.0
    line = line_rates(x, u[0], q_h, q_s, c.line)
    return (line[0], line[1], sac_rate(q_h, q_s, c.sac)) + line[2:]  # noqa: RUF005


@inner
def _clear(matrix: NDArray[np.float64]) -> None:
    for row in range(matrix.shape[0]):
        for i in range(matrix.shape[1]):
            matrix[row, i] = 0.0
