"""The needle seat: its flow (21), the area a lift opens, and their slopes."""

import math
from typing import NamedTuple

from observer_rt.foundation.compiled import compiled, inlined
from observer_rt.model.departures import Departures
from observer_rt.model.orifice import TRANSITION_PRESSURE, jet_velocity, root, root_slope
from observer_rt.model.parameters import InjectorParameters


class Seat(NamedTuple):
    """Coefficients of the seat."""

    transition: float  # of the orifice law, in units of p_0
    area_scale: float  # A_0, m2
    diameter: float  # d_S, m
    half_cone_angle: float  # rad
    loss: float  # a of alpha_S (1 - a exp(-x_N/x_c)), 0 for a constant coefficient
    loss_lift: float  # x_c, m


def seat_of(parameters: InjectorParameters, departures: Departures) -> Seat:
    """The seat of an injector."""
    return Seat(
        transition=TRANSITION_PRESSURE / parameters.scaling.pressure,
        area_scale=parameters.scaling.area,
        diameter=parameters.seat.diameter,
        half_cone_angle=math.radians(parameters.seat.cone_angle / 2),
        loss=departures.seat_loss,
        loss_lift=departures.seat_loss_lift,
    )


def seat_flow_scale(parameters: InjectorParameters) -> float:
    """Q_S [m3/s] through the area A_0 at p_0."""
    return parameters.seat.flow_coefficient * parameters.scaling.area * jet_velocity(parameters)


def full_lift_area(parameters: InjectorParameters) -> float:
    """Seat area A_S at the needle's stop [m2]."""
    seat = parameters.seat
    return float(seat_area(seat.max_lift, seat.diameter, math.radians(seat.cone_angle / 2)))


@inlined
def seat_law(x_1: float, x_3: float, u_2: float, seat: Seat) -> float:
    """Normalised seat flow q_S of (21)."""
    flow: float = u_2 * root(x_1 - x_3, seat.transition)
    return flow


@compiled
def seat_law_slopes(x_1: float, x_3: float, u_2: float, seat: Seat) -> tuple[float, float]:
    """Derivatives of `seat_law` with respect to the pressure difference x_1 - x_3 and to u_2."""
    difference = x_1 - x_3
    return u_2 * root_slope(difference, seat.transition), root(difference, seat.transition)


@compiled
def seat_area(lift: float, seat_diameter: float, half_cone_angle: float) -> float:
    """Flow area of the needle seat A_S(x_N) [m2]; 0 for a closed needle.

    pi x_N sin(b/2) (d_S - x_N/2 sin b), with b/2 the half cone angle [rad]; lift and diameter in m.
    """
    if lift <= 0.0:
        return 0.0
    return (
        math.pi
        * lift
        * math.sin(half_cone_angle)
        * (seat_diameter - 0.5 * lift * math.sin(2.0 * half_cone_angle))
    )


@compiled
def seat_area_slope(u_2: float, seat: Seat) -> float:
    """Derivative dA_S/dx_N [m] of `seat_area` at the lift that opens u_2 = A_S/A_0; 0 for a closed needle."""
    if u_2 <= 0.0:
        return 0.0
    whole = math.pi * math.sin(seat.half_cone_angle)
    square = seat.diameter**2 - 2.0 * math.sin(2.0 * seat.half_cone_angle) * (u_2 * seat.area_scale) / whole
    return whole * math.sqrt(max(square, 0.0))


@compiled
def normalised_area(lift: float, seat: Seat) -> float:
    """u_2 = A_S(x_N)/A_0 of a lift [m]; a flow coefficient that depends on the lift is part of it."""
    area: float = seat_area(lift, seat.diameter, seat.half_cone_angle) / seat.area_scale
    if seat.loss != 0.0:
        area *= 1.0 - seat.loss * math.exp(-lift / seat.loss_lift)
    return area
