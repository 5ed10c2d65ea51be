"""Laws that neither the new injector nor any named fault has. Imports nothing of `observer_rt`.

They change a coefficient for one step, or push a state after it, which in such short steps is as good.
"""

import math
from typing import NamedTuple

from numba import njit

from tests.plants.arrays import Array
from tests.plants.parameters import Faults, Injector

REFERENCE = 100e6  # Pa
FULL_FLOW = 60e-6  # m3/s
STICTION_FLOW = 10e-6  # m3/s, from about which on what holds the flow back grows no more
WAX_WIDTH = 0.15  # of the reference pressure
STOP_FROM = 0.75  # of the largest lift
MIDDLE, MIDDLE_WIDTH = 0.5, 0.15  # of the largest lift
SMALL_LIFT = 50e-6  # m
WAVES_OF_LIFT = 3  # up to the largest
ROOT_TIME = 1e-3  # s
HOLE_CLOSES = 0.6e-3  # s after an opening
SHUT_DROP, SHUT_WIDTH = 90e6, 5e6  # Pa
COKING_TIME = 0.5e-3  # s after an opening
TURNING, TURNING_WIDTH, RAIL_WIDTH = 0.8e-3, 0.4e-3, 30e6  # s after an opening, s, Pa
VISCOUS_DROP = 4e6  # Pa, below which the flow coefficient of the nozzle falls no further
RINGING_FREQUENCY, RINGING_DECAY = 1.5e3, 0.6e-3  # Hz, s
LEAST_DROP = 0.1e6  # Pa
LEAST_SHARE, LARGEST_SHARE = 0.05, 3.0  # of a coefficient
FORGOTTEN_LIFT = 1e-9  # m


class Laws(NamedTuple):
    """What the plant does beyond its equations; all 0 is nothing. SI; shares are of the coefficient they change."""

    line_laminar: float = 0.0  # 1/s, resistance of the line over its inertance
    pressure_friction: float = 0.0  # share of the friction that comes with each 100 MPa above 100 MPa
    slow_friction: float = 0.0  # 1/s, on the flow beyond what it was
    flow_memory: float = 1e-3  # s, of what the flow was
    damper: float = 0.0  # Pa s/m3 of what the flow was: a volume behind a throttle at the rail
    stiction: float = 0.0  # Pa, however fast the line flows
    flow_inertance: float = 0.0  # share at 60 mm3/ms
    needle_area: float = 0.0  # m2, that the needle displaces of the line
    root_leakage: float = 0.0  # m3/s/sqrt(Pa), while the needle is shut
    open_leakage: float = 0.0  # m3/(s Pa), while it is open
    lift_leakage: float = 0.0  # m3/(s Pa) at full lift, growing with it
    relief: float = 0.0  # m3/(s Pa), above 100 MPa
    yielding: float = 0.0  # m3/(s Pa) of the pressure beyond what it was: fuel that goes on yielding
    pressure_memory: float = 3e-4  # s, of what the pressure was
    stiffness_bend: float = 0.0  # share 100 MPa from 100 MPa, growing with the square
    wax: float = 0.0  # share by which the line is stiffer above 100 MPa, and softer below
    softening: float = 0.0  # 1/s, share of the stiffness that goes with time
    seat_growth: float = 0.0  # 1/s, share of the seat's coefficient that comes with time
    seat_speed: float = 0.0  # s/m, share of the seat's coefficient by the needle's speed
    stop_loss: float = 0.0  # share of the seat's coefficient at the stop
    middle_loss: float = 0.0  # the same at half lift
    seat_hysteresis: float = 0.0  # share by which it lets more through at small lift while the needle closes
    hole_closing: float = 0.0  # share of the nozzle's area that is gone from 0.6 ms after an opening on
    rail_growth: float = 0.0  # share of the nozzle's coefficient with each 100 MPa of rail above 100 MPa
    shut_by_drop: float = 0.0  # share of the nozzle's area that is gone from a drop of 90 MPa on
    coking: float = 0.0  # share of the nozzle's coefficient that is lost as an opening lasts
    filling: float = 0.0  # Pa/s, by which the chamber's pressure grows while the needle is open
    rail_and_time: float = 0.0  # share of the nozzle's coefficient, by both: the sum of no two laws
    viscous_loss: float = 0.0  # share of the nozzle's coefficient at a drop of 100 MPa, as one over its root
    opening_loss: float = 0.0  # share of the nozzle's coefficient at an opening
    opening_time: float = 1.0  # s, in which that goes
    flow_back_pressure: float = 0.0  # Pa s/m3, by which the chamber's pressure grows with what is injected
    chamber_ringing: float = 0.0  # Pa, after an opening
    lift_ahead: float = 0.0  # share of what it moved lately, by which the needle is ahead of what is seen
    lift_behind: float = 0.0  # the same, by which it is behind
    lift_memory: float = 1e-4  # s, of what the lift was
    lift_bend: float = 0.0  # share of the largest lift, growing with the square
    least_lift: float = 0.0  # m, of a needle that does not quite close
    control_flow: float = 0.0  # m3/s at 100 MPa, that a pilot valve takes out of the line while it is open
    control_lead: float = 0.28e-3  # s, from when it opens to the needle's lifting
    control_trail: float = 0.17e-3  # s, from when it shuts to the needle's beginning to fall
    control_moves: float = 50e-6  # s, in which the pilot valve opens, or shuts
    chamber_inlet: float = 0.0  # m3/s at 100 MPa, of its control chamber's throttle from the line; 0: no chamber
    guide_area: float = 0.0  # m2, of the needle that rises into that chamber, and out of the line's end
    root_coking: float = 0.0  # share of the nozzle's coefficient lost 1 ms after an opening, by the root of time
    seat_choking: float = 0.0  # share of p_L, beyond which a larger drop over the seat passes no more; 0: none
    seat_waves: float = 0.0  # share of the seat's coefficient, in waves over the lift
    nozzle_product: float = 0.0  # share of the nozzle's coefficient, by two quantities at once
    seat_product: float = 0.0  # the same of the seat's
    first_factor: float = 0.0  # the one quantity of both products, by its number
    second_factor: float = 1.0  # the other


