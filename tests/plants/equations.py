"""Injector and feed line of the plant: a line of n cells (one: the lump of (19)-(20)), and the sac, in fine steps.

Velocity Verlet, at the closed end the trapezoidal rule by Newton's method. Imports nothing of `observer_rt`.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from tests.plants import laws as law
from tests.plants.arrays import Array
from tests.plants.parameters import Faults, Injector

ROUNDING = 100.0  # Pa, below which the square root of a pressure difference is rounded
CHAMBER_LIFT = 300e-6
STIFFNESS_PRESSURE = 100e6  # Pa, at which the bulk modulus is that of the part, whatever its slope
CORNER = 0.015e-3  # s, half width of the needle's rounded corners
STEPS_FLOWING = 40  # per sample while the needle is open or the sac empties
STEPS_SHUT = 10  # per sample while only the line moves
SOLVED_SAC = 1e-3  # Pa
SOLVED_LINE = 1e-2  # Pa


class Rail(NamedTuple):
    """Rail pressure (n + 1,) [Pa], linear between its samples, the first at `start` [s]."""

    start: float
    interval: float  # s
    pressure: Array


class State(NamedTuple):
    """Changed in place: line flows and pressures (cells,), [p_S, lagged p_L, lagged lift]; what laws remember."""

    q: Array
    p: Array
    sac_and_sensor: Array
    remembered: Array


@njit(cache=True, nogil=True)
def square_root(difference: float) -> float:
    return difference / math.sqrt(math.fabs(difference) + ROUNDING)


@njit(cache=True, nogil=True)
def square_root_slope(difference: float) -> float:
    rounded = math.fabs(difference) + ROUNDING
    return (rounded - 0.5 * math.fabs(difference)) / (rounded * math.sqrt(rounded))


@njit(cache=True, nogil=True)
def _ramp(time: float) -> float:
    """max(0, time), its corner rounded by a triangular window of half width CORNER."""
    if time <= -CORNER:
        return 0.0
    if time >= CORNER:
        return time
    total = (time + CORNER) ** 3
    if time > 0.0:
        total -= 2.0 * time**3
    return total / (6.0 * CORNER * CORNER)


@njit(cache=True, nogil=True)
def lift_at(time: float, strokes: Array) -> float:
    """True needle lift [m]; strokes (m, 6): opening, top, closing, closed [s], opening and closing speed [m/s]."""
    lift = 0.0
    for i in range(strokes.shape[0]):
        if strokes[i, 0] - CORNER < time < strokes[i, 3] + CORNER:
            lift += strokes[i, 4] * (_ramp(time - strokes[i, 0]) - _ramp(time - strokes[i, 1]))
            lift -= strokes[i, 5] * (_ramp(time - strokes[i, 2]) - _ramp(time - strokes[i, 3]))
    return max(lift, 0.0)


@njit(cache=True, nogil=True)
def nozzle_factor(p_s: float, p_c: float, lift: float, part: Injector, faults: Faults) -> float:
    """Flow through the nozzle per root of pressure difference [m3/s/sqrt(Pa)]; as dense as fuel midway is."""
    factor = part.nozzle_area * math.sqrt(2.0 / part.density) * (1.0 + faults.orifice_area)
    if part.stiffening > 0.0:
        factor *= math.sqrt(density_share(0.5 * (p_s + p_c), part))
    if faults.nozzle_lift_loss != 0.0 and lift > 0.0:
        factor *= 1.0 - faults.nozzle_lift_loss * math.exp(-lift / faults.seat_lift_scale)
    if faults.orifice_cavitation > 0.0 and p_s > p_c:
        number = (p_s - part.vapour_pressure) / (p_s - p_c)
        critical = 1.0 + faults.orifice_cavitation
        if number < critical:
            factor *= math.sqrt(number / critical)
    return factor


@njit(cache=True, nogil=True)
def seat_factor(lift: float, p_l: float, part: Injector, faults: Faults) -> float:
    """Flow through the seat per root of pressure difference [m3/s/sqrt(Pa)]."""
    if lift <= 0.0:
        return 0.0
    sine = math.sin(part.seat_half_angle)
    area = math.pi * lift * sine * (part.seat_diameter - 0.5 * lift * math.sin(2.0 * part.seat_half_angle))
    loss = faults.seat_lift_loss * math.exp(-lift / faults.seat_lift_scale)
    worn = (1.0 + faults.seat_area) * (1.0 - loss)
    return part.seat_coefficient * worn * area * math.sqrt(2.0 / part.density * density_share(p_l, part))


@njit(cache=True, nogil=True)
def chamber_pressure(lift: float, part: Injector, faults: Faults) -> float:
    """p_C [Pa], raised while the needle is open: with the lift, or at once."""
    lifted = min(1.0, lift / CHAMBER_LIFT)
    pressure = part.chamber_pressure + faults.chamber_pressure_rise * lifted
    if lift <= 0.0:
        return pressure
    return pressure + faults.chamber_pressure_step * (1.0 - faults.chamber_pressure_share * (1.0 - lifted))


@njit(cache=True, nogil=True)
def density_share(p: float, part: Injector) -> float:
    """Of the density without pressure, at a pressure [Pa]: d rho/dp = rho/K."""
    if part.stiffening <= 0.0:
        return 1.0
    share: float = math.exp(math.log1p(part.stiffening * p / part.bulk_modulus_line) / part.stiffening)
    return share


@njit(cache=True, nogil=True)
def line_stiffness(p: float, part: Injector, faults: Faults) -> float:
    """Bulk modulus of the line's fuel, with its air, at a pressure [Pa], for volumes as they are without pressure."""
    stiffness: float = stiffness_at(p, density_share(p, part), part, faults)
    return stiffness


