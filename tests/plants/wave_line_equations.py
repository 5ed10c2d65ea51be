"""A feed line with travelling waves: discontinuous Galerkin elements, classical Runge-Kutta in time.

Four Gauss-Lobatto nodes an element, upwind fluxes. Imports nothing of `observer_rt`, and shares no discretisation.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from tests.plants.arrays import Array
from tests.plants.equations import line_stiffness, stiffness_at
from tests.plants.parameters import Faults, Injector

NODES = 4  # of an element
EDGE = 12.0  # 2 / weight of an outer node: what a jump of the flux does to it

# Derivative of a cubic over an element of length 1 from its values at the Gauss-Lobatto nodes -1, -sqrt(1/5),
# sqrt(1/5), 1: first and second row of the matrix; the others are their mirror image, with the other sign.
OUTER = (-6.0, 2.5 * (1.0 + math.sqrt(5.0)), 2.5 * (1.0 - math.sqrt(5.0)), 1.0)
INNER = (-0.5 * (1.0 + math.sqrt(5.0)), 0.0, math.sqrt(5.0), 0.5 * (1.0 - math.sqrt(5.0)))


EVEN = np.ones(1)
MEGAPASCAL = 1e6
Four = tuple[float, float, float, float]


class Lattice(NamedTuple):
    """The line in equal elements; arrays (elements,): inertance [kg/m4], volume [m3], impedance [Pa s/m3], loss.

    `stress`: inertance times damping over length squared [Pa s/m3]. Friction with memory (Kagawa): the remainder of
    each part after a step (elements, parts), addition by a change of flow, and pull [1/s].
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
    inlet_loss: float = 0.0  # Pa s2/m6, of an orifice between rail and line
    dense: Array = EVEN  # density over that without pressure, for each MPa; (1,): it is everywhere the same
    smoothness: float = 0.0  # (m3/s)^(1/4), root of the flow that a smooth wall resists as a rough one does; 0: rough


class WaveState(NamedTuple):
    """Changed in place: flows, pressures of nodes and gallery (2 n + 1,), the memory of friction (n, parts).

    Then [p_S, lagged p_L, lagged lift, the seat's last flow] (4,), and flows, pressure and lift as of laws (n + 2,).
    """

    line: Array
    memory: Array
    sac_and_sensor: Array
    remembered: Array


@njit(cache=True, nogil=True)
def line_rates(
    y: Array, rate: Array, pull: Array, rail: float, drain: float, lattice: Lattice, part: Injector, faults: Faults
) -> None:
    """Time derivative of flows and pressures (2 n + 1,) into `rate`; pull (n,): of friction [m3/s2]; drain [m3/s]."""
    # each by itself: a function that is given all of them counts references to every array, ten times the work itself
    inertance, volume, impedance, losses, stress = lattice[:5]
    dense, smoothness = lattice.dense, lattice.smoothness
    elements = inertance.shape[0]
    n = elements * NODES
    p_end = y[2 * n]
    even = faults.bulk_modulus_slope == 0.0 and faults.entrained_air == 0.0 and part.stiffening == 0.0
    stiffness = line_stiffness(p_end, part, faults)
    pressure0, flow0 = rail, y[0] + (rail - y[n]) / impedance[0]
    if lattice.inlet_loss > 0.0:
        flow0 = _through_inlet(flow0, impedance[0], lattice.inlet_loss)
        pressure0 = rail - lattice.inlet_loss * flow0 * math.fabs(flow0)
    stress0 = 0.0  # the rail holds its pressure
    s = _stresses(y, 0, stress)
    for e in range(elements):
        i, j = e * NODES, n + e * NODES
        z = impedance[e]
        if e + 1 < elements:
            beyond = impedance[e + 1]
            flow1 = (y[j + 3] - y[j + 4] + z * y[i + 3] + beyond * y[i + 4]) / (z + beyond)
            pressure1 = y[j + 3] + z * (y[i + 3] - flow1)
            s_after = _stresses(y, e + 1, stress)
            stress1 = 0.5 * (s[3] + s_after[0])
        else:
            pressure1, flow1 = p_end, y[i + 3] + (y[j + 3] - p_end) / z
            s_after, stress1 = s, s[3]
        force = _slopes(y[j] - s[0], y[j + 1] - s[1], y[j + 2] - s[2], y[j + 3] - s[3])
        first = force[0] - EDGE * (pressure0 - stress0 - y[j] + s[0])
        last = force[3] + EDGE * (pressure1 - stress1 - y[j + 3] + s[3])
        forces = (first, force[1], force[2], last)
        ease, loss = 1.0 / inertance[e], losses[e]
        for k in range(NODES):
            wall = _resistance(y[i + k], loss, smoothness) / density_at(y[j + k], dense)
            rate[i + k] = -ease * forces[k] - wall - pull[i + k]
        gain = stiffness / volume[e]
        spread = _slopes(y[i], y[i + 1], y[i + 2], y[i + 3])
        rate[j] = -gain * (spread[0] - EDGE * (flow0 - y[i]))
        rate[j + 1] = -gain * spread[1]
        rate[j + 2] = -gain * spread[2]
        rate[j + 3] = -gain * (spread[3] + EDGE * (flow1 - y[i + 3]))
        if not even:
            for k in range(j, j + NODES):
                rate[k] *= stiffness_at(y[k], density_at(y[k], dense), part, faults) / stiffness
        pressure0, flow0, stress0, s = pressure1, flow1, stress1, s_after
    leak = faults.guide_leakage * (p_end - part.chamber_pressure)
    rate[2 * n] = (flow0 - drain - leak) * stiffness / lattice.end_volume


