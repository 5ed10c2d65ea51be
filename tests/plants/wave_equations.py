"""The richer plant in time: a line with travelling waves, drained by the seat into a small sac.

Gallery in front of the seat and sac: an implicit, L-stable Runge-Kutta method of second order (SDIRK2), between two
half steps of the line (Strang, balanced: the seat's flow of the step before is taken from the gallery while the line
moves, and given back while the seat's flow is solved for). A flow that leaves one volume enters the next, so volume
is conserved. Orifice laws are sharp (no transition pressure). Imports nothing of `observer_rt`.

In 12 steps a sample and 12 elements, against 4 times the steps and twice the elements: mass within 1e-5, rate within
0.03 mm3/ms, line pressure within 0.05 MPa; the error falls with the square of the step.

Numba keeps what it compiled while this file is unchanged: change it together with `wave_line_equations`.
"""

import math

import numpy as np
from numba import njit

from tests.plants import equations
from tests.plants import laws as law
from tests.plants.arrays import Array
from tests.plants.equations import Rail
from tests.plants.parameters import Faults, Injector
from tests.plants.wave_line_equations import NODES, Lattice, WaveState, line_step

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)  # of SDIRK2
STEPS = 12  # per sample of 10 us
SOLVED = 1e-3  # Pa
STEEPEST = 1.0  # Pa, difference of pressure at which Newton's slope of a root ends; the root itself is exact
STUCK = 0.95  # of the pressure in a shut sac: a small one in which more is left, the method empties no further
EMPTY = 5e3  # Pa above the chamber's at which a shut sac counts as empty: it has less than 0.1 us to go


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
    gallery: float, sac: float, gallery_gain: float, sac_gain: float, lift: float, part: Injector, faults: Faults
) -> tuple[float, float]:
    """Seat and nozzle flow [m3/s] that solve p_L = gallery - gallery_gain Q_S, p_S = sac + sac_gain (Q_S - Q_H)."""
    seat, p_c = equations.seat_factor(lift, gallery, part, faults), equations.chamber_pressure(lift, part, faults)
    resistance = gallery_gain * seat
    low, high = min(p_c, gallery, sac) - 1.0, max(p_c, gallery, sac) + 1.0
    p = min(max(sac, low), high)
    for _ in range(80):
        drop = _through_seat(gallery - p, resistance)
        q_s = seat * signed_root(drop)
        nozzle = equations.nozzle_factor(p, p_c, lift, part, faults)
        q_h = nozzle * signed_root(p - p_c)
        residual = p - sac - sac_gain * (q_s - q_h)
        if residual > 0.0:
            high = p
        else:
            low = p
        root = math.sqrt(max(math.fabs(drop), STEEPEST))
        slope = 1.0 + sac_gain * seat / (2.0 * root + resistance)
        slope += sac_gain * nozzle / (2.0 * math.sqrt(max(math.fabs(p - p_c), STEEPEST)))
        better = p - residual / slope
        if not low < better < high:
            better = 0.5 * (low + high)
        change = better - p
        p = better
        if math.fabs(change) < SOLVED or high - low < SOLVED:
            break
    q_s = seat * signed_root(_through_seat(gallery - p, resistance))
    return q_s, equations.nozzle_factor(p, p_c, lift, part, faults) * signed_root(p - p_c)


@njit(cache=True, nogil=True)
def seat_step(
    p_l: float,
    p_s: float,
    inflow: float,
    lifts: tuple[float, float],
    step: float,
    end_volume: float,
    part: Injector,
    faults: Faults,
) -> tuple[float, float, float]:
    """Pressures of gallery and sac after `step` [s], and the seat's mean flow: SDIRK2; lifts [m]: true."""
    by_gallery = step * equations.line_stiffness(p_l, part, faults) / end_volume
    by_sac = step * equations.sac_stiffness(p_s, part, faults) / part.sac_volume
    lift, lift1 = lifts
    gallery = p_l + GAMMA * by_gallery * inflow
    q_s1, q_h1 = _implicit(gallery, p_s, GAMMA * by_gallery, GAMMA * by_sac, lift, part, faults)
    gallery = p_l + by_gallery * (inflow - (1.0 - GAMMA) * q_s1)
    sac = p_s + (1.0 - GAMMA) * by_sac * (q_s1 - q_h1)
    q_s2, q_h2 = _implicit(gallery, sac, GAMMA * by_gallery, GAMMA * by_sac, lift1, part, faults)
    gallery -= GAMMA * by_gallery * q_s2
    sac += GAMMA * by_sac * (q_s2 - q_h2)
    above = sac - part.chamber_pressure
    is_stuck = lift == 0.0 and above > STUCK * (p_s - part.chamber_pressure)
    if lift1 == 0.0 and (above < EMPTY or is_stuck):
        sac = part.chamber_pressure
    return gallery, sac, (1.0 - GAMMA) * q_s1 + GAMMA * q_s2


