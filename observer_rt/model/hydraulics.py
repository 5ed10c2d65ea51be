"""Seat, sac and nozzle, (21)-(23): flows through the areas a lift opens, the orifice law they share, slopes."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inlined
from observer_rt.model.parameters import Departures, InjectorParameters

TRANSITION_PRESSURE = 0.5e6  # Pa, below which the orifice laws turn linear


def jet_velocity(parameters: InjectorParameters) -> float:
    """Velocity of a jet at p_0 [m/s]."""
    return math.sqrt(2 * parameters.scaling.pressure / parameters.fluid.density_nozzle)


@inlined
def root(difference: float, transition: float) -> float:
    """Signed square root of a pressure difference, smooth through zero.

    d / (d^2 + t^2)^(1/4): sgn(d) sqrt|d| for |d| >> t, linear below the transition pressure t, so that the
    orifice laws (21), (23) hold for reversed flow and have a bounded slope 1/sqrt(t).
    """
    return difference / math.sqrt(math.sqrt(difference * difference + transition * transition))


@compiled
def root_slope(difference: float, transition: float) -> float:
    """Derivative of `root` with respect to the pressure difference."""
    square = difference * difference
    sum_of_squares = square + transition * transition
    return (sum_of_squares - 0.5 * square) / (sum_of_squares * math.sqrt(math.sqrt(sum_of_squares)))


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


class Nozzle(NamedTuple):
    """Coefficients of the nozzle."""

    transition: float  # of the orifice law, in units of p_0
    flow: float  # Q_H = flow * root(x_3), m3/s
    critical_excess: float  # N_crit - 1, 0 without cavitation
    vapour_margin: float  # (p_C - p_v)/p_0
    chamber_rise: float  # of p_C while the needle is open, in units of p_0
    chamber_rise_with_seat: float  # the same for every unit of u_2


def nozzle_of(parameters: InjectorParameters, departures: Departures) -> Nozzle:
    """The nozzle of an injector."""
    p_0 = parameters.scaling.pressure
    nozzle = parameters.nozzle
    return Nozzle(
        transition=TRANSITION_PRESSURE / p_0,
        flow=nozzle.flow_coefficient * nozzle.area * jet_velocity(parameters),
        critical_excess=departures.critical_excess,
        vapour_margin=(parameters.chamber.pressure - parameters.fluid.vapour_pressure) / p_0,
        chamber_rise=departures.chamber_rise / p_0,
        chamber_rise_with_seat=departures.chamber_rise_with_seat
        / p_0
        * parameters.scaling.area
        / full_lift_area(parameters),
    )


@inlined
def nozzle_law(x_3: float, u_2: float, back_pressure: float, nozzle: Nozzle) -> float:
    """Normalised nozzle flow q_H of (23), against a chamber pressure that rises while the needle is open (u_2 > 0).

    It rises by what the model knows and by `back_pressure`, in units of p_0.
    Where the cavitation number N = (p_S - p_v)/(p_S - p_C) is below N_crit, the flow coefficient falls by
    sqrt(N/N_crit): the flow then follows sqrt(p_S - p_v) (Nurick 1976, J. Fluids Eng. 98, 681).
    """
    difference, margin = x_3, nozzle.vapour_margin
    rise = nozzle.chamber_rise + nozzle.chamber_rise_with_seat * u_2 + back_pressure
    if rise != 0.0 and u_2 > 0.0:
        difference -= rise
        margin += rise
    flow: float = root(difference, nozzle.transition)
    if nozzle.critical_excess != 0.0 and margin < nozzle.critical_excess * difference:
        flow *= math.sqrt((1.0 + margin / difference) / (1.0 + nozzle.critical_excess))
    return flow


@compiled
def nozzle_law_slopes(x_3: float, u_2: float, back_pressure: float, nozzle: Nozzle) -> tuple[float, float]:
    """Derivatives of `nozzle_law` with respect to x_3 and to the back-pressure.

    That with respect to u_2 is `nozzle.chamber_rise_with_seat` times the latter.
    """
    difference, margin = x_3, nozzle.vapour_margin
    if u_2 > 0.0:
        rise = nozzle.chamber_rise + nozzle.chamber_rise_with_seat * u_2 + back_pressure
        difference -= rise
        margin += rise
    slope: float = root_slope(difference, nozzle.transition)
    if nozzle.critical_excess != 0.0 and margin < nozzle.critical_excess * difference:
        critical = 1.0 + nozzle.critical_excess
        loss = math.sqrt((1.0 + margin / difference) / critical)
        flow: float = root(difference, nozzle.transition)
        by_margin = flow / (2.0 * critical * loss * difference)
        slope = slope * loss - by_margin * margin / difference
        return slope, by_margin - slope if u_2 > 0.0 else 0.0
    return slope, -slope if u_2 > 0.0 else 0.0


EMPTY_SAC = 1e-7  # of p_0: a shut, drained sac this close to chamber pressure is at it


class Sac(NamedTuple):
    """Coefficients of the sac [1/s]; the law is linear, they are its slopes."""

    a5: float  # filled through the seat
    a6: float  # drained through the nozzle


def sac_of(parameters: InjectorParameters, nozzle_flow: float, seat_flow: float) -> Sac:
    """The sac of an injector; nozzle_flow, seat_flow: Q_H and Q_S [m3/s] at a normalised flow of 1."""
    stiffness = parameters.fluid.bulk_modulus_sac / parameters.nozzle.sac_volume / parameters.scaling.pressure
    return Sac(stiffness * seat_flow, stiffness * nozzle_flow)


@inlined
def sac_rate(q_h: float, q_s: float, sac: Sac) -> float:
    """p_S' of (22), normalised [1/s]."""
    return sac.a5 * q_s - sac.a6 * q_h


@inlined
def empty_if_drained(
    x: NDArray[np.float64], u_start: tuple[float, float], u_end: tuple[float, float], tangent: Any
) -> None:
    """A sac that has drained behind a shut needle is at exactly chamber pressure."""
    if u_start[1] <= 0.0 and u_end[1] <= 0.0 and math.fabs(x[2]) < EMPTY_SAC:
        empty_sac(x, tangent)


@inlined
def empty_sac(x: NDArray[np.float64], tangent: Any) -> None:
    """p_S is at chamber pressure, whatever the parameters."""
    x[2] = 0.0
    if tangent is not None:
        tangent.by[2, :] = 0.0
