"""What a model of the feed line is, and how compiled code finds the one at hand.

A line is one class: a NamedTuple of its coefficients with its laws as attributes. Compiled functions that are given
coefficients dispatch on that class, so the code of a line is as if it were the only one, and others cost nothing.

The whole state is x = [p_L at the closed end, Q_L into it, p_S, the line's further states], normalised by (24).
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numba.extending import overload
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

if TYPE_CHECKING:
    from observer_rt.model.parameters import Departures, InjectorParameters


class Slopes(NamedTuple):
    """Derivatives of x' [1/s] of n states; every row but p_S's is filled by the line."""

    by_state: NDArray[np.float64]  # (n, n)
    by_rail: NDArray[np.float64]  # (n,)
    by_flow: NDArray[np.float64]  # (n, 2): q_H, q_S
    by_coefficient: NDArray[np.float64]  # (n, k), k coefficients of the line


def no_slopes(line: Any) -> Slopes:
    """Slopes of 0, to be filled."""
    n = 3 + line.further
    return Slopes(np.zeros((n, n)), np.zeros(n), np.zeros((n, 2)), np.zeros((n, len(line._fields))))


class Line(Protocol):
    """The class of a line; its fields are numbers. Its closed end obeys p_L' ~ a1 x_2 - a2_nozzle q_H - a2_seat q_S.

    rates(x, p_R, q_H, q_S, line): x' [1/s] of its states, a tuple; slopes(x, p_R, q_H, q_S, line, result): the
    derivatives of `rates` into `Slopes` that hold 0, but for by_state what an earlier call may have left;
    fastest(line): the angular frequency [rad/s] its steps must follow; rest(x, pressure): the array x (n,) with the
    line at rest. All are compiled. A line with a step of its own (`step_by`) has no
    rates, and its fastest is 0.
    """

    of_stiffness: ClassVar[tuple[str, ...]]  # coefficients in proportion to the bulk modulus
    of_inertance: ClassVar[tuple[str, ...]]  # in inverse proportion to the inertance
    averaged: ClassVar[bool]  # its last state is the integral of p_L [s], see `begin_mean`
    resolved: ClassVar[float]  # s over which means of p_L are a pipe's, shorter waves are not; 0: it has none
    rates: ClassVar[Callable[..., Any]]
    slopes: ClassVar[Callable[..., Any]]
    fastest: ClassVar[Callable[..., Any]]
    rest: ClassVar[Callable[..., Any]]
    _fields: ClassVar[tuple[str, ...]]
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
        """What must stay below 1 for the line's own steps in an interval [s] to be stable."""

    def stepping(self, interval: float) -> str:
        """How the line's own steps resolve it, for an engineer to read; empty of one that RK4 steps."""

    def with_friction(self, k: float) -> "Line":
        """Loss factor times 1 + k."""

    def with_leakage(self, c: float) -> "Line":
        """Flow past the guide at p_0, in units of Q_0."""

    def with_stiffness(self, r: float) -> "Line":
        """Bulk modulus times 1 + r."""

    def with_air(self, g: float) -> "Line":
        """K g / p_0 of 1/K_eff = 1/K + g/p added."""

    def with_mean(self) -> "Line":
        """The same line, averaged: for samples that are means."""


class OwnStep(NamedTuple):
    """How a line and the sac at its end are stepped, where RK4 does not. Both compiled."""

    over: Any  # as `integrator.advance_over`, which empties a drained sac after it
    fine: Any  # as `integrator.fine_step`


_LINES: dict[str, type[Line]] = {}
_OWN_STEPS: dict[type[Line], OwnStep] = {}


def register(name: str, line: type[Any]) -> None:
    """Make a line model known under the name `line.model` chooses it by."""
    _LINES[name] = line


def step_by(line: type[Any], step: OwnStep) -> None:
    """Make known how a class of lines, and those derived from it, are stepped."""
    _OWN_STEPS[line] = step


def own_step(line: type[Any]) -> OwnStep | None:
    """How a class of lines is stepped; None where RK4 does."""
    return next((_OWN_STEPS[each] for each in line.__mro__ if each in _OWN_STEPS), None)


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


def line_rates(x: Any, rail: float, q_h: float, q_s: float, line: Any) -> Any:
    """x' [1/s] of the states of a line."""
    return type(line).rates(x, rail, q_h, q_s, line)


@overload(line_rates, strict=False)
def _line_rates(x: Any, rail: Any, q_h: Any, q_s: Any, line: Any) -> Any:
    rates = line.instance_class.rates
    return lambda x, rail, q_h, q_s, line: rates(x, rail, q_h, q_s, line)


def line_slopes(x: Any, rail: float, q_h: float, q_s: float, line: Any, result: Slopes) -> None:
    """Derivatives of `line_rates` into the rows of the line's states."""
    type(line).slopes(x, rail, q_h, q_s, line, result)


@overload(line_slopes, strict=False)
def _line_slopes(x: Any, rail: Any, q_h: Any, q_s: Any, line: Any, result: Any) -> Any:
    slopes = line.instance_class.slopes
    return lambda x, rail, q_h, q_s, line, result: slopes(x, rail, q_h, q_s, line, result)


def line_fastest(line: Any) -> float:
    """Angular frequency [rad/s] the steps of a line must follow."""
    return float(type(line).fastest(line))


@overload(line_fastest, strict=False)
def _line_fastest(line: Any) -> Any:
    fastest = line.instance_class.fastest
    return lambda line: fastest(line)


def rest_line(x: NDArray[np.float64], pressure: float, line: Any) -> None:
    """The line's states in x (n,) become those of a line at rest at a normalised pressure."""
    type(line).rest(x, pressure)


@overload(rest_line, strict=False)
def _rest_line(x: Any, pressure: Any, line: Any) -> Any:
    rest = line.instance_class.rest
    return lambda x, pressure, line: rest(x, pressure)


def line_from(values: NDArray[np.float64], line: Any) -> Any:
    """A line of the class of `line` with coefficients from an array (k,)."""
    return type(line)(*values)


@overload(line_from, strict=False)
def _line_from(values: Any, line: Any) -> Any:
    kind, size = line.instance_class, len(line.fields)
    return lambda values, line: kind(*to_fixed_tuple(values, size))


def begin_mean(x: NDArray[np.float64], tangent: Any, line: Any) -> None:
    """Let the integral of p_L, where a line has it, begin anew in x (n,); tangent: as of `integrator.advance`.

    For compiled code.
    """
    raise NotImplementedError


@overload(begin_mean, strict=False)
def _begin_mean(x: Any, tangent: Any, line: Any) -> Any:
    if not line.instance_class.averaged:
        return lambda x, tangent, line: None

    def clear(x: Any, tangent: Any, line: Any) -> None:
        x[-1] = 0.0
        if tangent is not None:
            tangent.by[-1, :] = 0.0

    return clear
