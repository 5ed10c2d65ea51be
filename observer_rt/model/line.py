"""The feed line as one lump, (19)-(20), and the closed end that all lines share; laws are in core.model.

x = [p_L at the closed end, Q_L into it, p_S, the line's further states], by (24). `line.model` of the injector file
chooses a model (`LINES` of `effective.py`); all have `LumpLine`'s members. Waves are in `wave_line.py`.
"""

import math
from typing import Any

import numpy as np

from observer_rt.core.model import model
from observer_rt.foundation.units import Floats
from observer_rt.model.fuel import USUAL_PRESSURE, parabola
from observer_rt.model.hydraulics import CONTROL_REFERENCE
from observer_rt.model.parameters import Departures, InjectorParameters


def stiffened(line: Any, r: float) -> Any:
    """A line whose bulk modulus is 1 + r times that of `line`."""
    return line._replace(**{name: getattr(line, name) * (1.0 + r) for name in line.of_stiffness})


def at_closed_end(
    parameters: InjectorParameters, departures: Departures, stiffness: float, nozzle_flow: float, seat_flow: float
) -> dict[str, float]:
    """Coefficients of any line's closed end, where p_L rises by stiffness [p_0/m3]; flows: as of `LumpLine.of`."""
    scale, chamber, fuel = parameters.scaling, parameters.chamber.pressure, parameters.fluid.in_line
    modulus = fuel.stiffness(USUAL_PRESSURE)
    _, slope, bend = parabola(fuel.filling, USUAL_PRESSURE, scale.pressure)
    drained_by_nozzle, line = parameters.line_outflow == "nozzle", parameters.line
    return {
        "a1": stiffness * scale.flow,
        "a2_nozzle": stiffness * nozzle_flow if drained_by_nozzle else 0.0,
        "a2_seat": 0.0 if drained_by_nozzle else stiffness * seat_flow,
        "leak": stiffness * departures.leakage * scale.pressure,
        "air": departures.air * modulus / scale.pressure,
        "stiffness_slope": departures.stiffness_slope * scale.pressure / modulus + slope,
        "stiffness_bend": bend,
        "stiffness_pressure": (USUAL_PRESSURE - chamber) / scale.pressure,
        "chamber_pressure": chamber / scale.pressure,
        "control_flow": stiffness * ((line.control_flow or 0.0) * math.sqrt(scale.pressure / CONTROL_REFERENCE)),
        "displaced": stiffness * (line.displacement or 0.0),
        "expelled": stiffness * (line.control_displacement or 0.0),
        "outflow": 0.0,  # terms alone set this and the next
        "loss": 0.0,
    }


class LumpLine(model.LumpLine):
    """A line as numbers: a1..a4 of (25) and departures; its end obeys p_L' ~ a1 x_2 - a2_nozzle q_H - a2_seat q_S."""

    __slots__ = ()
    kind = model.LUMP  # number by which `core/model/interval.pxi` chooses the steps
    further = 0  # states beyond p_L and Q_L
    of_stiffness = ("a1", "a2_nozzle", "a2_seat", "leak", "control_flow", "displaced", "expelled")  # go with K_L
    of_inertance = ("a3", "a4")  # in inverse proportion to the inertance
    averaged = False  # its last state is the integral of p_L [s], see `begin_mean`
    resolved = 0.0  # s, below which waves are not those of a pipe; 0: there are no waves

    @classmethod
    def of(
        cls, parameters: InjectorParameters, departures: Departures, nozzle_flow: float, seat_flow: float
    ) -> "LumpLine":
        """The line of an injector; nozzle_flow, seat_flow: Q_H and Q_S [m3/s] at a normalised flow of 1."""
        fluid, line, scaling = parameters.fluid, parameters.line, parameters.scaling
        compliance = fluid.in_line.filling(USUAL_PRESSURE) / line.volume / scaling.pressure  # K_L/(V_L p_0), 1/m3
        return cls(
            **at_closed_end(parameters, departures, compliance, nozzle_flow, seat_flow),
            a3=line.area * scaling.pressure / (fluid.density_line * line.length * scaling.flow),
            a4=line.loss_factor
            * scaling.flow
            / (2 * line.area * line.length)
            / fluid.in_line.density(USUAL_PRESSURE),
        )

    @property
    def mode(self) -> float:
        """Angular frequency [rad/s] of the line's slowest motion, which p_L mostly shows."""
        return math.sqrt(self.a1 * self.a3)

    @property
    def fastest(self) -> float:
        """Angular frequency [rad/s] that RK4 must resolve; 0 for a line with steps of its own."""
        return self.mode

    @property
    def impedance(self) -> float:
        """Amplitude of p_L over that of x_2 in the motion of `mode`."""
        return math.sqrt(self.a1 / self.a3)

    @property
    def by_rail(self) -> Floats:
        """Derivative of x' [1/s] with respect to the rail pressure, (states,)."""
        result = np.zeros(3 + self.further)
        result[1] = self.a3
        return result

    def further_variance(self, flow: float) -> Floats:
        """Variances (further,) of the further states of a line that rings; flow: variance of x_2."""
        return np.zeros(self.further)

    def transition(self, interval: float) -> tuple[Floats, Floats]:
        """The line at rest over an interval [s] (exact without friction): matrix (m, m), rail's effect (m,)."""
        angle = self.mode * interval
        cosine, sine, impedance = math.cos(angle), math.sin(angle), self.impedance
        return (
            np.array([[cosine, impedance * sine], [-sine / impedance, cosine]]),
            np.array([1.0 - cosine, sine / impedance]),
        )

    def substeps(self, of_sac: int, interval: float) -> int:
        """Steps of the sac in a sample interval [s]; of_sac: those that RK4 would need for it."""
        return of_sac

    def strain(self, interval: float) -> float:
        """Number that must stay below 1 for the line's own steps in an interval [s] to be stable; 0 without such."""
        return 0.0

    def stepping(self, interval: float) -> str:
        """Description of the resolution of the line's own steps, for an engineer; empty of one that RK4 steps."""
        return ""

    def with_mean(self) -> "MeanLumpLine":
        """Line averaged over the sample period, for samples that are means."""
        return MeanLumpLine(*self)


class MeanLumpLine(LumpLine):
    """Lump line with the integral of p_L [s] as its last state."""

    __slots__ = ()
    further = 1
    averaged = True

    def transition(self, interval: float) -> tuple[Floats, Floats]:
        """As of `LumpLine`, with an integral that begins anew as the last state."""
        of_line, rail = super().transition(interval)
        angle, impedance = self.mode * interval, self.impedance
        matrix = np.zeros((3, 3))
        matrix[:2, :2] = of_line
        matrix[2, :2] = math.sin(angle) / self.mode, impedance * (1.0 - math.cos(angle)) / self.mode
        return matrix, np.append(rail, interval - math.sin(angle) / self.mode)