@njit(cache=True, nogil=True)
def density_at(p: float, dense: Array) -> float:
    """Density over that without pressure, at a pressure [Pa]: straight lines between each MPa."""
    if dense.shape[0] == 1:
        return 1.0
    position = min(max(p / MEGAPASCAL, 0.0), dense.shape[0] - 1.001)
    below = int(position)
    share: float = dense[below] + (position - below) * (dense[below + 1] - dense[below])
    return share


@njit(cache=True, nogil=True)
def _resistance(q: float, loss: float, smoothness: float) -> float:
    """What the wall takes of a flow [m3/s]: by its square, or as Blasius found of a smooth one."""
    speed = math.fabs(q)
    if smoothness > 0.0:
        speed = smoothness * math.sqrt(speed * math.sqrt(speed))
    return loss * q * speed


@njit(cache=True, nogil=True)
def _through_inlet(flow: float, impedance: float, loss: float) -> float:
    """Flow q [m3/s] of loss q |q| + impedance q = impedance flow: what an orifice leaves of a flow."""
    drop = impedance * flow
    return 2.0 * drop / (impedance + math.sqrt(impedance * impedance + 4.0 * loss * math.fabs(drop)))


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
def _stresses(y: Array, e: int, stress: Array) -> Four:
    """What damps waves, at the nodes of an element [Pa]; the flow at an inner edge is the mean of both sides."""
    i = e * NODES
    damping = stress[e]
    slopes = _slopes(y[i], y[i + 1], y[i + 2], y[i + 3])
    before = 0.5 * (y[i - 1] - y[i]) if e > 0 else 0.0
    after = 0.5 * (y[i + 4] - y[i + 3]) if e + 1 < stress.shape[0] else 0.0
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
    for i in range(size):
        stage[i], total[i] = y[i], 0.0
    for rail, weight, reach in ((rail0, 1.0, 0.5), (middle, 2.0, 0.5), (middle, 2.0, 1.0)):
        line_rates(stage, rate, pull, rail, drain, lattice, part, faults)
        for i in range(size):
            total[i] += weight * rate[i]
            stage[i] = y[i] + reach * step * rate[i]
    line_rates(stage, rate, pull, rail1, drain, lattice, part, faults)
    for i in range(size):
        change = step / 6.0 * (total[i] + rate[i])
        y[i] += change
        if i < n:
            for j in range(parts):
                memory[i, j] = memory[i, j] * lattice.kept[i // NODES, j]
                memory[i, j] += lattice.added[i // NODES, j] * change
