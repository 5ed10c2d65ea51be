"""Laws that effects change: nozzle flow, seat area, stiffness of the line; with their slopes."""

import math

from numba import njit

from observer_rt.model.coefficients import Coefficients
from observer_rt.model.laws import root, root_slope, seat_area

LOWEST_PRESSURE = 0.01  # of p_0, at which entrained air is taken to soften the line no further
LOWEST_STIFFNESS = 0.05  # of K_L, below which a pressure-dependent bulk modulus does not fall


@njit(cache=True, nogil=True, inline="always")
def nozzle_law(x_3: float, u_2: float, back_pressure: float, c: Coefficients) -> float:
    """Normalised nozzle flow q_H of (23), against a chamber pressure that rises while the needle is open (u_2 > 0).

    It rises by what the model knows and by `back_pressure`, in units of p_0.
    Where the cavitation number N = (p_S - p_v)/(p_S - p_C) is below N_crit, the flow coefficient falls by
    sqrt(N/N_crit): the flow then follows sqrt(p_S - p_v) (Nurick 1976, J. Fluids Eng. 98, 681).
    """
    difference, margin = x_3, c.vapour_margin
    rise = c.chamber_rise + back_pressure
    if rise != 0.0 and u_2 > 0.0:
        difference -= rise
        margin += rise
    flow: float = root(difference, c.transition)
    if c.critical_excess != 0.0 and margin < c.critical_excess * difference:
        flow *= math.sqrt((1.0 + margin / difference) / (1.0 + c.critical_excess))
    return flow


@njit(cache=True, nogil=True)
def nozzle_law_slopes(x_3: float, u_2: float, back_pressure: float, c: Coefficients) -> tuple[float, float]:
    """Derivatives of `nozzle_law` with respect to x_3 and to the back-pressure."""
    difference, margin = x_3, c.vapour_margin
    if u_2 > 0.0:
        difference -= c.chamber_rise + back_pressure
        margin += c.chamber_rise + back_pressure
    slope: float = root_slope(difference, c.transition)
    if c.critical_excess != 0.0 and margin < c.critical_excess * difference:
        critical = 1.0 + c.critical_excess
        loss = math.sqrt((1.0 + margin / difference) / critical)
        flow: float = root(difference, c.transition)
        by_margin = flow / (2.0 * critical * loss * difference)
        slope = slope * loss - by_margin * margin / difference
        return slope, by_margin - slope if u_2 > 0.0 else 0.0
    return slope, -slope if u_2 > 0.0 else 0.0


@njit(cache=True, nogil=True)
def normalised_area(lift: float, c: Coefficients) -> float:
    """u_2 = A_S(x_N)/A_0 of a lift [m]; a flow coefficient that depends on the lift is part of it."""
    area: float = seat_area(lift, c.seat_diameter, c.half_cone_angle) / c.area_scale
    if c.seat_loss != 0.0:
        area *= 1.0 - c.seat_loss * math.exp(-lift / c.seat_loss_lift)
    return area


@njit(cache=True, nogil=True, inline="always")
def _fuel_stiffness(x_1: float, c: Coefficients) -> float:
    """K(p_L)/K_L of the fuel without air."""
    if c.stiffness_slope == 0.0:
        return 1.0
    return max(1.0 + c.stiffness_slope * (x_1 - c.stiffness_pressure), LOWEST_STIFFNESS)


@njit(cache=True, nogil=True, inline="always")
def line_stiffness(x_1: float, c: Coefficients) -> float:
    """K_eff/K_L of the line at the normalised pressure x_1: 1/K_eff = 1/K(p_L) + g/p_L."""
    fuel: float = _fuel_stiffness(x_1, c)
    if c.air == 0.0:
        return fuel
    pressure = max(x_1 + c.chamber_pressure / c.pressure_scale, LOWEST_PRESSURE)
    return fuel * (pressure / (pressure + fuel * c.air))


@njit(cache=True, nogil=True)
def line_stiffness_slopes(x_1: float, c: Coefficients) -> tuple[float, float]:
    """Derivatives of `line_stiffness` with respect to x_1 and to the air term."""
    fuel: float = _fuel_stiffness(x_1, c)
    pressure = max(x_1 + c.chamber_pressure / c.pressure_scale, LOWEST_PRESSURE)
    square = (pressure + fuel * c.air) ** 2
    by_pressure = fuel * fuel * c.air / square
    if fuel > LOWEST_STIFFNESS:
        by_pressure += c.stiffness_slope * pressure * pressure / square
    return by_pressure, -fuel * fuel * pressure / square
