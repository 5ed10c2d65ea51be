"""The paper's network: three free rows phi = unit (W tanh(V z) + b), its cost (10) and gradient (13)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.paper.scheme import FaultCost
from observer_rt.model.network import ARGUMENTS, HIDDEN

ROWS = 3  # m, one output for every state
LANES = 8  # samples that compiled code reckons together
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


def fault_cost(z: NDArray[np.float64], target: NDArray[np.float64], unit: float) -> FaultCost:
    """The cost of samples z: (n, 6) rows [x^ u 1]; target of phi: (n, 3) [1/s]; unit of the outputs [1/s]."""
    samples = len(z)
    spare = -samples % LANES
    columns = np.pad(np.hstack([z, target / unit, np.ones((samples, 1))]).T, ((0, 0), (0, spare)))
    return FaultCost(*map(np.ascontiguousarray, (columns[:ARGUMENTS], columns[ARGUMENTS:-1], columns[-1])))