@njit(cache=True, nogil=True)
def stiffness_at(p: float, density: float, part: Injector, faults: Faults) -> float:
    """The same where the density over that without pressure is known."""
    fuel = part.bulk_modulus_line * (1.0 + faults.bulk_modulus) + part.stiffening * p
    fuel += faults.bulk_modulus_slope * (p - STIFFNESS_PRESSURE)
    return 1.0 / (density / fuel + faults.entrained_air / p)


@njit(cache=True, nogil=True)
def sac_stiffness(p: float, part: Injector, faults: Faults) -> float:
    """The same of the fuel in the sac."""
    fuel = part.bulk_modulus_sac * (1.0 + faults.sac_stiffness) + part.stiffening * p
    stiffness: float = fuel / density_share(p, part)
    return stiffness


@njit(cache=True, nogil=True)
def _sac_after(
    p_s0: float, fixed: float, half: float, p_l: float, p_c: float, lift: float, part: Injector, faults: Faults
) -> float:
    """Sac pressure p that solves p = p_s0 + fixed + half (Q_S(p) - Q_H(p)); Newton, kept in its bracket."""
    seat = seat_factor(lift, p_l, part, faults)
    low, high = min(p_c, p_l, p_s0) - 1e6, max(p_c, p_l, p_s0) + 1e6
    p = p_s0
    for _ in range(60):
        nozzle = nozzle_factor(p, p_c, lift, part, faults)
        flow = seat * square_root(p_l - p) - nozzle * square_root(p - p_c)
        residual = p - p_s0 - fixed - half * flow
        if residual > 0.0:
            high = p
        else:
            low = p
        slope = 1.0 + half * (seat * square_root_slope(p_l - p) + nozzle * square_root_slope(p - p_c))
        change = -residual / slope
        if not low <= p + change <= high:
            change = 0.5 * (low + high) - p
        p += change
        if math.fabs(change) < SOLVED_SAC:
            break
    return p


