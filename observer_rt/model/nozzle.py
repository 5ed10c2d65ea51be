"""The nozzle: its flow (23) with cavitation and a chamber pressure that rises, and its slopes."""

import math
from typing import NamedTuple

from observer_rt.foundation.compiled import compiled, inlined
from observer_rt.model.departures import Departures
from observer_rt.model.orifice import TRANSITION_PRESSURE, jet_velocity, root, root_slope
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.seat import full_lift_area


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
