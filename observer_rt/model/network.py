"""The network part of phi: N = W tanh(V z) + b, the relative change of nozzle and seat flow."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import inlined

HIDDEN = 5  # q, hidden neurons
ARGUMENTS = 6  # z = [x1 x2 x3 u1 u2 1]
OUTPUTS = 2  # N_H (nozzle), N_S (seat)

# Rows of the hidden layer: three look at the sac pressure, two at the seat area, each where it bends most
# over the working range. They stay fixed: training V gains nothing.
_HIDDEN_LAYER = np.array(
    (
        (0.0, 0.0, 2.5, 0.0, 0.0, -0.75),
        (0.0, 0.0, 2.5, 0.0, 0.0, -2.25),
        (0.0, 0.0, 10.0, 0.0, 0.0, -1.0),
        (0.0, 0.0, 0.0, 0.0, 4.0, -1.0),
        (0.0, 0.0, 0.0, 0.0, 4.0, -3.2),
    )
)


_SATURATED = 20.0  # tanh is 1 beyond


class Network(NamedTuple):
    """Weights of (7): `hidden` V (q, 6), `output` W (2, q), `bias` b (2,), and the back-pressure of the gate.

    back_pressure (2,): rise of p_C seen by the nozzle, in units of p_0: while the needle is open, and what comes on
    top in proportion to u2 = A_S/A_0. It bends the gate G(x, u) of the nozzle flow near p_S = p_C as no bounded
    network of x can.
    """

    hidden: NDArray[np.float64]
    output: NDArray[np.float64]
    bias: NDArray[np.float64]
    back_pressure: NDArray[np.float64]


def zero_network() -> Network:
    """The network at start: q = 5 hidden neurons, zero output."""
    return Network(_HIDDEN_LAYER.copy(), np.zeros((OUTPUTS, HIDDEN)), np.zeros(OUTPUTS), np.zeros(2))


def constant_network(nozzle: float = 0.0, seat: float = 0.0) -> Network:
    """No hidden neurons: flows changed by the constant factors 1 + v_H and 1 + v_S of (27)."""
    return Network(np.zeros((0, ARGUMENTS)), np.zeros((OUTPUTS, 0)), np.array([nozzle, seat]), np.zeros(2))


@inlined
def fast_tanh(argument: float) -> float:
    """tanh to within 1e-12, several times faster than the C library's: half of the loop's time would go there.

    Lambert's continued fraction (1768) to its seventh term at a quarter of the argument, then doubled twice by
    tanh 2y = 2t/(1 + t^2), with one division for all.
    """
    quarter = 0.25 * min(max(argument, -_SATURATED), _SATURATED)
    square = quarter * quarter
    p = quarter * (135135.0 + square * (17325.0 + square * (378.0 + square)))
    q = 135135.0 + square * (62370.0 + square * (3150.0 + square * 28.0))
    p, q = 2.0 * p * q, p * p + q * q
    result: float = 2.0 * p * q / (p * p + q * q)
    return result


@inlined
def activation(
    x: tuple[float, float, float], u: tuple[float, float], hidden: NDArray[np.float64], neuron: int
) -> float:
    """Output sigma_i = tanh(v_i z) of one hidden neuron (9)."""
    sigma: float = fast_tanh(
        hidden[neuron, 0] * x[0]
        + hidden[neuron, 1] * x[1]
        + hidden[neuron, 2] * x[2]
        + hidden[neuron, 3] * u[0]
        + hidden[neuron, 4] * u[1]
        + hidden[neuron, 5]
    )
    return sigma


@inlined
def back_pressure_at(u_2: float, network: Network) -> float:
    """Rise of p_C at a seat area, in units of p_0."""
    rise: float = network.back_pressure[0] + network.back_pressure[1] * u_2
    return rise


@inlined
def flow_changes(
    x: tuple[float, float, float], u: tuple[float, float], network: Network
) -> tuple[float, float]:
    """(N_H, N_S) = W tanh(V z) + b (7), with z = [x u 1]; relative changes of Q_H and Q_S."""
    nozzle = network.bias[0]
    seat = network.bias[1]
    for neuron in range(network.hidden.shape[0]):
        sigma = activation(x, u, network.hidden, neuron)
        nozzle += network.output[0, neuron] * sigma
        seat += network.output[1, neuron] * sigma
    return nozzle, seat


@inlined
def flow_changes_by_sac(
    x: tuple[float, float, float], u: tuple[float, float], network: Network
) -> tuple[float, float, float, float]:
    """`flow_changes` and their derivatives with respect to x_3."""
    nozzle, nozzle_slope = network.bias[0], 0.0
    seat, seat_slope = network.bias[1], 0.0
    for neuron in range(network.hidden.shape[0]):
        sigma = activation(x, u, network.hidden, neuron)
        bend = (1.0 - sigma * sigma) * network.hidden[neuron, 2]
        nozzle += network.output[0, neuron] * sigma
        seat += network.output[1, neuron] * sigma
        nozzle_slope += network.output[0, neuron] * bend
        seat_slope += network.output[1, neuron] * bend
    return nozzle, seat, nozzle_slope, seat_slope