@njit(cache=True, nogil=True)
def _lifts(
    time: float, step: float, strokes: Array, remembered: float, max_lift: float, laws: law.Laws
) -> tuple[float, float]:
    """True lifts [m] GAMMA steps, and a whole one, after a time [s]."""
    first, second = (equations.lift_at(time + GAMMA * step, strokes), equations.lift_at(time + step, strokes))
    true_lift = law.true_lift
    return true_lift(first, remembered, max_lift, laws), true_lift(second, remembered, max_lift, laws)


@njit(cache=True, nogil=True)
def _grow_inertance(usual: Lattice, lattice: Lattice, flows: Array, laws: law.Laws) -> None:
    """The line's inertance as it is with these flows (n,), in place of `lattice`; its friction falls with it."""
    for e in range(usual.inertance.shape[0]):
        flow = 0.0
        for i in range(e * NODES, (e + 1) * NODES):
            flow += flows[i] / NODES
        growth = 1.0 + law.inertance_growth(flow, laws)
        lattice.inertance[e] = usual.inertance[e] * growth
        lattice.loss[e] = usual.loss[e] / growth


@njit(cache=True, nogil=True)
def run_wave(
    usual: Lattice,
    lattice: Lattice,
    part: Injector,
    faults: Faults,
    laws: law.Laws,
    beyond: bool,
    strokes: Array,
    drive: Rail,
    state: WaveState,
    steps: int,
    result: Array,
) -> None:
    """Integrate over the rail pressure's samples, each in `steps`; lattice: as `usual`, to be changed."""
    start, interval, rail = drive
    y, sac_and_sensor, remembered = state.line, state.sac_and_sensor, state.remembered
    end = y.shape[0] - 1
    flows, pressures = y[: end // 2], y[end // 2 : end]
    p_s, seen, seen_lift, drain = sac_and_sensor
    recorded = seen
    rooms = np.zeros((4, y.shape[0]))
    step = interval / steps
    inertances = np.repeat(usual.inertance * usual.inertance.shape[0], NODES)
    loss = part.line_loss / (2.0 * part.line_area * part.line_length)
    max_lift = part.max_lift
    for k in range(result.shape[0]):
        t0 = start + k * interval
        shut = laws.least_lift == 0.0 and equations.is_shut(p_s, t0 + interval, t0, strokes, remembered[-1], part)
        late = interval - faults.channel_skew % interval  # after t0; whole intervals are the caller's
        lift1 = 0.0 if shut else equations.lift_at(t0, strokes)
        now = part
        for j in range(steps):
            time, lift0, p_l0, seen0 = t0 + j * step, lift1, y[end], seen
            rail0 = rail[k] + (rail[k + 1] - rail[k]) * j / steps
            rail1 = rail[k] + (rail[k + 1] - rail[k]) * (j + 1) / steps
            if not shut:
                lift1 = equations.lift_at(time + step, strokes)
            if beyond:
                open0, speed = law.true_lift(lift0, remembered[-1], max_lift, laws), (lift1 - lift0) / step
                since = law.since_opening(time, strokes)
                valve = law.valve_opening(time, strokes, laws)
                moment = law.Moment(time, since, open0, speed, flows[-1], p_l0, p_s, remembered[-2], valve, rail0)
                now = law.altered(part, laws, moment)
                _grow_inertance(usual, lattice, flows, laws)
                remembered[-1] = equations.lagged(remembered[-1], lift0, lift1, step, laws.lift_memory)
                remembered[-1] = law.forgetting(remembered[-1], lift1)
            middle = time + 0.5 * step
            if shut:
                drain = 0.0
            else:
                lifts = _lifts(time, 0.5 * step, strokes, remembered[-1], max_lift, laws)
                y[end], p_s, before = seat_step(
                    y[end], p_s, drain, lifts, 0.5 * step, lattice.end_volume, now, faults
                )
            lost = law.outflow(part, laws, moment) if beyond else 0.0
            line_step(state, rooms, rail0, rail1, drain + lost, step, lattice, now, faults)
            if not shut:
                lifts = _lifts(middle, 0.5 * step, strokes, remembered[-1], max_lift, laws)
                y[end], p_s, after = seat_step(y[end], p_s, drain, lifts, 0.5 * step, lattice.end_volume, now, faults)
                drain = 0.5 * (before + after)
            if beyond:
                law.resist(flows, pressures, remembered, inertances, loss, laws, step)
                remembered[-2] = equations.lagged(remembered[-2], p_l0, y[end], step, laws.pressure_memory)
            seen = equations.lagged(seen0, p_l0, y[end], step, faults.line_pressure_sensor_lag)
            seen_lift = equations.lagged(seen_lift, lift0, lift1, step, faults.lift_sensor_lag)
            if j * step < late <= (j + 1) * step * (1.0 + 1e-12):
                recorded = seen0 + (seen - seen0) * (late / step - j)
        open1 = law.true_lift(lift1, remembered[-1], max_lift, laws)
        p_c = equations.chamber_pressure(open1, part, faults)
        injected = equations.nozzle_factor(p_s, p_c, open1, now, faults) * signed_root(p_s - p_c)
        result[k] = (injected, p_s, lift1, y[end], recorded, seen_lift)
    sac_and_sensor[:] = np.array([p_s, seen, seen_lift, drain])
