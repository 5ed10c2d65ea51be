"""The paper's network: three free rows phi = unit (W tanh(V z) + b), its cost (10) and gradient (13)."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inlined
from observer_rt.foundation.small_arrays import WIDTH, filled, load, store, sum_of, whole_vectors
from observer_rt.model.network import ARGUMENTS, HIDDEN, activation, fast_tanh

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


@compiled
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


@compiled
def _value(cost: "FaultCost", p: NDArray[np.float64]) -> float:
    """J of (10); leaves activations and errors behind. inf where it is not finite."""
    z, sigmas, errors, n = cost.z, cost.sigmas, cost.errors, cost.counts.shape[0]
    total = filled(0.0)
    for first in range(0, n, WIDTH):
        for neuron in range(HIDDEN):
            argument = p[neuron * ARGUMENTS] * load(z, first)
            for j in range(1, ARGUMENTS):
                argument = argument + p[neuron * ARGUMENTS + j] * load(z, j * n + first)
            store(sigmas, neuron * n + first, fast_tanh(argument))
        for row in range(ROWS):
            phi = filled(p[_OUTPUT_END + row])
            for neuron in range(HIDDEN):
                phi = phi + p[_HIDDEN_END + row * HIDDEN + neuron] * load(sigmas, neuron * n + first)
            error = load(cost.counts, first) * (load(cost.target, row * n + first) - phi)
            store(errors, row * n + first, error)
            total = total + error * error
    result = 0.5 * sum_of(total)
    return result if math.isfinite(result) else math.inf


@compiled
def _find_gradient(cost: "FaultCost", p: NDArray[np.float64], gradient: NDArray[np.float64]) -> None:
    """The gradient (13) at the p that J was asked for last, in the order of `free_network`.

    (13) prints the slope of sigma_i as (sigma_i + 1)^2 / exp(2 v_i z), which is 1 - sigma_i^2 of tanh (9).
    """
    z, sigmas, errors, n = cost.z, cost.sigmas, cost.errors, cost.counts.shape[0]
    sums = np.zeros(WEIGHTS * WIDTH)
    for first in range(0, n, WIDTH):
        for row in range(ROWS):
            _add(sums, _OUTPUT_END + row, load(errors, row * n + first))
        for neuron in range(HIDDEN):
            sigma, back = load(sigmas, neuron * n + first), filled(0.0)
            for row in range(ROWS):
                error, place = load(errors, row * n + first), _HIDDEN_END + row * HIDDEN + neuron
                back = back + p[place] * error
                _add(sums, place, error * sigma)
            back = back * (1.0 - sigma * sigma)
            for j in range(ARGUMENTS):
                _add(sums, neuron * ARGUMENTS + j, back * load(z, j * n + first))
    for i in range(WEIGHTS):
        gradient[i] = -sum_of(load(sums, i * WIDTH))


@inlined
def _add(sums: NDArray[np.float64], place: int, more: Any) -> None:
    store(sums, place * WIDTH, load(sums, place * WIDTH) + more)


class _Samples(NamedTuple):
    z: NDArray[np.float64]
    target: NDArray[np.float64]
    counts: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    errors: NDArray[np.float64]


class FaultCost(_Samples):
    """The cost (10) of a training as the minimiser wants it: the sum of eps'eps/2, eps = target - phi in its unit.

    n samples and as many more as fill vectors, all along the rows. z: (6, n) columns [x^ u 1]; target: (3, n) of phi,
    in units of the network; counts: (n,) 1, or 0 where there is no sample; sigmas (5, n), errors (3, n): of the
    theta that was asked for last.
    """

    __slots__ = ()
    compiled_value = staticmethod(_value)
    compiled_gradient = staticmethod(_find_gradient)

    def value(self, theta: NDArray[np.float64]) -> float:
        """J; inf where it is not finite."""
        return float(_value(self, theta))

    def value_and_gradient(self, theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """J and its gradient (48,)."""
        gradient = np.empty(WEIGHTS)
        value = float(_value(self, theta))
        _find_gradient(self, theta, gradient)
        return value, gradient


def fault_cost(z: NDArray[np.float64], target: NDArray[np.float64], unit: float) -> FaultCost:
    """The cost of samples z: (n, 6) rows [x^ u 1]; target of phi: (n, 3) [1/s]; unit of the outputs [1/s]."""
    samples = len(z)
    spare = whole_vectors(samples) - samples
    columns = np.pad(np.hstack([z, target / unit, np.ones((samples, 1))]).T, ((0, 0), (0, spare)))
    n = samples + spare
    return FaultCost(
        z=np.ascontiguousarray(columns[:ARGUMENTS]),
        target=np.ascontiguousarray(columns[ARGUMENTS:-1]),
        counts=np.ascontiguousarray(columns[-1]),
        sigmas=np.zeros((HIDDEN, n)),
        errors=np.zeros((ROWS, n)),
    )
