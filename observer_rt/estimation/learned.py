"""What a parameter vector theta means: network, line and sensor; and how it acts on the model's coefficients."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.sensitivity import Parameter
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.network import HIDDEN, Network, constant_network, zero_network
from observer_rt.model.right_hand_side import ByTheta
from observer_rt.model.sensor import LAG_UNIT

_BACK_PRESSURE = int(Parameter.BACK_PRESSURE)
_TINY = 1e-100  # step of a complex derivative, which loses nothing by being small


class LineLaw(NamedTuple):
    """A learned scalar of line or guide: its column of theta, and the line with it; analytic in the scalar."""

    column: int
    change: Callable[[Any, Any], Any]


LINE_LAWS = [
    LineLaw(Parameter.BULK_MODULUS, lambda line, r: line.with_stiffness(r)),
    LineLaw(Parameter.LINE_FRICTION, lambda line, k: line.with_friction(k)),
    LineLaw(Parameter.GUIDE_LEAKAGE, lambda line, c: line.with_leakage(c)),
    LineLaw(Parameter.ENTRAINED_AIR, lambda line, g: line.with_air(g)),
]
"""In the order in which they change the line."""


class Learned(NamedTuple):
    """theta taken apart: phi's network, the coefficients with the line's terms, sensor offset [p_0] and lag [s]."""

    network: Network
    coefficients: Coefficients
    offset: float
    lag: float


def nothing_learned(c: Coefficients) -> Learned:
    """The model in force as it is."""
    return Learned(constant_network(), c, 0.0, 0.0)


def learned_of(theta: NDArray[np.float64], c: Coefficients) -> Learned:
    """Meaning of a parameter vector (PARAMETERS,) on a model without it."""
    changed = c._replace(line=_changed(c.line, theta.tolist()))
    offset, lag = float(theta[Parameter.LINE_PRESSURE_OFFSET]), float(theta[Parameter.SENSOR_LAG])
    return Learned(network_of(theta), changed, offset, lag * LAG_UNIT)


def network_of(theta: NDArray[np.float64]) -> Network:
    """The network in a parameter vector (PARAMETERS,)."""
    network = zero_network()._replace(back_pressure=theta[_BACK_PRESSURE : _BACK_PRESSURE + 2].copy())
    network.output[0, :] = theta[Parameter.NOZZLE_WEIGHT : Parameter.NOZZLE_WEIGHT + HIDDEN]
    network.bias[:] = theta[[Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS]]
    return network


def by_theta(theta: NDArray[np.float64], c: Coefficients) -> ByTheta:
    """How theta (PARAMETERS,) acts on a model without it: where the network's parameters stand, the line's slopes.

    The slopes are those of the laws themselves, by complex steps.
    """
    values = theta.tolist()
    found: list[tuple[int, int, float]] = []
    for law in LINE_LAWS:
        stepped = values.copy()
        stepped[law.column] = complex(values[law.column], _TINY)
        for number, coefficient in enumerate(_changed(c.line, stepped)):
            slope = coefficient.imag / _TINY
            if slope != 0.0:
                found.append((law.column, number, slope))
    columns, numbers, slopes = zip(*found, strict=True)
    return ByTheta(
        int(Parameter.NOZZLE_BIAS),
        int(Parameter.NOZZLE_WEIGHT),
        int(Parameter.SEAT_BIAS),
        _BACK_PRESSURE,
        np.array(columns, np.int64),
        np.array(numbers, np.int64),
        np.array(slopes, np.float64),
    )


def _changed(line: Any, values: Sequence[Any]) -> Any:
    for law in LINE_LAWS:
        line = law.change(line, values[law.column])
    return line
