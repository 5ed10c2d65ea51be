"""The normalised coefficients of (25), from physical parameters."""

import math
from typing import NamedTuple

from numba import njit

from observer_rt.model.laws import seat_area
from observer_rt.model.parameters import InjectorParameters, LineOutflow

TRANSITION_PRESSURE = 0.5e6  # Pa, below which the orifice laws turn linear
STIFFNESS_PRESSURE = 100e6  # Pa, at which a pressure-dependent bulk modulus is K_L


class Departures(NamedTuple):
    """What an injector may do for which (19)-(23) have no parameter; SI, all off by default."""

    leakage: float = 0.0  # c, m3/(s Pa): p_L' gets -K_L/V_L c (p_L - p_C)
    air: float = 0.0  # g of 1/K_eff = 1/K + g/p, in the line
    stiffness_slope: float = 0.0  # n of K = K_L + n (p_L - 100 MPa), in the line
    critical_excess: float = 0.0  # N_crit - 1: the nozzle cavitates below the cavitation number N_crit
    chamber_rise: float = 0.0  # Pa, of p_C in (23) while the needle is open
    seat_loss: float = 0.0  # a of alpha_S (1 - a exp(-x_N/x_c))
    seat_loss_lift: float = 50e-6  # x_c, m


NO_DEPARTURES = Departures()


class Coefficients(NamedTuple):
    """What the compiled right-hand side needs; rates in 1/s for states normalised by (24).

    The line is drained by `a2_nozzle` q_H + `a2_seat` q_S: one of them is 0 (`line_outflow`).
    """

    a1: float  # line inflow
    a2_nozzle: float  # line drained by the nozzle flow, the paper's a2
    a2_seat: float  # line drained by the seat flow, the mass-conserving form
    a3: float  # line inertia
    a4: float  # line friction
    a5: float  # sac filled through the seat
    a6: float  # sac drained through the nozzle
    leak: float  # line drained by p_L - p_C, 0 for a tight injector
    air: float  # K g / p_0: how much entrained air softens the line, 0 without any
    compression: float  # p_0/K_L, of the nominal line
    transition: float  # of the orifice laws, in units of p_0
    nozzle_flow: float  # Q_H = nozzle_flow * root(x3), m3/s
    pressure_scale: float  # p_0, Pa
    flow_scale: float  # Q_0, m3/s
    area_scale: float  # A_0, m2
    chamber_pressure: float  # p_C, Pa
    seat_diameter: float  # d_S, m
    half_cone_angle: float  # rad
    density: float  # rho_C, kg/m3, turns injected volume into mass
    stiffness_slope: float  # n p_0/K_L: how K_L grows with the line pressure, 0 when it does not
    stiffness_pressure: float  # where it is K_L, normalised as x_1
    critical_excess: float  # N_crit - 1, 0 without cavitation
    vapour_margin: float  # (p_C - p_v)/p_0
    chamber_rise: float  # of p_C while the needle is open, in units of p_0
    seat_loss: float  # a of alpha_S (1 - a exp(-x_N/x_c)), 0 for a constant coefficient
    seat_loss_lift: float  # x_c, m


def coefficients(parameters: InjectorParameters, departures: Departures = NO_DEPARTURES) -> Coefficients:
    """Coefficients a1..a6 of (25) and the scalings of (24) for an injector.

    Effects in force in `parameters` are not looked at: see `effects.effective_model`.
    """
    fluid, line, seat, nozzle = parameters.fluid, parameters.line, parameters.seat, parameters.nozzle
    p_0, q_0, area_0 = parameters.scaling.pressure, parameters.scaling.flow, parameters.scaling.area
    line_stiffness = fluid.bulk_modulus_line / line.volume / p_0  # K_L/(V_L p_0), 1/m3
    sac_stiffness = fluid.bulk_modulus_sac / nozzle.sac_volume / p_0  # K_C/(V_S p_0), 1/m3
    velocity = math.sqrt(2 * p_0 / fluid.density_nozzle)  # of a jet at p_0, m/s
    nozzle_flow = nozzle.flow_coefficient * nozzle.area * velocity
    seat_flow = seat.flow_coefficient * area_0 * velocity
    drained_by_nozzle = parameters.line_outflow is LineOutflow.NOZZLE
    return Coefficients(
        a1=line_stiffness * q_0,
        a2_nozzle=line_stiffness * nozzle_flow if drained_by_nozzle else 0.0,
        a2_seat=0.0 if drained_by_nozzle else line_stiffness * seat_flow,
        a3=line.area * p_0 / (fluid.density_line * line.length * q_0),
        a4=line.loss_factor * q_0 / (2 * line.area * line.length),
        a5=sac_stiffness * seat_flow,
        a6=sac_stiffness * nozzle_flow,
        leak=line_stiffness * departures.leakage * p_0,
        air=departures.air * fluid.bulk_modulus_line / p_0,
        compression=p_0 / fluid.bulk_modulus_line,
        transition=TRANSITION_PRESSURE / p_0,
        nozzle_flow=nozzle_flow,
        pressure_scale=p_0,
        flow_scale=q_0,
        area_scale=area_0,
        chamber_pressure=parameters.chamber.pressure,
        seat_diameter=seat.diameter,
        half_cone_angle=math.radians(seat.cone_angle / 2),
        density=fluid.density_nozzle,
        stiffness_slope=departures.stiffness_slope * p_0 / fluid.bulk_modulus_line,
        stiffness_pressure=(STIFFNESS_PRESSURE - parameters.chamber.pressure) / p_0,
        critical_excess=departures.critical_excess,
        vapour_margin=(parameters.chamber.pressure - fluid.vapour_pressure) / p_0,
        chamber_rise=departures.chamber_rise / p_0,
        seat_loss=departures.seat_loss,
        seat_loss_lift=departures.seat_loss_lift,
    )


def full_lift_area(parameters: InjectorParameters) -> float:
    """Seat area A_S at the needle's stop [m2]."""
    seat = parameters.seat
    return float(seat_area(seat.max_lift, seat.diameter, math.radians(seat.cone_angle / 2)))


class LineTerms(NamedTuple):
    """Learned departures of line and guide from the model in force; all 0 when there are none.

    friction k: loss factor times 1 + k; leakage: flow past the guide at p_0, in units of Q_0; stiffness r: bulk
    modulus of the line times 1 + r; air: K g / p_0 of 1/K_eff = 1/K + g/p.
    """

    friction: float
    leakage: float
    stiffness: float
    air: float


@njit(cache=True, nogil=True)
def with_line_terms(c: Coefficients, terms: LineTerms) -> Coefficients:
    """Coefficients of an injector with these line terms."""
    stiffer = 1.0 + terms.stiffness
    return Coefficients(
        c.a1 * stiffer,
        c.a2_nozzle * stiffer,
        c.a2_seat * stiffer,
        c.a3,
        c.a4 * (1.0 + terms.friction),
        c.a5,
        c.a6,
        c.leak * stiffer + c.a1 * stiffer * terms.leakage,
        c.air + terms.air,
        c.compression,
        c.transition,
        c.nozzle_flow,
        c.pressure_scale,
        c.flow_scale,
        c.area_scale,
        c.chamber_pressure,
        c.seat_diameter,
        c.half_cone_angle,
        c.density,
        c.stiffness_slope,
        c.stiffness_pressure,
        c.critical_excess,
        c.vapour_margin,
        c.chamber_rise,
        c.seat_loss,
        c.seat_loss_lift,
    )