BY_RAIL, BY_TIME, BY_LIFT, BY_DROP, BY_FLOW, BY_SPEED = range(6)
"""Quantities of a product: rail pressure, time since opening, lift, drop over the nozzle, line flow, needle speed."""
MIDDLES = (100e6, 0.8e-3, 0.15e-3, 60e6, 25e-6, 0.0)  # SI: a product is of the tanh of both, from here, in WIDTHS
WIDTHS = (30e6, 0.4e-3, 0.06e-3, 25e6, 15e-6, 0.4)
NO_LAWS = Laws()
NINE_LAWS = {  # of nozzle and seat, that no model has
    "area grows with the rail pressure": (Laws(rail_growth=0.3), Faults()),
    "a hole shuts at a large drop": (Laws(shut_by_drop=0.3), Faults()),
    "coking within an injection": (Laws(coking=0.3), Faults()),
    "a seat throttled at its stop": (Laws(stop_loss=0.5), Faults()),
    "a seat laminar at small lift": (NO_LAWS, Faults(seat_lift_loss=0.4)),
    "a chamber that fills": (Laws(filling=5e9), Faults()),
    "a seat with a dip": (Laws(middle_loss=0.3), Faults()),
    "holes covered at small lift": (NO_LAWS, Faults(nozzle_lift_loss=0.3)),
    "a nozzle by Reynolds number": (Laws(viscous_loss=0.05), Faults()),
}


def _law_of_two(first: int, second: int, nozzle: float = 0.0, seat: float = 0.0) -> tuple[Laws, Faults]:
    factors = {"first_factor": float(first), "second_factor": float(second)}
    return Laws(nozzle_product=nozzle, seat_product=seat, **factors), Faults()


TEN_PRODUCTS = {  # of two inputs of nozzle or seat
    "nozzle by rail pressure and time": _law_of_two(BY_RAIL, BY_TIME, nozzle=0.1),
    "nozzle by time and rail pressure": _law_of_two(BY_RAIL, BY_TIME, nozzle=-0.06),
    "nozzle by rail pressure and lift": _law_of_two(BY_RAIL, BY_LIFT, nozzle=0.1),
    "nozzle by time and lift": _law_of_two(BY_TIME, BY_LIFT, nozzle=0.1),
    "nozzle by drop and time": _law_of_two(BY_DROP, BY_TIME, nozzle=0.1),
    "nozzle by drop and lift": _law_of_two(BY_DROP, BY_LIFT, nozzle=-0.1),
    "nozzle by rail pressure and drop": _law_of_two(BY_RAIL, BY_DROP, nozzle=0.1),
    "seat by time and rail pressure": _law_of_two(BY_TIME, BY_RAIL, seat=0.15),
    "seat by rail pressure and lift": _law_of_two(BY_RAIL, BY_LIFT, seat=0.15),
    "seat by time and lift": _law_of_two(BY_TIME, BY_LIFT, seat=-0.15),
}


class Moment(NamedTuple):
    """Quantities of laws at the beginning of a step, SI; since: opening, below 0 before the first; lift: true."""

    time: float
    since: float
    lift: float
    speed: float
    flow: float
    line_pressure: float
    sac_pressure: float
    remembered_pressure: float
    valve: float  # 0..1, how far the pilot valve is open
    rail_pressure: float


