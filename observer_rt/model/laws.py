"""The laws of single elements: orifice flow, seat area."""

import math

from numba import njit


@njit(cache=True, nogil=True, inline="always")
def root(difference: float, transition: float) -> float:
    """Signed square root of a pressure difference, smooth through zero.

    d / (d^2 + t^2)^(1/4): sgn(d) sqrt|d| for |d| >> t, linear below the transition pressure t, so that the
    orifice laws (21), (23) hold for reversed flow and have a bounded slope 1/sqrt(t).
    """
    return difference / math.sqrt(math.sqrt(difference * difference + transition * transition))


@njit(cache=True, nogil=True)
def root_slope(difference: float, transition: float) -> float:
    """Derivative of `root` with respect to the pressure difference."""
    square = difference * difference
    sum_of_squares = square + transition * transition
    return (sum_of_squares - 0.5 * square) / (sum_of_squares * math.sqrt(math.sqrt(sum_of_squares)))


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def seat_area_slope(area: float, seat_diameter: float, half_cone_angle: float) -> float:
    """Derivative dA_S/dx_N [m] of `seat_area` at the lift that opens `area` [m2]; 0 for a closed needle."""
    if area <= 0.0:
        return 0.0
    whole = math.pi * math.sin(half_cone_angle)
    square = seat_diameter**2 - 2.0 * math.sin(2.0 * half_cone_angle) * area / whole
    return whole * math.sqrt(max(square, 0.0))
