"""The orifice law that seat and nozzle share, smooth through zero."""

import math

from observer_rt.foundation.compiled import compiled, inlined
from observer_rt.model.parameters import InjectorParameters

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
