"""The injector on a line whose pressures and flows are staggered (`line.wave`), over a sample interval.

Flows and pressures of the line take turns, explicitly; its end and the sac are stepped by `closed_end`.

The line's wall friction that remembers how the flow changed (`line.wave`): what it does to all flows in a step.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import inlined, inner, inner_separate
from observer_rt.model.closed_end import add_coefficients, move_end
from observer_rt.model.effective import Coefficients
from observer_rt.model.line.interface import OwnStep, step_by
from observer_rt.model.line.lump import stiffness, stiffness_slopes
from observer_rt.model.line.wave import (
    MEMORIES,
    WaveLine,
    across_joint,
    across_joint_slopes,
    before_at,
    cells_of,
    fading,
    flow_at,
    memory_at,
    pressure_at,
    pull_in_middle,
    steps_over,
)
from observer_rt.model.network import Network

_CHANGE, BEFORE = 2, 3  # rows of a tangent's scratch, of which the flows' take 0 and 1


@inner
def mean_flow(x: NDArray[np.float64], cells: int) -> float:
    total = 0.0
    for i in range(1, cells + 1):
        total += x[flow_at(i, cells)]
    return total / cells


@inner
def mean_flow_row(by: NDArray[np.float64], cells: int, rows: NDArray[np.float64], row: int) -> None:
    """The derivatives of the mean flow into a row."""
    for j in range(by.shape[1]):
        rows[row, j] = 0.0
    for i in range(1, cells + 1):
        place = flow_at(i, cells)
        for j in range(by.shape[1]):
            rows[row, j] += by[place, j] / cells


@inner
def drag(
    x: NDArray[np.float64], cells: int, mean_before: float, step: float, memory: float, tangent: Any
) -> None:
    """What friction that remembers does to all flows in a step [s], by the mean in its middle; what it remembers."""
    change, pull, by_change = mean_flow(x, cells) - mean_before, 0.0, 0.0
    for k in range(MEMORIES):
        by_memory, by_flow = pull_in_middle(k, step, memory)
        pull += by_memory * x[memory_at(k, cells)]
        by_change += by_flow
    push = step / (1.0 + step * by_change)
    shift = -push * (pull + by_change * change)
    if tangent is not None:
        _drag_rows(tangent.by, tangent.moved, cells, step, memory)
    for i in range(1, cells + 1):
        x[flow_at(i, cells)] += shift
    for k in range(MEMORIES):
        keep, take = fading(k, step)
        x[memory_at(k, cells)] = keep * x[memory_at(k, cells)] + take * (change + shift)


@inner
def _drag_rows(
    by: NDArray[np.float64], scratch: NDArray[np.float64], cells: int, step: float, memory: float
) -> None:
    """The derivatives of what `drag` does; row BEFORE of `scratch` holds those of the mean flow before the step."""
    mean_flow_row(by, cells, scratch, _CHANGE)
    by_change = 0.0
    for j in range(by.shape[1]):
        scratch[_CHANGE, j] -= scratch[BEFORE, j]
        scratch[BEFORE, j] = 0.0  # from here on that of the pull
    for k in range(MEMORIES):
        by_memory, by_flow = pull_in_middle(k, step, memory)
        by_change += by_flow
        for j in range(by.shape[1]):
            scratch[BEFORE, j] += by_memory * by[memory_at(k, cells), j]
    push = step / (1.0 + step * by_change)
    for j in range(by.shape[1]):
        shift = -push * (scratch[BEFORE, j] + by_change * scratch[_CHANGE, j])
        scratch[_CHANGE, j] += shift
        for i in range(1, cells + 1):
            by[flow_at(i, cells), j] += shift
    for k in range(MEMORIES):
        place, (keep, take) = memory_at(k, cells), fading(k, step)
        for j in range(by.shape[1]):
            by[place, j] = keep * by[place, j] + take * scratch[_CHANGE, j]


@inner
def open_area(interval: Any, knot: tuple[float, float], first: float, last: float) -> tuple[float, float]:
    """Normalised seat area of a part (shares first to last) of an interval: its mean, and that at its end."""
    start, end = interval.start[1], interval.end[1]
    share = knot[0]
    if start <= 0.0 and end <= 0.0 and not (0.0 < share < 1.0 and knot[1] > 0.0):
        return 0.0, 0.0
    if not 0.0 < share < 1.0:
        at_first = start + first * (end - start)
        at_last = start + last * (end - start)
        return _mean_of_open(at_first, at_last), max(at_last, 0.0)
    at_first = _bent(start, knot, end, first)
    at_last = _bent(start, knot, end, last)
    if first < share < last:
        before = (share - first) / (last - first)
        mean = before * _mean_of_open(at_first, knot[1]) + (1.0 - before) * _mean_of_open(knot[1], at_last)
        return mean, max(at_last, 0.0)
    return _mean_of_open(at_first, at_last), max(at_last, 0.0)


@inner
def _bent(start: float, knot: tuple[float, float], end: float, share: float) -> float:
    """Area at a share of an interval that bends at a knot."""
    if share <= knot[0]:
        return start + share / knot[0] * (knot[1] - start)
    return knot[1] + (share - knot[0]) / (1.0 - knot[0]) * (end - knot[1])


@inlined
def _mean_of_open(first: float, last: float) -> float:
    """Mean of max(area, 0) where the area goes straight from one to the other."""
    if first >= 0.0 and last >= 0.0:
        return 0.5 * (first + last)
    if first <= 0.0 and last <= 0.0:
        return 0.0
    highest = max(first, last)
    return 0.5 * highest * highest / abs(last - first)


@inner_separate
def leapfrog(
    x: NDArray[np.float64],
    interval: Any,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
    tangent: Any,
) -> None:
    """`integrator.advance_over` of a line of cells."""
    steps = steps_over(interval.length)
    ends = max(1, interval.substeps // steps)
    step = interval.length / steps
    part = 1.0 / (steps * ends)
    rail_start, rail_rise = interval.start[0], interval.end[0] - interval.start[0]
    for i in range(steps):
        rail = rail_start + i / steps * rail_rise
        move_line(x, rail, step, c.line, tangent)
        for j in range(ends):
            first = i / steps + j * part
            mean, last = open_area(interval, knot, first, first + part)
            move_end(x, (rail, mean), (rail, last), step / ends, c, network, tangent)


@inner
def move_line(x: NDArray[np.float64], rail: float, step: float, line: WaveLine, tangent: Any) -> None:
    """All flows a step [s] on, then all pressures but that of the end cell."""
    cells = cells_of(x)
    mean_before = mean_flow(x, cells) if line.memory > 0.0 else 0.0
    if tangent is not None and line.memory > 0.0:
        mean_flow_row(tangent.by, cells, tangent.moved, BEFORE)
    ahead_flow, ahead_pressure, loss = x[flow_at(1, cells)], rail, line.loss / cells
    for i in range(1, cells + 1):
        place, here = flow_at(i, cells), pressure_at(i, cells)
        behind = flow_at(min(i + 1, cells), cells)
        flow, pressure, drop = x[place], x[here], ahead_pressure - loss - x[here]
        inertia = across_joint(line.joint - (i - 1), line.a3, line.a3_near)
        uneven = ahead_flow - 2.0 * flow + x[behind]
        resistance = line.a4 + (line.a4_inlet if i == 1 else 0.0)
        # friction by the product of old and new flow: with the old flow's alone, half a step late, it would pass for
        # inertance, which is the level of all masses
        slowed = 1.0 / (1.0 + step * resistance * math.fabs(flow))
        new_flow = slowed * (flow + step * (inertia * drop + line.damping * uneven))
        if tangent is not None:
            friction = step * resistance * math.copysign(1.0, flow)
            keep = slowed * (1.0 - 2.0 * step * line.damping - friction * new_flow)
            push = slowed * step
            there = -1 if i == 1 else pressure_at(i - 1, cells)
            _flow_row(
                tangent.by,
                tangent.moved,
                place,
                there,
                here,
                behind,
                keep,
                push * line.damping,
                push * inertia,
            )
            by_coefficient = tangent.slopes.by_coefficient
            far, near = across_joint_slopes(line.joint - (i - 1), line.a3, line.a3_near)
            by_coefficient[place, _A3] = push * far * drop
            by_coefficient[place, _A3_NEAR] = push * near * drop
            by_coefficient[place, _A4] = -push * math.fabs(flow) * new_flow
            by_coefficient[place, _DAMPING] = push * uneven
        x[place] = new_flow
        ahead_flow, ahead_pressure = flow, pressure
    _stress_end(x, cells, line, tangent)
    if tangent is not None:
        add_coefficients(tangent.by, tangent.slopes.by_coefficient, tangent.theta, cells + 2, 2 * cells + 1)
        add_coefficients(tangent.by, tangent.slopes.by_coefficient, tangent.theta, 1, 2)
    if line.memory > 0.0:
        drag(x, cells, mean_before, step, line.memory, tangent)
    for i in range(1, cells):
        place, inflow, outflow = pressure_at(i, cells), flow_at(i, cells), flow_at(i + 1, cells)
        compliance = step * across_joint(line.joint - (i - 0.5), line.b, line.b_near)
        soft, net = stiffness(x[place], line), x[inflow] - x[outflow]
        if tangent is not None:
            by_pressure, by_air, by_slope = stiffness_slopes(x[place], line)
            keep = 1.0 + compliance * by_pressure * net
            _pressure_row(tangent.by, place, inflow, outflow, keep, compliance * soft)
            far, near = across_joint_slopes(line.joint - (i - 0.5), line.b, line.b_near)
            by_coefficient = tangent.slopes.by_coefficient
            by_coefficient[place, _B] = step * soft * far * net
            by_coefficient[place, _B_NEAR] = step * soft * near * net
            by_coefficient[place, _AIR] = compliance * by_air * net
            by_coefficient[place, _STIFFNESS_SLOPE] = compliance * by_slope * net
        x[place] += compliance * soft * net
    if tangent is not None:
        add_coefficients(tangent.by, tangent.slopes.by_coefficient, tangent.theta, 3, cells + 2)


@inner
def _stress_end(x: NDArray[np.float64], cells: int, line: WaveLine, tangent: Any) -> None:
    """What the end cell's compression in the step before does to the flow into it."""
    before = before_at(cells)
    stress = line.damping / line.b_near
    rise = x[0] - x[before]
    if tangent is not None:
        by, by_coefficient = tangent.by, tangent.slopes.by_coefficient
        for j in range(by.shape[1]):
            by[1, j] -= stress * (by[0, j] - by[before, j])
            by[before, j] = by[0, j]
        by_coefficient[1, _DAMPING] -= rise / line.b_near
        by_coefficient[1, _B_NEAR] = rise * stress / line.b_near
    x[1] -= stress * rise
    x[before] = x[0]


