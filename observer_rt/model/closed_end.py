"""The closed end of a staggered line (`line.wave`): its last cell and the sac, stepped together and implicitly.

p_L by the midpoint rule, p_S by backward Euler over each half step. So a sac of any volume will do; one that relaxes
far faster than the step is where its flows balance, its filling included.
"""

import math
from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from observer_rt.foundation.compiled import inlined, inner
from observer_rt.model.effective import Coefficients
from observer_rt.model.hydraulics import nozzle_law, nozzle_law_slopes, seat_law, seat_law_slopes
from observer_rt.model.line.lump import stiffness, stiffness_slopes
from observer_rt.model.line.wave import WaveLine
from observer_rt.model.network import Network, back_pressure_at, flow_changes_by_sac
from observer_rt.model.right_hand_side import Tangent, flow_slopes, is_at_rest

CLOSE = 1e-9  # of p_0: pressures this close solve the step at the closed end
MOST_ITERATIONS = 40
SPARE = 0.1  # of p_0, by which p_S may leave the range of the pressures round it


@inner
def move_end(
    x: NDArray[np.float64],
    u_mean: tuple[float, float],
    u_end: tuple[float, float],
    step: float,
    c: Coefficients,
    network: Network,
    tangent: Any,
) -> None:
    """The end cell's pressure and p_S a step [s] on, with the flow into the cell as it is.

    u_mean, u_end: inputs over the step and at its end.
    """
    half = 0.5 * step
    before = x[0]
    soft = stiffness(before, c.line)
    if is_at_rest(x, u_mean) and u_end[1] <= 0.0:
        middle = (before + half * soft * c.line.a1 * (x[1] - c.line.outflow)) / (
            1.0 + half * soft * c.line.leak
        )
        sac = 0.0
    else:
        middle, sac = _solve_end(x, u_mean, half, half * soft, c, network)
    if tangent is not None:
        _end_rows(tangent, x, (middle, x[1], sac), u_mean, half, half, c, network)
    x[0], x[2] = middle, sac
    _add_to_mean(x, step, tangent, c.line)
    if tangent is not None:
        _beyond_middle(tangent)
    x[0] = 2.0 * middle - before
    if is_at_rest(x, u_end):
        return
    _, sac = _solve_end(x, u_end, half, 0.0, c, network)
    if tangent is not None:
        _end_rows(tangent, x, (x[0], x[1], sac), u_end, half, 0.0, c, network)
    x[2] = sac


def _add_to_mean(x: Any, step: float, tangent: Any, line: Any) -> None:
    """The integral of p_L, where a line has it, a step [s] further; p_L is that in its middle."""


@overload(_add_to_mean, strict=False)
def _add_to_mean_compiled(x: Any, step: Any, tangent: Any, line: Any) -> Any:
    if not line.instance_class.averaged:
        return lambda x, step, tangent, line: None

    def add(x: Any, step: Any, tangent: Any, line: Any) -> None:
        x[-1] += step * x[0]
        if tangent is not None:
            for j in range(tangent.by.shape[1]):
                tangent.by[-1, j] += step * tangent.by[0, j]

    return add


@inner
def _solve_end(
    x: NDArray[np.float64],
    u: tuple[float, float],
    sac_step: float,
    line_step: float,
    c: Coefficients,
    network: Network,
) -> tuple[float, float]:
    """p_L and p_S after implicit steps [s] at the inputs u; a line_step of 0 leaves p_L where it is.

    Newton's method; phi's network counts by its slope along p_S only. A step out of the range in which p_S must lie
    goes half the way to its end instead.
    """
    line, seat, nozzle, sac = c.line, c.seat, c.nozzle, c.sac
    p_0, flow, s_0 = x[0], x[1], x[2]
    inflow = line.a1 * (flow - line.outflow)
    p, s = p_0, s_0
    lowest, highest = min(s_0, p_0, 0.0) - SPARE, max(s_0, p_0, 0.0) + SPARE
    back_pressure = back_pressure_at(u[1], network)
    for _ in range(MOST_ITERATIONS):
        nozzle_change, seat_change, by_sac_h, by_sac_s = flow_changes_by_sac((p, flow, s), u, network)
        through_nozzle = nozzle_law(s, u[1], back_pressure, nozzle)
        through_seat = seat_law(p, s, u[1], seat)
        q_h, q_s = through_nozzle * (1.0 + nozzle_change), through_seat * (1.0 + seat_change)
        h_s = nozzle_law_slopes(s, u[1], back_pressure, nozzle)[0] * (1.0 + nozzle_change)
        h_s += through_nozzle * by_sac_h
        s_p = seat_law_slopes(p, s, u[1], seat)[0] * (1.0 + seat_change)
        s_s = through_seat * by_sac_s - s_p
        line_error = (
            p - p_0 - line_step * (inflow - line.leak * p - line.a2_nozzle * q_h - line.a2_seat * q_s)
        )
        sac_error = s - s_0 - sac_step * (sac.a5 * q_s - sac.a6 * q_h)
        pp = 1.0 + line_step * (line.leak + line.a2_seat * s_p)
        ps = line_step * (line.a2_nozzle * h_s + line.a2_seat * s_s)
        sp = -sac_step * sac.a5 * s_p
        ss = 1.0 + sac_step * (sac.a6 * h_s - sac.a5 * s_s)
        whole = pp * ss - ps * sp
        by_p = (ps * sac_error - ss * line_error) / whole
        by_s = (sp * line_error - pp * sac_error) / whole
        if s + by_s < lowest:
            by_s = 0.5 * (lowest - s)
        elif s + by_s > highest:
            by_s = 0.5 * (highest - s)
        p += by_p
        s += by_s
        if math.fabs(by_p) + math.fabs(by_s) < CLOSE:
            break
    return p, s


