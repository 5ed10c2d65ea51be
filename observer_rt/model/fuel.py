"""Fuel under pressure: how its bulk modulus and its density follow, and fuels that an injector file can name.

    K(p, T) = K_0 + s (T - T_0) + K_1 p        rho(p) = rho_0 (1 + K_1 p/K_0)^(1/K_1), for d rho/dp = rho/K

K_1 = 0 is the paper's fuel, of one stiffness and one density whatever the pressure.

Volume is counted at rho_0, the density without pressure, wherever a flow passes: Q is the mass flow over rho_0. So
mass is rho_0 times the integral of Q, the line's inertance rho_0 L/A stays, and a volume V fills by

    p' = M(p)/V (sum of Q)        M(p) = K(p) rho_0/rho(p)

Into a pressure p_2 a hole passes what Bernoulli's equation gives, at the density there:

    Q = alpha A rho(p_2)/rho_0 (2 integral of dp/rho from p_2 to p_1)^(1/2)

Compiled code has a parabola of the local pressure for M and for each hole, within .2 % of these laws from 0 to
240 MPa; the seat's takes the density in the sac. Only friction has one density, that at 100 MPa: it is up to 4 % off.
Together that is .06 % of the mass.
"""

from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

USUAL_PRESSURE = 100e6  # Pa, to which the numbers of a line belong
HIGHEST_PRESSURE = 240e6  # Pa, of the closed end of a line at 200 MPa when a needle shuts: no fuel gets stiffer
_THROUGH = (20e6, 100e6, 200e6)  # Pa, where a parabola is exact besides its origin


class Fuel(NamedTuple):
    """How a fuel yields to pressure [Pa]."""

    modulus: float  # K_0, Pa
    by_pressure: float  # K_1, -

    def stiffness(self, pressure: float) -> float:
        """K(p), Pa."""
        return self.modulus + self.by_pressure * pressure

    def density(self, pressure: float) -> float:
        """rho(p)/rho_0."""
        if self.by_pressure == 0.0:
            return 1.0
        return float((self.stiffness(pressure) / self.modulus) ** (1.0 / self.by_pressure))

    def filling(self, pressure: float) -> float:
        """M(p), Pa."""
        return self.stiffness(pressure) / self.density(pressure)

    def jet(self, behind: float, drop: float) -> float:
        """Velocity of a jet into a pressure, over that of fuel as dense all along its way as there."""
        if self.by_pressure == 0.0 or drop == 0.0:
            return 1.0
        stiffness = self.stiffness(behind)
        power = 1.0 - 1.0 / self.by_pressure
        spent = ((1.0 + self.by_pressure * drop / stiffness) ** power - 1.0) / power  # K_1 rho/K integral of dp/rho
        return float((spent * stiffness / (self.by_pressure * drop)) ** 0.5)


class Parabola(NamedTuple):
    """A law of pressure as value (1 + slope d + bend d2), d from an origin in units of the pressure scale."""

    value: float
    slope: float
    bend: float


def parabola(law: Callable[[float], float], origin: float, scale: float) -> Parabola:
    """The parabola that has a law's value at an origin [Pa] and at two other pressures; scale: p_0 [Pa]."""
    value = law(origin)
    near, far = sorted(_THROUGH, key=lambda at: abs(at - origin))[-2:]
    ends = [(at - origin) / scale for at in (near, far)]
    secants = [(law(at) / value - 1.0) / end for at, end in zip((near, far), ends, strict=True)]
    bend = (secants[1] - secants[0]) / (ends[1] - ends[0])
    return Parabola(value, secants[0] - bend * ends[0], bend)


class FuelName(StrEnum):
    """`fluid.fuel` of an injector file."""

    ISO4113 = "iso4113"
    EN590 = "en590"
    N_DODECANE = "n-dodecane"
    RME = "rme"
    HVO = "hvo"


class _Row(NamedTuple):
    density: float  # rho_0, kg/m3, at 313.15 K
    modulus: float  # K_0, Pa, isentropic, at 313.15 K; the straight line through 20 to 180 MPa
    by_pressure: float  # K_1, -
    thermal_expansion: float  # 1/K
    by_temperature: float  # Pa/K
    vapour_pressure: float  # Pa


_REFERENCE = 313.15  # K
# n-dodecane is computed, to 1 % of K from 20 to 180 MPa: equation of state of Lemmon and Huber, Energy & Fuels 18
# (2004) 960. The others are rounded after what the literature named reports of such fuels; batches differ by 2 % of
# rho_0 and 5 % of K_0, so that a sample of one's own knows better. Their K_1 is that of hydrocarbons, 10 to 11.
_FUELS = {
    # Chorazewski et al., Fuel 105 (2013) 440: Normafluid, to 140 MPa
    FuelName.ISO4113: _Row(808.0, 1.41e9, 10.5, 8.3e-4, -7.5e6, 1e3),
    # Dzida and Prusakiewicz, Fuel 87 (2008) 1941: to 101 MPa; Tat and Van Gerpen, JAOCS 80 (2003) 1127
    FuelName.EN590: _Row(817.0, 1.46e9, 10.5, 8.3e-4, -8.0e6, 1e3),
    FuelName.N_DODECANE: _Row(734.6, 1.145e9, 10.75, 1.0e-3, -8.1e6, 58.0),
    # Dzida and Prusakiewicz, as above: methyl esters of rape
    FuelName.RME: _Row(864.0, 1.60e9, 10.5, 8.4e-4, -8.5e6, 1.0),
    # density: EN 15940, class A; stiffness below diesel's: Lapuerta et al., Energy & Fuels 26 (2012) 1336
    FuelName.HVO: _Row(763.0, 1.29e9, 10.5, 9.0e-4, -7.8e6, 1e3),
}


def fluid_of(name: str, stated: dict[str, object]) -> dict[str, object]:
    """`[fluid]` of a named fuel, with the keys that a file states; `reference_temperature` is that of its fuel."""
    if name not in tuple(FuelName):  # which the field of the name says
        return stated
    row = _FUELS[FuelName(name)]
    laws = {
        "reference_temperature": _REFERENCE,
        "thermal_expansion": row.thermal_expansion,
        "bulk_modulus_slope": row.by_temperature,
        "bulk_modulus_by_pressure": row.by_pressure,
        "vapour_pressure": row.vapour_pressure,
        **stated,
    }
    numbers = [laws[key] for key in ("reference_temperature", "thermal_expansion", "bulk_modulus_slope")]
    temperature, expansion, slope = (float(n) if isinstance(n, int | float) else 0.0 for n in numbers)
    warmer = temperature - _REFERENCE
    density, modulus = row.density * (1.0 - expansion * warmer), row.modulus + slope * warmer
    return {
        **dict.fromkeys(("density_line", "density_nozzle"), density),
        **dict.fromkeys(("bulk_modulus_line", "bulk_modulus_sac"), modulus),
        **laws,
    }
