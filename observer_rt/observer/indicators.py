"""Wear of nozzle and seat as numbers: relative changes of their flows, with a standard deviation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.posterior import Belief
from observer_rt.estimation.prediction_error import network_of
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.network import HIDDEN, activation, flow_changes


@dataclass(frozen=True)
class Estimate:
    """A number and its standard deviation, None where nothing was learned yet."""

    value: float
    sigma: float | None = None

    @property
    def ci95(self) -> tuple[float, float] | None:
        """95 % interval."""
        if self.sigma is None:
            return None
        return self.value - 1.96 * self.sigma, self.value + 1.96 * self.sigma


@dataclass(frozen=True)
class Indicators:
    """What the parameters say of the injector at one operating point.

    nozzle, seat: equivalents of v_H and v_S in (27); line_pressure_offset o in units of p_0.
    """

    nozzle: Estimate
    seat: Estimate
    line_pressure_offset: Estimate


def indicators_of(
    theta: NDArray[np.float64], belief: Belief | None, x: NDArray[np.float64], u: NDArray[np.float64]
) -> Indicators:
    """Indicators for theta (PARAMETERS,) at state x (3,) and inputs u (2,), sigmas from `belief`."""
    network = network_of(theta)
    state = (float(x[0]), float(x[1]), float(x[2]))
    inputs = (float(u[0]), float(u[1]))
    nozzle, seat = flow_changes(state, inputs, network)
    slopes = np.zeros((3, PARAMETERS))
    slopes[0, Parameter.NOZZLE_BIAS] = 1.0
    for neuron in range(HIDDEN):
        slopes[0, Parameter.NOZZLE_WEIGHT + neuron] = activation(state, inputs, network.hidden, neuron)
    slopes[1, Parameter.SEAT_BIAS] = 1.0
    slopes[2, Parameter.LINE_PRESSURE_OFFSET] = 1.0
    values = (nozzle, seat, float(theta[Parameter.LINE_PRESSURE_OFFSET]))
    if belief is None:
        return Indicators(*(Estimate(value) for value in values))
    sigmas = np.sqrt(np.einsum("ij,jk,ik->i", slopes, belief.covariance, slopes))
    return Indicators(*(Estimate(v, float(s)) for v, s in zip(values, sigmas, strict=True)))
