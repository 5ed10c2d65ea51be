"""Fuel under pressure: its bulk modulus and its density.

    K(p, T) = K_0 + s (T - T_0) + K_1 p        rho(p) = rho_0 (1 + K_1 p/K_0)^(1/K_1), for d rho/dp = rho/K

K_1 = 0 is the paper's fuel, of one stiffness and one density. Every volume is counted at rho_0, the density without
pressure: Q is the mass flow over rho_0. So mass is rho_0 times the integral of Q, the line's inertance rho_0 L/A
stays, and a volume V fills by

    p' = M(p)/V (sum of Q)        M(p) = K(p) rho_0/rho(p)

Into a pressure p_2 a hole passes what Bernoulli's equation gives, at the density there:

    Q = alpha A rho(p_2)/rho_0 (2 integral of dp/rho from p_2 to p_1)^(1/2)

Compiled code has a parabola of the local pressure for M and for each hole, within .2 % of these laws from 0 to
240 MPa; the seat's takes the density in the sac. Only friction has one density, that at 100 MPa: it is up to 4 % off.
Together that is .06 % of the mass.
"""

from collections.abc import Callable
from typing import NamedTuple

USUAL_PRESSURE = 100e6  # Pa, to which the numbers of a line belong
HIGHEST_PRESSURE = 240e6  # Pa, of the closed end of a line at 200 MPa when a needle shuts: no fuel gets stiffer


class Compressibility(NamedTuple):
    """Law by which a fuel yields to pressure [Pa]."""

    modulus: float  # K_0, Pa
    by_pressure: float  # K_1, -

    def stiffness(self, pressure: float) -> float:
        """Bulk modulus K(p) [Pa]."""
        return self.modulus + self.by_pressure * pressure

    def density(self, pressure: float) -> float:
        """Density over that without pressure, rho(p)/rho_0."""
        k_1 = self.by_pressure
        return (1.0 + k_1 * pressure / self.modulus) ** (1.0 / k_1) if k_1 > 0.0 else 1.0

    def filling(self, pressure: float) -> float:
        """Stiffness M(p) [Pa] of a volume that is filled with fuel counted at rho_0."""
        return self.stiffness(pressure) / self.density(pressure)

    def jet(self, behind: float, before: float) -> float:
        """Velocity of a jet into a pressure behind it, over that of fuel as dense all along its way as there."""
        far, near, middle = (1.0 / self.density(p) for p in (before, behind, 0.5 * (before + behind)))
        return float(((far + 4.0 * middle + near) / (6.0 * near)) ** 0.5)  # Simpson's rule


def parabola(law: Callable[[float], float], origin: float, scale: float) -> tuple[float, float, float]:
    """Value, slope and bend of a law of pressure as value (1 + slope d + bend d^2), d from an origin [Pa].

    Exact there and at two more pressures; scale: p_0 [Pa], the unit of d.
    """
    value, (first, second) = law(origin), (100e6 if origin < 50e6 else 20e6, 200e6)
    near, far = (first - origin) / scale, (second - origin) / scale
    secants = (law(first) / value - 1.0) / near, (law(second) / value - 1.0) / far
    bend = (secants[1] - secants[0]) / (far - near)
    return value, secants[0] - bend * near, bend