@njit(cache=True, nogil=True)
def since_opening(time: float, strokes: Array) -> float:
    """Seconds since the last of the strokes (m, 6) began; -1 before the first."""
    since = -1.0
    for i in range(strokes.shape[0]):
        if strokes[i, 0] <= time:
            since = time - strokes[i, 0]
    return since


@njit(cache=True, nogil=True)
def valve_opening(time: float, strokes: Array, laws: Laws) -> float:
    """How far the pilot valve is open (0..1) for strokes (m, 6): it moves at one speed."""
    widest = 0.0
    for i in range(strokes.shape[0]):
        opens = (time - strokes[i, 0] + laws.control_lead) / laws.control_moves + 0.5
        shuts = (strokes[i, 2] - laws.control_trail - time) / laws.control_moves + 0.5
        widest = max(widest, min(max(min(opens, shuts), 0.0), 1.0))
    return widest


@njit(cache=True, nogil=True)
def true_lift(lift: float, remembered: float, max_lift: float, laws: Laws) -> float:
    """Lift the seat has [m], by the lift that is seen and what that was."""
    ahead = (laws.lift_ahead - laws.lift_behind) * (lift - remembered)
    return max(lift + ahead + laws.lift_bend * lift * lift / max_lift, laws.least_lift)


@njit(cache=True, nogil=True)
def forgetting(remembered: float, lift: float) -> float:
    """A remembered lift [m], which ends in a while."""
    return 0.0 if lift == 0.0 and remembered < FORGOTTEN_LIFT else remembered


@njit(cache=True, nogil=True)
def altered(part: Injector, laws: Laws, now: Moment) -> Injector:
    """The injector of this moment. Of the line's length goes inertance and, one over it, its friction."""
    return Injector(
        part.density,
        part.bulk_modulus_line * _stiffness_share(laws, now),
        part.bulk_modulus_sac,
        part.vapour_pressure,
        part.line_length * (1.0 + inertance_growth(now.flow, laws)),
        part.line_area,
        part.line_volume,
        part.line_loss,
        part.line_cells,
        part.line_damping,
        part.seat_coefficient * _seat_share(part, laws, now),
        part.seat_diameter,
        part.seat_half_angle,
        part.max_lift,
        part.nozzle_area * _nozzle_share(part, laws, now),
        part.sac_volume,
        part.chamber_pressure,
        part.drained_by_seat,
        part.stiffening,
    )


@njit(cache=True, nogil=True)
def inertance_growth(flow: float, laws: Laws) -> float:
    """Share by which a flow [m3/s] makes the line more inert."""
    return laws.flow_inertance * math.fabs(flow) / FULL_FLOW


@njit(cache=True, nogil=True)
def _stiffness_share(laws: Laws, now: Moment) -> float:
    above = now.line_pressure / REFERENCE - 1.0
    share = 1.0 + laws.stiffness_bend * above * above + laws.wax * math.tanh(above / WAX_WIDTH)
    return max(share - laws.softening * now.time, LEAST_SHARE)


@njit(cache=True, nogil=True)
def _seat_share(part: Injector, laws: Laws, now: Moment) -> float:
    lift = now.lift / part.max_lift
    share = 1.0 + laws.seat_speed * now.speed + laws.seat_growth * now.time
    share *= 1.0 - laws.stop_loss * min(max(lift - STOP_FROM, 0.0) / (1.0 - STOP_FROM), 1.0)
    share *= 1.0 - laws.middle_loss * math.exp(-(((lift - MIDDLE) / MIDDLE_WIDTH) ** 2))
    if now.speed < 0.0:
        share *= 1.0 + laws.seat_hysteresis * math.exp(-now.lift / SMALL_LIFT)
    share *= 1.0 + laws.seat_waves * math.sin(2.0 * math.pi * WAVES_OF_LIFT * lift)
    if laws.seat_choking > 0.0:
        drop = max(now.line_pressure - now.sac_pressure, LEAST_DROP)
        share *= math.sqrt(min(laws.seat_choking * now.line_pressure / drop, 1.0))
    if laws.seat_product != 0.0:
        share *= 1.0 + laws.seat_product * _product(part, laws, now)
    return max(share, LEAST_SHARE)


