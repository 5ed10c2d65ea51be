"""What a parameter vector theta means: network, line and sensor; and how it acts on the model's coefficients."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.scalars import SCALARS, Parameter, Scalars
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.network import HIDDEN, Network, constant_network, zero_network
from observer_rt.model.right_hand_side import ByTheta
from observer_rt.model.sensor import LAG_UNIT

_NOZZLE, _WEIGHTS, _SEAT, _BACK_PRESSURE = (
    int(each)
    for each in (
        Parameter.NOZZLE_BIAS,
        Parameter.NOZZLE_WEIGHT,
        Parameter.SEAT_BIAS,
        Parameter.BACK_PRESSURE,
    )
)
_TINY = 1e-100  # step of a complex derivative, which loses nothing by being small


class Learned(NamedTuple):
    """theta taken apart: phi's network, the coefficients with the line's terms, sensor offset [p_0] and lag [s]."""

    network: Network
    coefficients: Coefficients
    offset: float
    lag: float


def nothing_learned(c: Coefficients) -> Learned:
    """The model in force as it is."""
    return Learned(constant_network(), c, 0.0, 0.0)


def learned_of(theta: NDArray[np.float64], c: Coefficients, scalars: Scalars = SCALARS) -> Learned:
    """Meaning of a parameter vector (m,) by its table on a model without it."""
    changed = c._replace(line=_changed(c.line, theta.tolist(), scalars))
    offset, lag = float(theta[Parameter.LINE_PRESSURE_OFFSET]), float(theta[Parameter.SENSOR_LAG])
    return Learned(network_of(theta), changed, offset, lag * LAG_UNIT)


def network_of(theta: NDArray[np.float64]) -> Network:
    """The network in a parameter vector (m,)."""
    network = zero_network()
    network.output[0, :] = theta[_WEIGHTS : _WEIGHTS + HIDDEN]
    network.bias[0], network.bias[1] = theta[_NOZZLE], theta[_SEAT]
    network.back_pressure[:] = theta[_BACK_PRESSURE : _BACK_PRESSURE + 2]
    return network


def by_theta(theta: NDArray[np.float64], c: Coefficients, scalars: Scalars = SCALARS) -> ByTheta:
    """How theta (m,) acts on a model without it: where the network's parameters stand, the line's slopes.

    The slopes are those of the laws themselves, by complex steps.
    """
    values = theta.tolist()
    found: list[tuple[int, int, float]] = []
    for column, _ in scalars.laws:
        stepped = values.copy()
        stepped[column] = complex(values[column], _TINY)
        for number, coefficient in enumerate(_changed(c.line, stepped, scalars)):
            slope = coefficient.imag / _TINY
            if slope != 0.0:
                found.append((column, number, slope))
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


def _changed(line: Any, values: Sequence[Any], scalars: Scalars) -> Any:
    for column, change in scalars.laws:
        line = change(line, values[column])
    return line