@inner
def _end_rows(
    tangent: Tangent,
    x: NDArray[np.float64],
    solved: tuple[float, float, float],
    u: tuple[float, float],
    sac_step: float,
    line_step: float,
    c: Coefficients,
    network: Network,
) -> None:
    """Derivatives of p_L and p_S through the implicit steps [s] from x to `solved`, by implicit differentiation."""
    line, sac, by = c.line, c.sac, tangent.by
    theta = tangent.theta
    line_row, sac_row = tangent.moved[0], tangent.moved[1]
    p, flow, _ = solved
    soft = stiffness(x[0], line)
    rest = is_at_rest(solved, u) and x[2] == 0.0
    fill = line_step * soft
    q_h, q_s = 0.0, 0.0
    pp, ps, sp, ss = 1.0 + fill * line.leak, 0.0, 0.0, 1.0
    h_flow, s_flow = 0.0, 0.0
    for j in range(by.shape[1]):
        line_row[j] = by[0, j]
        sac_row[j] = by[2, j]
    if not rest:
        flows = flow_slopes(solved, u, c, network, tangent.sigmas)
        q_h, q_s = flows.q_h, flows.q_s
        h_flow, s_flow = flows.h_x[1], flows.s_x[1]
        pp += fill * (line.a2_nozzle * flows.h_x[0] + line.a2_seat * flows.s_x[0])
        ps = fill * (line.a2_nozzle * flows.h_x[2] + line.a2_seat * flows.s_x[2])
        sp = -sac_step * (sac.a5 * flows.s_x[0] - sac.a6 * flows.h_x[0])
        ss = 1.0 - sac_step * (sac.a5 * flows.s_x[2] - sac.a6 * flows.h_x[2])
        line_by_h, sac_by_h = -fill * line.a2_nozzle, -sac_step * sac.a6
        line_by_s, sac_by_s = -fill * line.a2_seat, sac_step * sac.a5
        _add_flow(line_row, sac_row, theta.nozzle_bias, line_by_h, sac_by_h, flows.h_change)
        for neuron in range(tangent.sigmas.shape[0]):
            by_weight = flows.h_change * tangent.sigmas[neuron]
            _add_flow(line_row, sac_row, theta.nozzle_weight + neuron, line_by_h, sac_by_h, by_weight)
        _add_flow(line_row, sac_row, theta.seat_bias, line_by_s, sac_by_s, flows.s_change)
        back = theta.back_pressure
        _add_flow(line_row, sac_row, back, line_by_h, sac_by_h, flows.h_back_pressure)
        _add_flow(line_row, sac_row, back + 1, line_by_h, sac_by_h, flows.h_back_pressure * u[1])
    if line_step > 0.0:
        inflow = flow - line.outflow
        net = line.a1 * inflow - line.leak * p - line.a2_nozzle * q_h - line.a2_seat * q_s
        by_pressure, by_air, by_slope = stiffness_slopes(x[0], line)
        by_coefficient = tangent.slopes.by_coefficient
        by_coefficient[0, _A1] = fill * inflow
        by_coefficient[0, _A2_NOZZLE] = -fill * q_h
        by_coefficient[0, _A2_SEAT] = -fill * q_s
        by_coefficient[0, _LEAK] = -fill * p
        by_coefficient[0, _AIR] = line_step * by_air * net
        by_coefficient[0, _STIFFNESS_SLOPE] = line_step * by_slope * net
        add_coefficients(tangent.moved, by_coefficient, theta, 0, 1)  # its first row is that of the line
        soften = line_step * by_pressure * net
        by_flow = fill * (line.a1 - line.a2_nozzle * h_flow - line.a2_seat * s_flow)
        for j in range(by.shape[1]):
            line_row[j] += soften * by[0, j] + by_flow * by[1, j]
    sac_by_flow = sac_step * (sac.a5 * s_flow - sac.a6 * h_flow)
    whole = pp * ss - ps * sp
    for j in range(by.shape[1]):
        of_sac = sac_row[j] + sac_by_flow * by[1, j]
        of_line = line_row[j]
        tangent.moved[2, j] = by[0, j]
        by[0, j] = (ss * of_line - ps * of_sac) / whole
        by[2, j] = (pp * of_sac - sp * of_line) / whole


@inlined
def _add_flow(
    line_row: NDArray[np.float64],
    sac_row: NDArray[np.float64],
    column: int,
    by_line: float,
    by_sac: float,
    change: float,
) -> None:
    """What a parameter that changes a flow does to both rows."""
    line_row[column] += by_line * change
    sac_row[column] += by_sac * change


@inner
def _beyond_middle(tangent: Tangent) -> None:
    """The derivatives of p_L from the middle of the step to its end; row 2 of `moved` holds those before it."""
    by, before = tangent.by, tangent.moved
    for j in range(by.shape[1]):
        by[0, j] = 2.0 * by[0, j] - before[2, j]


@inner
def add_coefficients(
    by: NDArray[np.float64], by_coefficient: NDArray[np.float64], theta: Any, first: int, last: int
) -> None:
    """What theta does to rows first .. last - 1 by the line's coefficients."""
    columns, coefficients, slopes = theta.line_columns, theta.line_coefficients, theta.line_slopes
    for k in range(slopes.shape[0]):
        for row in range(first, last):
            by[row, columns[k]] += by_coefficient[row, coefficients[k]] * slopes[k]


_A1, _A2_NOZZLE, _A2_SEAT, _LEAK, _AIR, _STIFFNESS_SLOPE = (
    WaveLine._fields.index(name) for name in ("a1", "a2_nozzle", "a2_seat", "leak", "air", "stiffness_slope")
)
