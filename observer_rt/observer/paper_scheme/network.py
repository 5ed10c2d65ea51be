"""The paper's network: three free rows phi = unit (W tanh(V z) + b), its cost (10) and gradient (13)."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.model.network import ARGUMENTS, HIDDEN, activation

ROWS = 3  # m, one output for every state
WEIGHTS = HIDDEN * ARGUMENTS + ROWS * HIDDEN + ROWS

_HIDDEN_END = HIDDEN * ARGUMENTS
_OUTPUT_END = _HIDDEN_END + ROWS * HIDDEN


class FreeNetwork(NamedTuple):
    """Weights of (7)-(8): `hidden` V (5, 6), `output` W (3, 5), `bias` b (3,); `unit` [1/s] of the outputs.

    The paper prints numbers without its unit of time. Here it is 1/l, in which the gain of (5) is 1 as printed, so
    `unit` is the identification gain l.
    """

    hidden: NDArray[np.float64]
    output: NDArray[np.float64]
    bias: NDArray[np.float64]
    unit: float


def free_network(p: NDArray[np.float64], unit: float) -> FreeNetwork:
    """The network of a parameter vector p = [v_1 .. v_q, row 1 of W .. row m of W, b] (48,).

    (12) orders W by columns while the gradient (13) orders it by rows; rows are used here.
    """
    return FreeNetwork(
        p[:_HIDDEN_END].reshape(HIDDEN, ARGUMENTS),
        p[_HIDDEN_END:_OUTPUT_END].reshape(ROWS, HIDDEN),
        p[_OUTPUT_END:],
        unit,
    )


def scaled_identity(beta: float) -> NDArray[np.float64]:
    """The start of Algorithm 1, V = W = b = beta I, as a vector p (48,).

    None of the three is square: V and W get beta on their main diagonals and 0 elsewhere, so that hidden neuron i
    sees argument z_i and output i sees neuron i; b gets beta in every row.
    """
    return np.concatenate(
        [
            beta * np.eye(HIDDEN, ARGUMENTS).ravel(),
            beta * np.eye(ROWS, HIDDEN).ravel(),
            np.full(ROWS, beta),
        ]
    )


def no_fault() -> NDArray[np.float64]:
    """The vector p (48,) of a network that says phi = 0."""
    return np.zeros(WEIGHTS)


@njit(cache=True, nogil=True)
def free_fault(
    x: tuple[float, float, float], u: tuple[float, float], network: FreeNetwork
) -> tuple[float, float, float]:
    """phi(z) of (7) with z = [x u 1], its three rows [1/s]."""
    first, second, third = network.bias[0], network.bias[1], network.bias[2]
    for neuron in range(HIDDEN):
        sigma = activation(x, u, network.hidden, neuron)
        first += network.output[0, neuron] * sigma
        second += network.output[1, neuron] * sigma
        third += network.output[2, neuron] * sigma
    return network.unit * first, network.unit * second, network.unit * third


@njit(cache=True, nogil=True)
def cost(z: NDArray[np.float64], target: NDArray[np.float64], network: FreeNetwork) -> float:
    """J of (10), the sum of eps'eps/2 with eps = target - phi in units of `network.unit`.

    z: (n, 6) rows [x u 1]; target: (n, 3) in units of `network.unit`.
    """
    total = 0.0
    for k in range(z.shape[0]):
        phi = free_fault((z[k, 0], z[k, 1], z[k, 2]), (z[k, 3], z[k, 4]), network)
        for row in range(ROWS):
            error = target[k, row] - phi[row] / network.unit
            total += 0.5 * error * error
    return total


@njit(cache=True, nogil=True)
def cost_and_gradient(
    z: NDArray[np.float64],
    target: NDArray[np.float64],
    network: FreeNetwork,
    gradient: NDArray[np.float64],
) -> float:
    """`cost`, and its gradient (13) into `gradient` (48,), in the order of `free_network`.

    (13) prints the slope of sigma_i as (sigma_i + 1)^2 / exp(2 v_i z), which is 1 - sigma_i^2 of tanh (9).
    """
    total = 0.0
    gradient[:] = 0.0
    sigma = np.empty(HIDDEN)
    error = np.empty(ROWS)
    for k in range(z.shape[0]):
        for neuron in range(HIDDEN):
            argument = 0.0
            for j in range(ARGUMENTS):
                argument += network.hidden[neuron, j] * z[k, j]
            sigma[neuron] = math.tanh(argument)
        for row in range(ROWS):
            phi = network.bias[row]
            for neuron in range(HIDDEN):
                phi += network.output[row, neuron] * sigma[neuron]
            error[row] = target[k, row] - phi
            total += 0.5 * error[row] * error[row]
            gradient[_OUTPUT_END + row] -= error[row]
        for neuron in range(HIDDEN):
            back = 0.0
            for row in range(ROWS):
                back += error[row] * network.output[row, neuron]
                gradient[_HIDDEN_END + row * HIDDEN + neuron] -= error[row] * sigma[neuron]
            back *= 1.0 - sigma[neuron] * sigma[neuron]
            for j in range(ARGUMENTS):
                gradient[neuron * ARGUMENTS + j] -= back * z[k, j]
    return total


class FaultCost:
    """The cost of a training as the minimiser wants it."""

    def __init__(self, z: NDArray[np.float64], target: NDArray[np.float64], unit: float) -> None:
        """z: (n, 6) rows [x^ u 1]; target of phi: (n, 3) [1/s]; unit of the network's outputs [1/s]."""
        self._z = z
        self._target = target / unit
        self._unit = unit

    def value(self, theta: NDArray[np.float64]) -> float:
        """J; inf where it is not finite."""
        result = cost(self._z, self._target, free_network(theta, self._unit))
        return result if math.isfinite(result) else math.inf

    def value_and_gradient(self, theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """J and its gradient (48,)."""
        gradient = np.empty(WEIGHTS)
        result = cost_and_gradient(self._z, self._target, free_network(theta, self._unit), gradient)
        return result, gradient
