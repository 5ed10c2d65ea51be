"""A feed line with travelling waves, drained by the seat into a small sac: a richer plant than that of the bars.

Along the line: discontinuous Galerkin spectral elements (four Gauss-Lobatto nodes each, upwind fluxes by the local
impedances), classical Runge-Kutta in time. Gallery in front of the seat and sac: an implicit, L-stable Runge-Kutta
method of second order (SDIRK2), between half steps of which the line moves (Strang, balanced: the seat's flow of the
step before is taken from the gallery while the line moves, and given back while the seat's flow is solved for). Every
flow that leaves one volume enters the next, so volume is conserved. Orifice laws are sharp (no transition pressure).
Imports nothing of `observer_rt`, and shares no discretisation with it.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant_equations import (
    CORNER,
    Rail,
    chamber_pressure,
    lagged,
    lift_at,
    line_stiffness,
    nozzle_factor,
    seat_factor,
)
from tools.benchmarks.plant_parameters import Faults, Injector

NODES = 4  # of an element
EDGE = 12.0  # 2 / weight of an outer node: what a jump of the flux does to it
GAMMA = 1.0 - 1.0 / math.sqrt(2.0)  # of SDIRK2
STEPS = 12  # per sample of 10 us
SOLVED = 1e-3  # Pa
STEEPEST = 1.0  # Pa, difference of pressure at which Newton's slope of a root ends; the root itself is exact
EMPTY = 5e3  # Pa above the chamber's at which a shut sac counts as empty: it has less than 0.1 us to go


# Derivative of a cubic over an element of length 1 from its values at the Gauss-Lobatto nodes -1, -sqrt(1/5),
# sqrt(1/5), 1: first and second row of the matrix; the others are their mirror image, with the other sign.
OUTER = (-6.0, 2.5 * (1.0 + math.sqrt(5.0)), 2.5 * (1.0 - math.sqrt(5.0)), 1.0)
INNER = (-0.5 * (1.0 + math.sqrt(5.0)), 0.0, math.sqrt(5.0), 0.5 * (1.0 - math.sqrt(5.0)))


Four = tuple[float, float, float, float]


class Lattice(NamedTuple):
    """The line in elements of equal length; arrays (elements,).

    inertance [kg/m4], volume [m3], impedance [Pa s/m3] and loss [1/m3] are those of an element; `stress` its
    inertance times damping over the square of its length [Pa s/m3]. Friction that remembers (Kagawa): what is left of
    each of its parts after a step (elements, parts), what of a change of flow is added to it, and its pull [1/s].
    """

    inertance: Array
    volume: Array
    impedance: Array
    loss: Array
    stress: Array
    kept: Array
    added: Array
    pull: Array
    end_volume: float  # m3, the gallery in front of the seat


class WaveState(NamedTuple):
    """Changed in place: flows, pressures of the nodes and the gallery's pressure (2 n + 1,), what friction remembers
    (n, parts), [p_S, lagged p_L, lagged lift, the seat's flow in the last step] (4,)."""

    line: Array
    memory: Array
    sac_and_sensor: Array


@njit(cache=True, nogil=True)
def line_rates(
    y: Array,
    rate: Array,
    pull: Array,
    rail: float,
    drain: float,
    lattice: Lattice,
    part: Injector,
    faults: Faults,
) -> None:
    """Time derivative of flows, pressures and the gallery's pressure (2 n + 1,) into `rate`.

    pull (n,): of the friction that remembers [m3/s2]; drain: held flow out of the gallery [m3/s].
    """
    elements = lattice.inertance.shape[0]
    n = elements * NODES
    p_end = y[2 * n]
    even = faults.bulk_modulus_slope == 0.0 and faults.entrained_air == 0.0
    stiffness = line_stiffness(p_end, part, faults)
    pressure0, flow0 = rail, y[0] + (rail - y[n]) / lattice.impedance[0]
    stress0 = 0.0  # the rail holds its pressure
    s = _stresses(y, 0, lattice)
    for e in range(elements):
        i, j = e * NODES, n + e * NODES
        z = lattice.impedance[e]
        if e + 1 < elements:
            beyond = lattice.impedance[e + 1]
            flow1 = (y[j + 3] - y[j + 4] + z * y[i + 3] + beyond * y[i + 4]) / (z + beyond)
            pressure1 = y[j + 3] + z * (y[i + 3] - flow1)
            s_after = _stresses(y, e + 1, lattice)
            stress1 = 0.5 * (s[3] + s_after[0])
        else:
            pressure1, flow1 = p_end, y[i + 3] + (y[j + 3] - p_end) / z
            s_after, stress1 = s, s[3]
        force = _slopes(y[j] - s[0], y[j + 1] - s[1], y[j + 2] - s[2], y[j + 3] - s[3])
        force0 = force[0] - EDGE * (pressure0 - stress0 - y[j] + s[0])
        force3 = force[3] + EDGE * (pressure1 - stress1 - y[j + 3] + s[3])
        ease, loss = 1.0 / lattice.inertance[e], lattice.loss[e]
        rate[i] = -ease * force0 - loss * y[i] * math.fabs(y[i]) - pull[i]
        rate[i + 1] = -ease * force[1] - loss * y[i + 1] * math.fabs(y[i + 1]) - pull[i + 1]
        rate[i + 2] = -ease * force[2] - loss * y[i + 2] * math.fabs(y[i + 2]) - pull[i + 2]
        rate[i + 3] = -ease * force3 - loss * y[i + 3] * math.fabs(y[i + 3]) - pull[i + 3]
        gain = stiffness / lattice.volume[e]
        spread = _slopes(y[i], y[i + 1], y[i + 2], y[i + 3])
        rate[j] = -gain * (spread[0] - EDGE * (flow0 - y[i]))
        rate[j + 1] = -gain * spread[1]
        rate[j + 2] = -gain * spread[2]
        rate[j + 3] = -gain * (spread[3] + EDGE * (flow1 - y[i + 3]))
        if not even:
            for k in range(j, j + NODES):
                rate[k] *= line_stiffness(y[k], part, faults) / stiffness
        pressure0, flow0, stress0, s = pressure1, flow1, stress1, s_after
    leak = faults.guide_leakage * (p_end - part.chamber_pressure)
    rate[2 * n] = (flow0 - drain - leak) * stiffness / lattice.end_volume


@njit(cache=True, nogil=True)
def _slopes(a: float, b: float, c: float, d: float) -> Four:
    """Derivative over an element of length 1 at its nodes, from the values there."""
    return (
        OUTER[0] * a + OUTER[1] * b + OUTER[2] * c + OUTER[3] * d,
        INNER[0] * a + INNER[2] * c + INNER[3] * d,
        -INNER[3] * a - INNER[2] * b - INNER[0] * d,
        -OUTER[3] * a - OUTER[2] * b - OUTER[1] * c - OUTER[0] * d,
    )


@njit(cache=True, nogil=True)
def _stresses(y: Array, e: int, lattice: Lattice) -> Four:
    """What damps waves, at the nodes of an element [Pa]; the flow at an inner edge is the mean of both sides."""
    i = e * NODES
    damping = lattice.stress[e]
    slopes = _slopes(y[i], y[i + 1], y[i + 2], y[i + 3])
    before = 0.5 * (y[i - 1] - y[i]) if e > 0 else 0.0
    after = 0.5 * (y[i + 4] - y[i + 3]) if e + 1 < lattice.stress.shape[0] else 0.0
    return (
        damping * (slopes[0] - EDGE * before),
        damping * slopes[1],
        damping * slopes[2],
        damping * (slopes[3] + EDGE * after),
    )


@njit(cache=True, nogil=True)
def line_step(
    state: WaveState,
    rooms: Array,
    rail0: float,
    rail1: float,
    drain: float,
    step: float,
    lattice: Lattice,
    part: Injector,
    faults: Faults,
) -> None:
    """Line and gallery over `step` [s], the seat's flow held; rooms (4, 2 n + 1): room to work in."""
    y, memory = state.line, state.memory
    stage, rate, total, pull = rooms[0], rooms[1], rooms[2], rooms[3]
    size = y.shape[0]
    n = size // 2
    parts = memory.shape[1]
    for i in range(n):
        remembered = 0.0
        for j in range(parts):
            remembered += memory[i, j]
        pull[i] = lattice.pull[i // NODES] * remembered
    middle = 0.5 * (rail0 + rail1)
    line_rates(y, rate, pull, rail0, drain, lattice, part, faults)
    for i in range(size):
        total[i] = rate[i]
        stage[i] = y[i] + 0.5 * step * rate[i]
    line_rates(stage, rate, pull, middle, drain, lattice, part, faults)
    for i in range(size):
        total[i] += 2.0 * rate[i]
        stage[i] = y[i] + 0.5 * step * rate[i]
    line_rates(stage, rate, pull, middle, drain, lattice, part, faults)
    for i in range(size):
        total[i] += 2.0 * rate[i]
        stage[i] = y[i] + step * rate[i]
    line_rates(stage, rate, pull, rail1, drain, lattice, part, faults)
    for i in range(size):
        change = step / 6.0 * (total[i] + rate[i])
        y[i] += change
        if i < n:
            for j in range(parts):
                memory[i, j] = memory[i, j] * lattice.kept[i // NODES, j]
                memory[i, j] += lattice.added[i // NODES, j] * change


@njit(cache=True, nogil=True)
def signed_root(difference: float) -> float:
    """Root of a pressure difference [Pa], with its sign."""
    root: float = math.copysign(math.sqrt(math.fabs(difference)), difference)
    return root


@njit(cache=True, nogil=True)
def _through_seat(difference: float, resistance: float) -> float:
    """x of x + resistance signed_root(x) = difference."""
    root = 0.5 * (math.sqrt(resistance * resistance + 4.0 * math.fabs(difference)) - resistance)
    drop: float = math.copysign(root * root, difference)
    return drop


@njit(cache=True, nogil=True)
def _implicit(
    gallery: float,
    sac: float,
    gallery_gain: float,
    sac_gain: float,
    lift: float,
    part: Injector,
    faults: Faults,
) -> tuple[float, float]:
    """Seat and nozzle flow [m3/s] that solve p_L = gallery - gallery_gain Q_S and p_S = sac + sac_gain (Q_S - Q_H).

    The seat's law is solved exactly; Newton's method for p_S, kept in its bracket.
    """
    seat, p_c = seat_factor(lift, part, faults), chamber_pressure(lift, part, faults)
    resistance = gallery_gain * seat
    low, high = min(p_c, gallery, sac) - 1.0, max(p_c, gallery, sac) + 1.0
    p = min(max(sac, low), high)
    for _ in range(80):
        drop = _through_seat(gallery - p, resistance)
        q_s = seat * signed_root(drop)
        nozzle = nozzle_factor(p, p_c, lift, part, faults)
        q_h = nozzle * signed_root(p - p_c)
        rest = p - sac - sac_gain * (q_s - q_h)
        if rest > 0.0:
            high = p
        else:
            low = p
        root = math.sqrt(max(math.fabs(drop), STEEPEST))
        slope = 1.0 + sac_gain * seat / (2.0 * root + resistance)
        slope += sac_gain * nozzle / (2.0 * math.sqrt(max(math.fabs(p - p_c), STEEPEST)))
        better = p - rest / slope
        if not low < better < high:
            better = 0.5 * (low + high)
        change = better - p
        p = better
        if math.fabs(change) < SOLVED or high - low < SOLVED:
            break
    q_s = seat * signed_root(_through_seat(gallery - p, resistance))
    return q_s, nozzle_factor(p, p_c, lift, part, faults) * signed_root(p - p_c)


@njit(cache=True, nogil=True)
def seat_step(
    p_l: float,
    p_s: float,
    inflow: float,
    time: float,
    step: float,
    strokes: Array,
    end_volume: float,
    part: Injector,
    faults: Faults,
) -> tuple[float, float, float]:
    """Pressures of gallery and sac after `step` [s] from `time`, and the seat's mean flow: SDIRK2.

    inflow: held flow into the gallery [m3/s].
    """
    by_gallery = step * line_stiffness(p_l, part, faults) / end_volume
    by_sac = step * part.bulk_modulus_sac * (1.0 + faults.sac_stiffness) / part.sac_volume
    lift = lift_at(time + GAMMA * step, strokes)
    gallery = p_l + GAMMA * by_gallery * inflow
    q_s1, q_h1 = _implicit(gallery, p_s, GAMMA * by_gallery, GAMMA * by_sac, lift, part, faults)
    gallery = p_l + by_gallery * (inflow - (1.0 - GAMMA) * q_s1)
    sac = p_s + (1.0 - GAMMA) * by_sac * (q_s1 - q_h1)
    lift = lift_at(time + step, strokes)
    q_s2, q_h2 = _implicit(gallery, sac, GAMMA * by_gallery, GAMMA * by_sac, lift, part, faults)
    gallery -= GAMMA * by_gallery * q_s2
    sac += GAMMA * by_sac * (q_s2 - q_h2)
    if lift == 0.0 and sac - part.chamber_pressure < EMPTY:
        sac = part.chamber_pressure
    return gallery, sac, (1.0 - GAMMA) * q_s1 + GAMMA * q_s2


@njit(cache=True, nogil=True)
def run_wave(
    lattice: Lattice,
    part: Injector,
    faults: Faults,
    strokes: Array,
    drive: Rail,
    state: WaveState,
    steps: int,
    result: Array,
) -> None:
    """Integrate over the samples of the rail pressure, each in `steps`, for which the lattice was made.

    result (n, 6) as of `plant_equations.run`.
    """
    start, interval, rail = drive
    y, sac_and_sensor = state.line, state.sac_and_sensor
    end = y.shape[0] - 1
    p_s, seen, seen_lift, drain = sac_and_sensor
    recorded = seen
    rooms = np.zeros((4, y.shape[0]))
    step = interval / steps
    for k in range(result.shape[0]):
        t0 = start + k * interval
        shut = p_s == part.chamber_pressure
        for i in range(strokes.shape[0]):
            shut = shut and (t0 + interval <= strokes[i, 0] - CORNER or t0 >= strokes[i, 3] + CORNER)
        late = interval - faults.channel_skew % interval  # after t0; whole intervals are the caller's
        lift1 = 0.0 if shut else lift_at(t0, strokes)
        for j in range(steps):
            time, lift0, p_l0, seen0 = t0 + j * step, lift1, y[end], seen
            rail0 = rail[k] + (rail[k + 1] - rail[k]) * j / steps
            rail1 = rail[k] + (rail[k + 1] - rail[k]) * (j + 1) / steps
            if shut:
                drain = 0.0
            else:
                y[end], p_s, before = seat_step(
                    y[end], p_s, drain, time, 0.5 * step, strokes, lattice.end_volume, part, faults
                )
            line_step(state, rooms, rail0, rail1, drain, step, lattice, part, faults)
            if not shut:
                y[end], p_s, after = seat_step(
                    y[end],
                    p_s,
                    drain,
                    time + 0.5 * step,
                    0.5 * step,
                    strokes,
                    lattice.end_volume,
                    part,
                    faults,
                )
                drain = 0.5 * (before + after)
                lift1 = lift_at(time + step, strokes)
            seen = lagged(seen0, p_l0, y[end], step, faults.line_pressure_sensor_lag)
            seen_lift = lagged(seen_lift, lift0, lift1, step, faults.lift_sensor_lag)
            if j * step < late <= (j + 1) * step * (1.0 + 1e-12):
                recorded = seen0 + (seen - seen0) * (late / step - j)
        p_c = chamber_pressure(lift1, part, faults)
        result[k, 0] = nozzle_factor(p_s, p_c, lift1, part, faults) * signed_root(p_s - p_c)
        result[k, 1] = p_s
        result[k, 2] = lift1
        result[k, 3] = y[end]
        result[k, 4] = recorded
        result[k, 5] = seen_lift
    sac_and_sensor[:] = np.array([p_s, seen, seen_lift, drain])