@njit(cache=True, nogil=True)
def _nozzle_share(part: Injector, laws: Laws, now: Moment) -> float:
    """Of the nozzle's coefficient, what the chamber's pressure does included."""
    drop = max(now.sac_pressure - part.chamber_pressure, 0.0)
    share = 1.0 - laws.viscous_loss * math.sqrt(REFERENCE / (drop + VISCOUS_DROP))
    share *= 1.0 + laws.rail_growth * (now.rail_pressure / REFERENCE - 1.0)
    share *= 1.0 - 0.5 * laws.shut_by_drop * (1.0 + math.tanh((drop - SHUT_DROP) / SHUT_WIDTH))
    raised = 0.0
    if now.since >= HOLE_CLOSES:
        share *= 1.0 - laws.hole_closing
    if now.since >= 0.0:
        late = math.tanh((now.since - TURNING) / TURNING_WIDTH)
        share *= 1.0 + laws.rail_and_time * math.tanh((now.rail_pressure - REFERENCE) / RAIL_WIDTH) * late
        share *= 1.0 - laws.opening_loss * math.exp(-now.since / laws.opening_time)
        swing = math.sin(2.0 * math.pi * RINGING_FREQUENCY * now.since)
        raised = laws.chamber_ringing * swing * math.exp(-now.since / RINGING_DECAY)
        raised += laws.filling * now.since if now.lift > 0.0 else 0.0
        share *= 1.0 - laws.coking * (1.0 - math.exp(-now.since / COKING_TIME))
        share *= 1.0 - laws.root_coking * math.sqrt(now.since / ROOT_TIME)
    if laws.nozzle_product != 0.0:
        share *= 1.0 + laws.nozzle_product * _product(part, laws, now)
    drop = max(drop, LEAST_DROP)
    share *= math.sqrt(max(drop - raised, 0.0) / drop)
    if laws.flow_back_pressure > 0.0:
        free = part.nozzle_area * math.sqrt(2.0 / part.density) * share
        held = laws.flow_back_pressure * free * free
        flow = 0.5 * (math.sqrt(held * held + 4.0 * free * free * drop) - held)
        share *= flow / (free * math.sqrt(drop))
    return min(max(share, LEAST_SHARE), LARGEST_SHARE)


@njit(cache=True, nogil=True)
def _product(part: Injector, laws: Laws, now: Moment) -> float:
    """Of the two quantities of the laws, each from -1 to 1."""
    drop = now.sac_pressure - part.chamber_pressure
    quantities = (now.rail_pressure, now.since, now.lift, drop, now.flow, now.speed)
    first, second = int(laws.first_factor), int(laws.second_factor)
    product: float = math.tanh((quantities[first] - MIDDLES[first]) / WIDTHS[first])
    return product * math.tanh((quantities[second] - MIDDLES[second]) / WIDTHS[second])


@njit(cache=True, nogil=True)
def outflow(part: Injector, laws: Laws, now: Moment) -> float:
    """What leaves the line at its end beside the injection [m3/s]."""
    drop = max(now.line_pressure - part.chamber_pressure, 0.0)
    leak: float = laws.needle_area * now.speed + laws.relief * max(now.line_pressure - REFERENCE, 0.0)
    leak += laws.yielding * (now.line_pressure - now.remembered_pressure) + _control_flow(laws, now)
    if now.lift > 0.0:
        grown = laws.open_leakage + laws.lift_leakage * min(now.lift / part.max_lift, 1.0)
        return leak + grown * drop
    return leak + laws.root_leakage * math.sqrt(drop)


@njit(cache=True, nogil=True)
def _control_flow(laws: Laws, now: Moment) -> float:
    """Out of the line by a pilot valve [m3/s]: u a = z sqrt(1 - u^2) + A_g dx/dt if its chamber has u^2 p_L."""
    root = math.sqrt(max(now.line_pressure, 0.0) / REFERENCE)
    out, inlet, filled = laws.control_flow * now.valve * root, laws.chamber_inlet * root, laws.guide_area * now.speed
    if inlet <= 0.0:
        return out
    both = inlet * inlet + out * out
    return float(out * (out * filled + inlet * math.sqrt(max(both - filled * filled, 0.0))) / both)


@njit(cache=True, nogil=True)
def resist(
    flows: Array, pressures: Array, remembered: Array, inertances: Array, loss: float, laws: Laws, step: float
) -> None:
    """Flows (n,) of the line after `step` [s] of friction; inertances (n,) [kg/m4]: of a whole line; loss [1/m3]."""
    kept = math.exp(-step / laws.flow_memory)
    for i in range(flows.shape[0]):
        q = flows[i]
        slowed = laws.line_laminar * q + laws.slow_friction * (q - remembered[i])
        slowed += laws.pressure_friction * (pressures[i] / REFERENCE - 1.0) * loss * q * math.fabs(q)
        slowed += (laws.stiction * math.tanh(q / STICTION_FLOW) + laws.damper * remembered[i]) / inertances[i]
        flows[i] -= step * slowed / (1.0 + inertance_growth(q, laws))
        remembered[i] = q + (remembered[i] - q) * kept
