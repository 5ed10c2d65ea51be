"""The feed line as one lump, (19)-(20): a flow with inertia and friction into one volume."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inlined, inner
from observer_rt.model.line.interface import Slopes, no_slopes, register

if TYPE_CHECKING:
    from observer_rt.model.parameters import Departures, InjectorParameters

STIFFNESS_PRESSURE = 100e6  # Pa, at which a pressure-dependent bulk modulus is K_L
LOWEST_PRESSURE = 0.01  # of p_0, at which entrained air is taken to soften the line no further
LOWEST_STIFFNESS = 0.05  # of K_L, below which a pressure-dependent bulk modulus does not fall


@inlined
def _fuel_stiffness(x_1: float, line: "LumpLine") -> float:
    """K(p_L)/K_L of the fuel without air."""
    if line.stiffness_slope == 0.0:
        return 1.0
    return max(1.0 + line.stiffness_slope * (x_1 - line.stiffness_pressure), LOWEST_STIFFNESS)


@inlined
def stiffness(x_1: float, line: "LumpLine") -> float:
    """K_eff/K_L at the normalised pressure x_1: 1/K_eff = 1/K(p_L) + g/p_L."""
    fuel: float = _fuel_stiffness(x_1, line)
    if line.air == 0.0:
        return fuel
    pressure = max(x_1 + line.chamber_pressure, LOWEST_PRESSURE)
    return fuel * (pressure / (pressure + fuel * line.air))


@inner
def stiffness_slopes(x_1: float, line: "LumpLine") -> tuple[float, float, float]:
    """Derivatives of `stiffness` with respect to x_1, to `air` and to `stiffness_slope`."""
    fuel: float = _fuel_stiffness(x_1, line)
    absolute = x_1 + line.chamber_pressure
    pressure = max(absolute, LOWEST_PRESSURE)
    square = (pressure + fuel * line.air) ** 2
    by_fuel = pressure * pressure / square if fuel > LOWEST_STIFFNESS else 0.0
    by_pressure = fuel * fuel * line.air / square if absolute > LOWEST_PRESSURE else 0.0
    return (
        by_pressure + by_fuel * line.stiffness_slope,
        -fuel * fuel * pressure / square,
        by_fuel * (x_1 - line.stiffness_pressure),
    )


@inlined
def rates(
    x: tuple[float, float, float], rail: float, q_h: float, q_s: float, line: "LumpLine"
) -> tuple[float, float]:
    """p_L' of (20) and Q_L' of (19), normalised [1/s]."""
    return (
        stiffness(x[0], line)
        * (line.a1 * (x[1] - line.outflow) - line.a2_nozzle * q_h - line.a2_seat * q_s - line.leak * x[0]),
        line.a3 * (rail - line.loss - x[0]) - line.a4 * x[1] * math.fabs(x[1]),
    )


@compiled
def slopes(
    x: tuple[float, float, float], rail: float, q_h: float, q_s: float, line: "LumpLine", result: Slopes
) -> None:
    """Derivatives of `rates`; of the coefficients, of those that anything changes."""
    soft = stiffness(x[0], line)
    by_pressure, by_air, by_slope = stiffness_slopes(x[0], line)
    inflow = line.a1 * (x[1] - line.outflow) - line.a2_nozzle * q_h - line.a2_seat * q_s - line.leak * x[0]
    result.by_state[0, 0] = by_pressure * inflow - soft * line.leak
    result.by_state[0, 1] = soft * line.a1
    result.by_state[1, 0] = -line.a3
    result.by_state[1, 1] = -2.0 * line.a4 * math.fabs(x[1])
    result.by_rail[1] = line.a3
    result.by_flow[0, 0] = -soft * line.a2_nozzle
    result.by_flow[0, 1] = -soft * line.a2_seat
    result.by_coefficient[0, _A1] = soft * (x[1] - line.outflow)
    result.by_coefficient[0, _A2_NOZZLE] = -soft * q_h
    result.by_coefficient[0, _A2_SEAT] = -soft * q_s
    result.by_coefficient[0, _LEAK] = -soft * x[0]
    result.by_coefficient[0, _AIR] = by_air * inflow
    result.by_coefficient[0, _STIFFNESS_SLOPE] = by_slope * inflow
    result.by_coefficient[1, _A3] = rail - line.loss - x[0]
    result.by_coefficient[1, _A4] = -x[1] * math.fabs(x[1])


@inlined
def fastest(line: "LumpLine") -> float:
    """Of inertia against compliance [rad/s]."""
    return math.sqrt(line.a1 * line.a3)


@compiled
def rest(x: NDArray[np.float64], pressure: float) -> None:
    """No flow, p_L = pressure."""
    x[0], x[1] = pressure, 0.0


class _LumpCoefficients(NamedTuple):
    """Coefficients a1..a4 of (25) and what departs from it."""

    a1: float  # line inflow, 1/s
    a2_nozzle: (
        float  # line drained by the nozzle flow, the paper's a2; 0 in the form that the seat flow drains
    )
    a2_seat: float  # line drained by the seat flow, the mass-conserving form
    a3: float  # line inertia
    a4: float  # line friction
    leak: float  # line drained by p_L - p_C, 0 for a tight injector
    air: float  # K g / p_0: how much entrained air softens the line, 0 without any
    stiffness_slope: float  # n p_0/K_L: how K_L grows with the line pressure, 0 when it does not
    stiffness_pressure: float  # where it is K_L, normalised as x_1
    chamber_pressure: float  # p_C/p_0
    outflow: float = 0.0  # of the end, by terms, in units of Q_0
    loss: float = 0.0  # of pressure along the line, by terms, in units of p_0


class LumpLine(_LumpCoefficients):
    """See `interface.Line`."""

    __slots__ = ()
    further = 0
    of_stiffness = ("a1", "a2_nozzle", "a2_seat", "leak")
    of_inertance = ("a3", "a4")
    rates = staticmethod(rates)
    slopes = staticmethod(slopes)
    fastest = staticmethod(fastest)
    averaged = False
    resolved = 0.0
    rest = staticmethod(rest)

    @classmethod
    def of(
        cls, parameters: "InjectorParameters", departures: "Departures", nozzle_flow: float, seat_flow: float
    ) -> "LumpLine":
        """See `interface.Line.of`."""
        fluid, line, scaling = parameters.fluid, parameters.line, parameters.scaling
        compliance = fluid.bulk_modulus_line / line.volume / scaling.pressure  # K_L/(V_L p_0), 1/m3
        drained_by_nozzle = parameters.line_outflow == "nozzle"
        return cls(
            a1=compliance * scaling.flow,
            a2_nozzle=compliance * nozzle_flow if drained_by_nozzle else 0.0,
            a2_seat=0.0 if drained_by_nozzle else compliance * seat_flow,
            a3=line.area * scaling.pressure / (fluid.density_line * line.length * scaling.flow),
            a4=line.loss_factor * scaling.flow / (2 * line.area * line.length),
            leak=compliance * departures.leakage * scaling.pressure,
            air=departures.air * fluid.bulk_modulus_line / scaling.pressure,
            stiffness_slope=departures.stiffness_slope * scaling.pressure / fluid.bulk_modulus_line,
            stiffness_pressure=(STIFFNESS_PRESSURE - parameters.chamber.pressure) / scaling.pressure,
            chamber_pressure=parameters.chamber.pressure / scaling.pressure,
        )

    @property
    def mode(self) -> float:
        """The only one there is."""
        return float(fastest(self))

    @property
    def impedance(self) -> float:
        """Amplitude of p_L over that of x_2."""
        return math.sqrt(self.a1 / self.a3)

    @property
    def by_rail(self) -> NDArray[np.float64]:
        """See `interface.Line`."""
        found = no_slopes(self)
        type(self).slopes((0.0,) * (3 + self.further), 0.0, 0.0, 0.0, self, found)
        return found.by_rail

    def further_variance(self, flow: float) -> NDArray[np.float64]:
        """There are none."""
        return np.zeros(self.further)

    def transition(self, interval: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Exact without friction."""
        angle = self.mode * interval
        cosine, sine, impedance = math.cos(angle), math.sin(angle), self.impedance
        return (
            np.array([[cosine, impedance * sine], [-sine / impedance, cosine]]),
            np.array([1.0 - cosine, sine / impedance]),
        )

    def substeps(self, of_sac: int, interval: float) -> int:
        """Those: RK4 steps both."""
        return of_sac

    def strain(self, interval: float) -> float:
        """It has no steps of its own."""
        return 0.0

    def stepping(self, interval: float) -> str:
        """It has no steps of its own."""
        return ""

    def with_friction(self, k: float) -> "LumpLine":
        """See `interface.Line`."""
        return self._replace(a4=self.a4 * (1.0 + k))

    def with_leakage(self, c: float) -> "LumpLine":
        """See `interface.Line`."""
        return self._replace(leak=self.leak + self.a1 * c)

    def with_stiffness(self, r: float) -> "LumpLine":
        """See `interface.Line`."""
        return self._replace(**{name: getattr(self, name) * (1.0 + r) for name in self.of_stiffness})

    def with_air(self, g: float) -> "LumpLine":
        """See `interface.Line`."""
        return self._replace(air=self.air + g)

    def with_mean(self) -> "MeanLumpLine":
        """See `interface.Line`."""
        return MeanLumpLine(*self)


