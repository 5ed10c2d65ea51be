"""A second feed line: three lumps in series, each with a third of the volume and of the length.

x = [p_L at the closed end, Q_L into it, p_S, p_1, Q_1, p_2, Q_2]; Q_2 comes from the rail. Coefficients are those of
one of the three; the guide leaks from the one at the closed end.
"""

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import expm

from observer_rt.model.line.interface import Slopes, register
from observer_rt.model.line.lump import LumpLine, stiffness, stiffness_slopes

if TYPE_CHECKING:
    from observer_rt.model.parameters import Departures, InjectorParameters

SLOWEST, FASTEST = (2.0 * math.sin(k * math.pi / 14) for k in (1, 5))  # of a chain of three, in sqrt(a1 a3)


@njit(cache=True, nogil=True, inline="always")
def rates(
    x: tuple[float, ...], rail: float, q_h: float, q_s: float, line: "ThreeLumps"
) -> tuple[float, float, float, float, float, float]:
    """p_L', Q_L', p_1', Q_1', p_2', Q_2' [1/s]."""
    return (
        stiffness(x[0], line)
        * (line.a1 * x[1] - line.a2_nozzle * q_h - line.a2_seat * q_s - line.leak * x[0]),
        line.a3 * (x[3] - x[0]) - line.a4 * x[1] * math.fabs(x[1]),
        stiffness(x[3], line) * line.a1 * (x[4] - x[1]),
        line.a3 * (x[5] - x[3]) - line.a4 * x[4] * math.fabs(x[4]),
        stiffness(x[5], line) * line.a1 * (x[6] - x[4]),
        line.a3 * (rail - x[5]) - line.a4 * x[6] * math.fabs(x[6]),
    )


@njit(cache=True, nogil=True)
def slopes(
    x: tuple[float, ...], rail: float, q_h: float, q_s: float, line: "ThreeLumps", result: Slopes
) -> None:
    """Derivatives of `rates`."""
    soft = stiffness(x[0], line)
    outflow = line.a2_nozzle * q_h + line.a2_seat * q_s + line.leak * x[0]
    _lump(0, (x[0], x[1], 0.0), (0, 1, -1), outflow, line, result)
    result.by_state[0, 0] -= soft * line.leak
    _lump(3, (x[3], x[4], x[1]), (3, 4, 1), line.a1 * x[1], line, result)
    _lump(5, (x[5], x[6], x[4]), (5, 6, 4), line.a1 * x[4], line, result)
    _flow(1, x[1], 0, 3, x[3] - x[0], line, result)
    _flow(4, x[4], 3, 5, x[5] - x[3], line, result)
    _flow(6, x[6], 5, -1, rail - x[5], line, result)
    result.by_rail[6] = line.a3
    result.by_flow[0, 0] = -soft * line.a2_nozzle
    result.by_flow[0, 1] = -soft * line.a2_seat
    result.by_coefficient[0, _A2_NOZZLE] = -soft * q_h
    result.by_coefficient[0, _A2_SEAT] = -soft * q_s
    result.by_coefficient[0, _LEAK] = -soft * x[0]


@njit(cache=True, nogil=True)
def _lump(
    row: int,
    values: tuple[float, float, float],
    places: tuple[int, int, int],
    outflow: float,
    line: "ThreeLumps",
    result: Slopes,
) -> None:
    """A volume's row: its pressure, the flow in, the flow out if that is a state."""
    soft = stiffness(values[0], line)
    by_pressure, by_air, by_slope = stiffness_slopes(values[0], line)
    net = line.a1 * values[1] - outflow
    result.by_state[row, row] = by_pressure * net
    result.by_state[row, places[1]] = soft * line.a1
    if places[2] >= 0:
        result.by_state[row, places[2]] = -soft * line.a1
    result.by_coefficient[row, _A1] = soft * (values[1] - values[2])
    result.by_coefficient[row, _AIR] = by_air * net
    result.by_coefficient[row, _STIFFNESS_SLOPE] = by_slope * net


@njit(cache=True, nogil=True)
def _flow(
    row: int, flow: float, after: int, before: int, drop: float, line: "ThreeLumps", result: Slopes
) -> None:
    """A flow's row: the pressures after and before it, the rail's being none."""
    result.by_state[row, after] = -line.a3
    if before >= 0:
        result.by_state[row, before] = line.a3
    result.by_state[row, row] = -2.0 * line.a4 * math.fabs(flow)
    result.by_coefficient[row, _A3] = drop
    result.by_coefficient[row, _A4] = -flow * math.fabs(flow)


@njit(cache=True, nogil=True, inline="always")
def fastest(line: "ThreeLumps") -> float:
    """Neighbours against each other [rad/s]."""
    return FASTEST * math.sqrt(line.a1 * line.a3)


@njit(cache=True, nogil=True)
def rest(x: NDArray[np.float64], pressure: float) -> None:
    """No flow, one pressure."""
    x[0] = x[3] = x[5] = pressure
    x[1] = x[4] = x[6] = 0.0


class ThreeLumps(LumpLine):
    """See `interface.Line`; what changes a coefficient changes that of every lump."""

    __slots__ = ()
    further = 4
    rates = staticmethod(rates)
    slopes = staticmethod(slopes)
    fastest = staticmethod(fastest)
    rest = staticmethod(rest)

    @classmethod
    def of(
        cls, parameters: "InjectorParameters", departures: "Departures", nozzle_flow: float, seat_flow: float
    ) -> "ThreeLumps":
        """A third of volume, length and loss each: all but the friction of (25) threefold."""
        whole = LumpLine.of(parameters, departures, nozzle_flow, seat_flow)
        threefold = {
            name: 3.0 * getattr(whole, name) for name in ("a1", "a2_nozzle", "a2_seat", "a3", "leak")
        }
        return cls(*whole._replace(**threefold))

    @property
    def mode(self) -> float:
        """A quarter wave along the three."""
        return SLOWEST * math.sqrt(self.a1 * self.a3)

    @property
    def impedance(self) -> float:
        """Amplitude of p_L over that of x_2."""
        return self.a1 / self.mode

    def transition(self, interval: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Exact without friction: the exponential of the chain with the rail as a seventh, constant state."""
        chain = np.zeros((7, 7))
        for row in (0, 2, 4):
            chain[row, row + 1] = self.a1
            chain[row + 1, row] = -self.a3
            chain[row + 1, row + 2] = self.a3
        for row in (2, 4):
            chain[row, row - 1] = -self.a1
        moved = expm(interval * chain)
        return moved[:6, :6], moved[:6, 6]


_A1, _A2_NOZZLE, _A2_SEAT, _A3, _A4, _LEAK, _AIR, _STIFFNESS_SLOPE = (
    ThreeLumps._fields.index(name)
    for name in ("a1", "a2_nozzle", "a2_seat", "a3", "a4", "leak", "air", "stiffness_slope")
)
register("three_lumps", ThreeLumps)