@inner
def _flow_row(
    by: NDArray[np.float64],
    scratch: NDArray[np.float64],
    place: int,
    there: int,
    here: int,
    behind: int,
    keep: float,
    even: float,
    push: float,
) -> None:
    """The derivatives of a face's flow; there: place of the pressure ahead, -1 of the rail's. Row 0 of `scratch`
    holds those of the flow ahead as it was."""
    if there < 0:
        for j in range(by.shape[1]):
            scratch[0, j] = by[place, j]
            scratch[1, j] = 0.0
    else:
        for j in range(by.shape[1]):
            scratch[1, j] = by[there, j]
    for j in range(by.shape[1]):
        old = by[place, j]
        drop = scratch[1, j] - by[here, j]
        by[place, j] = keep * old + even * (scratch[0, j] + by[behind, j]) + push * drop
        scratch[0, j] = old


@inner
def _pressure_row(
    by: NDArray[np.float64], place: int, inflow: int, outflow: int, keep: float, fill: float
) -> None:
    """The derivatives of a cell's pressure."""
    for j in range(by.shape[1]):
        by[place, j] = keep * by[place, j] + fill * (by[inflow, j] - by[outflow, j])


@inner
def _fine(
    x: NDArray[np.float64],
    u_start: tuple[float, float],
    u_middle: tuple[float, float],
    u_end: tuple[float, float],
    step: float,
    c: Coefficients,
    network: Network,
) -> None:
    """`integrator.fine_step` of a line of cells."""
    move_line(x, u_start[0], step, c.line, None)
    move_end(x, u_middle, u_end, step, c, network, None)


step_by(WaveLine, OwnStep(leapfrog, _fine))

_A3, _A3_NEAR, _A4, _B, _B_NEAR, _DAMPING, _AIR, _STIFFNESS_SLOPE = (
    WaveLine._fields.index(name)
    for name in ("a3", "a3_near", "a4", "b", "b_near", "damping", "air", "stiffness_slope")
)