@njit(cache=True, nogil=True)
def kick(q: Array, p: Array, rail: float, step: float, part: Injector, faults: Faults) -> None:
    """Flows of the line over `step` [s], pressures held: (19) for every cell."""
    cells = q.shape[0]
    inertance = part.density * part.line_length * (1.0 + faults.line_inertance) / part.line_area / cells
    loss = part.line_loss * (1.0 + faults.line_friction) / (2.0 * part.line_area * part.line_length)
    damping = part.line_damping * (cells / part.line_length) ** 2
    before = q[0]
    for i in range(cells):
        upstream = rail if i == 0 else p[i - 1]
        after = q[i + 1] if i + 1 < cells else q[i]
        change = (upstream - p[i]) / inertance - loss * q[i] * math.fabs(q[i])
        change += damping * (before - 2.0 * q[i] + after)
        before = q[i]
        q[i] += step * change


@njit(cache=True, nogil=True)
def drift(
    q: Array, p: Array, p_s: float, lift0: float, lift1: float, step: float, part: Injector, faults: Faults
) -> float:
    """Pressures over `step` [s], line flows held: (20), (22). Returns the new sac pressure."""
    cells = q.shape[0]
    compliance = part.line_volume / cells
    for i in range(cells - 1):
        p[i] += step * line_stiffness(p[i], part, faults) / compliance * (q[i] - q[i + 1])
    last = cells - 1
    p_l0 = p[last]
    line_gain = 0.5 * step * line_stiffness(p_l0, part, faults) / compliance
    sac_gain = 0.5 * step * sac_stiffness(p_s, part, faults) / part.sac_volume
    by_seat = max(faults.seat_outflow, float(part.drained_by_seat))
    flowing = lift0 > 0.0 or lift1 > 0.0 or p_s != part.chamber_pressure
    inflow = q[last] - faults.guide_leakage * (p_l0 - part.chamber_pressure)
    if not flowing:
        p[last] = p_l0 + 2.0 * line_gain * inflow
        return p_s
    p_c0 = chamber_pressure(lift0, part, faults)
    seat0 = seat_factor(lift0, p_l0, part, faults) * square_root(p_l0 - p_s)
    nozzle0 = nozzle_factor(p_s, p_c0, lift0, part, faults) * square_root(p_s - p_c0)
    drain0 = by_seat * seat0 + (1.0 - by_seat) * nozzle0
    p_c1 = chamber_pressure(lift1, part, faults)
    p_l, p_s1 = p_l0, p_s
    for _ in range(20):
        p_s1 = _sac_after(p_s, sac_gain * (seat0 - nozzle0), sac_gain, p_l, p_c1, lift1, part, faults)
        seat1 = seat_factor(lift1, p_l, part, faults) * square_root(p_l - p_s1)
        nozzle1 = nozzle_factor(p_s1, p_c1, lift1, part, faults) * square_root(p_s1 - p_c1)
        drain1 = by_seat * seat1 + (1.0 - by_seat) * nozzle1
        leak1 = faults.guide_leakage * (p_l - part.chamber_pressure)
        better = p_l0 + line_gain * (inflow - drain0 + q[last] - leak1 - drain1)
        change = better - p_l
        p_l = better
        if math.fabs(change) < SOLVED_LINE:
            break
    p[last] = p_l
    if lift1 == 0.0 and p_s1 - part.chamber_pressure < ROUNDING:
        return part.chamber_pressure
    return p_s1


@njit(cache=True, nogil=True)
def is_shut(p_s: float, end: float, begin: float, strokes: Array, remembered: float, part: Injector) -> bool:
    """Whether from `begin` to `end` [s] needle and sac stay as they are, and the remembered lift [m] is 0."""
    shut = p_s == part.chamber_pressure and remembered == 0.0
    for i in range(strokes.shape[0]):
        shut = shut and (end <= strokes[i, 0] - CORNER or begin >= strokes[i, 3] + CORNER)
    return shut