@inlined
def mean_rates(
    x: tuple[float, float, float, float], rail: float, q_h: float, q_s: float, line: "MeanLumpLine"
) -> tuple[float, float, float]:
    """`rates`, and p_L, whose integral is the last state."""
    of_line = rates(x, rail, q_h, q_s, line)
    return of_line[0], of_line[1], x[0]


@compiled
def mean_slopes(
    x: tuple[float, float, float, float],
    rail: float,
    q_h: float,
    q_s: float,
    line: "MeanLumpLine",
    result: Slopes,
) -> None:
    """Derivatives of `mean_rates`."""
    slopes(x, rail, q_h, q_s, line, result)
    result.by_state[3, 0] = 1.0


class MeanLumpLine(LumpLine):
    """The same with the integral of p_L [s] as its last state."""

    __slots__ = ()
    further = 1
    averaged = True
    rates = staticmethod(mean_rates)
    slopes = staticmethod(mean_slopes)

    def transition(self, interval: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Exact without friction, of an integral that begins anew."""
        of_line, rail = super().transition(interval)
        angle, impedance = self.mode * interval, self.impedance
        matrix = np.zeros((3, 3))
        matrix[:2, :2] = of_line
        matrix[2, :2] = math.sin(angle) / self.mode, impedance * (1.0 - math.cos(angle)) / self.mode
        return matrix, np.append(rail, interval - math.sin(angle) / self.mode)


_A1, _A2_NOZZLE, _A2_SEAT, _A3, _A4, _LEAK, _AIR, _STIFFNESS_SLOPE = (
    LumpLine._fields.index(name)
    for name in ("a1", "a2_nozzle", "a2_seat", "a3", "a4", "leak", "air", "stiffness_slope")
)
register("lump", LumpLine)
