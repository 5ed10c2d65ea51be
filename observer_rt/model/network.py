"""The network part of phi: N = W tanh(V z) + b, the relative change of nozzle and seat flow."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import NOZZLE_NUMBERS

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


class Network(NamedTuple):
    """Weights of (7): `hidden` V (q, 6), `output` W (2, q), `bias` b (2,), and the learned part of the nozzle law.

    nozzle (NOZZLE_NUMBERS,): rise of p_C seen by it, in units of p_0: while the needle is open, and what comes on top
    in proportion to u2 = A_S/A_0. It bends the gate G(x, u) of the nozzle flow near p_S = p_C as no bounded
    network of x can.
    """

    hidden: NDArray[np.float64]
    output: NDArray[np.float64]
    bias: NDArray[np.float64]
    nozzle: NDArray[np.float64]


def zero_network() -> Network:
    """The network at start: q = 5 hidden neurons, zero output."""
    return Network(
        _HIDDEN_LAYER.copy(), np.zeros((OUTPUTS, HIDDEN)), np.zeros(OUTPUTS), np.zeros(NOZZLE_NUMBERS)
    )


def constant_network(nozzle: float = 0.0, seat: float = 0.0) -> Network:
    """No hidden neurons: flows changed by the constant factors 1 + v_H and 1 + v_S of (27)."""
    bias = np.array([nozzle, seat])
    return Network(np.zeros((0, ARGUMENTS)), np.zeros((OUTPUTS, 0)), bias, np.zeros(NOZZLE_NUMBERS))