@njit(cache=True, nogil=True)
def run(
    part: Injector,
    faults: Faults,
    laws: law.Laws,
    beyond: bool,
    strokes: Array,
    drive: Rail,
    state: State,
    result: Array,
) -> None:
    """Integrate over the samples of the rail pressure; beyond: whether there is any law.

    result (n, 6), at the samples after the first: injection rate, p_S, lift, p_L, line pressure and lift as sensors
    with lag and late recording see them.
    """
    start, interval, rail = drive
    q, p, sac_and_sensor, remembered = state
    last = p.shape[0] - 1
    p_s, seen, seen_lift = sac_and_sensor[0], sac_and_sensor[1], sac_and_sensor[2]
    recorded = seen
    inertance = part.density * part.line_length * (1.0 + faults.line_inertance) / part.line_area
    inertances = np.full(last + 1, inertance)
    loss = part.line_loss / (2.0 * part.line_area * part.line_length)
    for k in range(result.shape[0]):
        t0 = start + k * interval
        shut = laws.least_lift == 0.0 and is_shut(p_s, t0 + interval, t0, strokes, remembered[-1], part)
        steps = STEPS_SHUT if shut else STEPS_FLOWING
        step = interval / steps
        lift1 = 0.0 if shut else lift_at(t0, strokes)
        open1 = law.true_lift(lift1, remembered[-1], part.max_lift, laws)
        late = interval - faults.channel_skew % interval  # after t0; whole intervals are the caller's
        now = part
        for j in range(steps):
            lift0, open0, p_l0, seen0 = lift1, open1, p[last], seen
            rail0 = rail[k] + (rail[k + 1] - rail[k]) * j / steps
            rail1 = rail[k] + (rail[k + 1] - rail[k]) * (j + 1) / steps
            lift1 = 0.0 if shut else lift_at(t0 + (j + 1) * step, strokes)
            if beyond:
                remembered[-1] = lagged(remembered[-1], lift0, lift1, step, laws.lift_memory)
                remembered[-1] = law.forgetting(remembered[-1], lift1)
            open1 = law.true_lift(lift1, remembered[-1], part.max_lift, laws)
            if beyond:
                time, speed = t0 + j * step, (lift1 - lift0) / step
                since = law.since_opening(time, strokes)
                valve = law.valve_opening(time, strokes, laws)
                moment = law.Moment(time, since, open0, speed, q[last], p_l0, p_s, remembered[-2], valve, rail0)
                now = law.altered(part, laws, moment)
            kick(q, p, rail0, 0.5 * step, now, faults)
            p_s = drift(q, p, p_s, open0, open1, step, now, faults)
            kick(q, p, rail1, 0.5 * step, now, faults)
            if beyond:
                law.resist(q, p, remembered, inertances, loss, laws, step)
                gain = line_stiffness(p[last], now, faults) / part.line_volume * (last + 1)
                p[last] -= step * gain * law.outflow(part, laws, moment)
                remembered[-2] = lagged(remembered[-2], p_l0, p[last], step, laws.pressure_memory)
            seen = lagged(seen0, p_l0, p[last], step, faults.line_pressure_sensor_lag)
            seen_lift = lagged(seen_lift, lift0, lift1, step, faults.lift_sensor_lag)
            if j * step < late <= (j + 1) * step * (1.0 + 1e-12):
                recorded = seen0 + (seen - seen0) * (late / step - j)
        p_c = chamber_pressure(open1, part, faults)
        injected = nozzle_factor(p_s, p_c, open1, now, faults) * square_root(p_s - p_c)
        result[k] = (injected, p_s, lift1, p[last], recorded, seen_lift)
    sac_and_sensor[0], sac_and_sensor[1], sac_and_sensor[2] = p_s, seen, seen_lift


@njit(cache=True, nogil=True)
def lagged(seen: float, before: float, after: float, step: float, lag: float) -> float:
    """First-order lag over a step, its input linear; exact."""
    if lag <= 0.0:
        return after
    decay = math.exp(-step / lag)
    slope = (after - before) / step
    return after - slope * lag + (seen - before + slope * lag) * decay
