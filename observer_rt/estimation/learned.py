"""What a parameter vector theta means: network, line terms and sensor."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.sensitivity import Parameter
from observer_rt.model.coefficients import LineTerms
from observer_rt.model.network import HIDDEN, Network, constant_network, zero_network
from observer_rt.model.sensor import LAG_UNIT

_OFFSET = int(Parameter.LINE_PRESSURE_OFFSET)
_FRICTION = int(Parameter.LINE_FRICTION)
_LEAKAGE = int(Parameter.GUIDE_LEAKAGE)
_STIFFNESS = int(Parameter.BULK_MODULUS)
_LAG = int(Parameter.SENSOR_LAG)
_AIR = int(Parameter.ENTRAINED_AIR)
_BACK_PRESSURE = int(Parameter.BACK_PRESSURE)


class Learned(NamedTuple):
    """theta taken apart: phi's network, the line terms, sensor offset [p_0] and lag [s]."""

    network: Network
    line: LineTerms
    offset: float
    lag: float


def nothing_learned() -> Learned:
    """The model in force as it is."""
    return Learned(constant_network(), LineTerms(0.0, 0.0, 0.0, 0.0), 0.0, 0.0)


def learned_of(theta: NDArray[np.float64]) -> Learned:
    """Meaning of a parameter vector (PARAMETERS,)."""
    network = zero_network()._replace(back_pressure=theta[_BACK_PRESSURE : _BACK_PRESSURE + 2].copy())
    network.output[0, :] = theta[Parameter.NOZZLE_WEIGHT : Parameter.NOZZLE_WEIGHT + HIDDEN]
    network.bias[:] = theta[[Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS]]
    line = LineTerms(
        float(theta[_FRICTION]), float(theta[_LEAKAGE]), float(theta[_STIFFNESS]), float(theta[_AIR])
    )
    return Learned(network, line, float(theta[_OFFSET]), float(theta[_LAG]) * LAG_UNIT)
