"""The state equations (25) with phi, for every sign of flow and a closed needle."""

import math

from numba import njit

from observer_rt.model.coefficients import Coefficients
from observer_rt.model.flows import line_stiffness, nozzle_law
from observer_rt.model.laws import root
from observer_rt.model.network import Network, back_pressure_at, flow_changes


@njit(cache=True, nogil=True, inline="always")
def model_flows(
    x: tuple[float, float, float], u: tuple[float, float], c: Coefficients
) -> tuple[float, float]:
    """Normalised flows of the model alone: q_H of (23) through the nozzle, q_S of (21) through the seat."""
    return nozzle_law(x[2], u[1], 0.0, c), u[1] * root(x[0] - x[2], c.transition)


@njit(cache=True, nogil=True, inline="always")
def changed_flows(
    x: tuple[float, float, float], u: tuple[float, float], c: Coefficients, network: Network
) -> tuple[float, float]:
    """Normalised flows with phi: q_H through the nozzle, q_S through the seat."""
    nozzle_change, seat_change = flow_changes(x, u, network)
    q_h = nozzle_law(x[2], u[1], back_pressure_at(u[1], network), c) * (1.0 + nozzle_change)
    q_s = u[1] * root(x[0] - x[2], c.transition) * (1.0 + seat_change)
    return q_h, q_s


@njit(cache=True, nogil=True, inline="always")
def is_at_rest(x: tuple[float, float, float], u: tuple[float, float]) -> bool:
    """Needle shut and sac at chamber pressure: no flow, so phi vanishes whatever the network says."""
    return u[1] <= 0.0 and x[2] == 0.0


@njit(cache=True, nogil=True, inline="always")
def right_hand_side(
    x: tuple[float, float, float], u: tuple[float, float], c: Coefficients, network: Network
) -> tuple[float, float, float]:
    """x' = f(x, u) + phi(x, u) of (25)-(26) [1/s].

    x = [p_L, Q_L, p_S], u = [p_R, A_S], normalised by (24). phi = G(x, u) N with G the nozzle and seat flows:
    the network changes q_H and q_S by the factors 1 + N_H and 1 + N_S.
    """
    line_flow_rate = c.a3 * (u[0] - x[0]) - c.a4 * x[1] * math.fabs(x[1])
    if is_at_rest(x, u):
        return line_stiffness(x[0], c) * (c.a1 * x[1] - c.leak * x[0]), line_flow_rate, 0.0
    q_h, q_s = changed_flows(x, u, c, network)
    return (
        line_stiffness(x[0], c) * (c.a1 * x[1] - c.a2_nozzle * q_h - c.a2_seat * q_s - c.leak * x[0]),
        line_flow_rate,
        c.a5 * q_s - c.a6 * q_h,
    )


@njit(cache=True, nogil=True)
def fault(
    x: tuple[float, float, float], u: tuple[float, float], c: Coefficients, network: Network
) -> tuple[float, float, float]:
    """phi(x, u) = G(x, u) N of (2), (27), its three rows [1/s]."""
    if is_at_rest(x, u):
        return 0.0, 0.0, 0.0
    nozzle_flow, seat_flow = model_flows(x, u, c)
    q_h, q_s = changed_flows(x, u, c, network)
    d_q_h = q_h - nozzle_flow
    d_q_s = q_s - seat_flow
    return -c.a2_nozzle * d_q_h - c.a2_seat * d_q_s, 0.0, c.a5 * d_q_s - c.a6 * d_q_h


@njit(cache=True, nogil=True)
def injection_rate(
    x: tuple[float, float, float], u: tuple[float, float], c: Coefficients, network: Network
) -> float:
    """Injection rate Q_H^ [m3/s]: the model's nozzle flow plus what phi says of it.

    Nozzle form: Q_H,model - (V_L p0/K_L) phi_1; seat form: Q_H,model - (V_S p0/K_C) phi_3 - (V_L p0/K_L) phi_1.
    Both balances give Q_H,model (1 + N_H) when phi = G N, which is what is computed.
    """
    if is_at_rest(x, u):
        return 0.0
    nozzle_flow, _ = changed_flows(x, u, c, network)
    return float(c.nozzle_flow * nozzle_flow)
