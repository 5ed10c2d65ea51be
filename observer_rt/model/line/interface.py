"""Interface of a model of the feed line: the class of its coefficients. Its laws are in core.model, by kind.

The whole state is x = [p_L at the closed end, Q_L into it, p_S, the line's further states], normalised by (24).
"""

from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from observer_rt.model.parameters import Departures, InjectorParameters


class Line(Protocol):
    """A line as numbers, its fields. Its closed end obeys p_L' ~ a1 x_2 - a2_nozzle q_H - a2_seat q_S."""

    kind: ClassVar[int]  # by which the core steps it: a number of `core/model/interval.pxi`
    of_stiffness: ClassVar[tuple[str, ...]]  # coefficients in proportion to the bulk modulus
    of_inertance: ClassVar[tuple[str, ...]]  # in inverse proportion to the inertance
    averaged: ClassVar[bool]  # its last state is the integral of p_L [s], see `begin_mean`
    resolved: ClassVar[float]  # s over which means of p_L are a pipe's, shorter waves are not; 0: it has none
    _fields: ClassVar[tuple[str, ...]]
    a4: float  # in proportion to the loss factor
    leak: float  # past the guide at p_0, in units of Q_0, times a1
    air: float  # K g / p_0 of 1/K_eff = 1/K + g/p
    servo: float  # control flow at p_0, in units of Q_0, times a1
    displaced: float  # by 1 m/s of the needle, likewise
    outflow: float  # of its closed end, in units of Q_0, as terms change it
    loss: float  # of pressure along it, in units of p_0, as terms change it

    @property
    def further(self) -> int:
        """States beyond p_L and Q_L."""

    @property
    def a1(self) -> float: ...
    @property
    def a2_nozzle(self) -> float: ...
    @property
    def a2_seat(self) -> float: ...

    @classmethod
    def of(
        cls, parameters: "InjectorParameters", departures: "Departures", nozzle_flow: float, seat_flow: float
    ) -> "Line":
        """The line of an injector; nozzle_flow, seat_flow: Q_H and Q_S [m3/s] at a normalised flow of 1."""

    @property
    def mode(self) -> float:
        """Angular frequency [rad/s] of the line's slowest motion, which p_L mostly shows."""

    @property
    def fastest(self) -> float:
        """Angular frequency [rad/s] that RK4 must follow; 0 of a line with steps of its own."""

    @property
    def impedance(self) -> float:
        """p_L that goes with an x_2 of 1 in that motion."""

    @property
    def by_rail(self) -> NDArray[np.float64]:
        """Derivative of x' [1/s] with respect to the rail pressure, (states,)."""

    def further_variance(self, flow: float) -> NDArray[np.float64]:
        """Variances of the further states of a line that rings; flow: that of x_2."""

    def transition(self, interval: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The line at rest over an interval [s]: its states' (m, m) matrix, the effect of the rail pressure (m,)."""

    def substeps(self, of_sac: int, interval: float) -> int:
        """Steps of the sac in a sample interval [s]; of_sac: those that RK4 would need for it."""

    def strain(self, interval: float) -> float:
        """Number that must stay below 1 for the line's own steps in an interval [s] to be stable."""

    def stepping(self, interval: float) -> str:
        """Description of the resolution of the line's own steps, for an engineer; empty of one that RK4 steps."""

    def with_mean(self) -> "Line":
        """Line averaged over the sample period, for samples that are means."""


def stiffened(line: Any, r: float) -> Any:
    """A line whose bulk modulus is 1 + r times what it was."""
    return line._replace(**{name: getattr(line, name) * (1.0 + r) for name in line.of_stiffness})


_LINES: dict[str, type[Line]] = {}


def register(name: str, line: type[Any]) -> None:
    """Make a line model known under the name `line.model` chooses it by."""
    _LINES[name] = line


def known_line(name: str) -> str:
    """The name. Raises `ValueError` where no line has it."""
    if name not in _LINES:
        raise ValueError(f"there is no such line; known are {', '.join(sorted(_LINES))}")
    return name


def line_of(
    parameters: "InjectorParameters", departures: "Departures", nozzle_flow: float, seat_flow: float
) -> Line:
    """The line an injector's file names, see `Line.of`."""
    return _LINES[parameters.line.model].of(parameters, departures, nozzle_flow, seat_flow)
