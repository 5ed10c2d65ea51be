"""The paper's network as x^ carries it in the loop."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inner
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.integrator import Interval
from observer_rt.model.network import Network
from observer_rt.model.orifice import root
from observer_rt.observer.paper_scheme.network import FreeNetwork, free_fault
from observer_rt.observer.paper_scheme.systems import PaperSetting, balanced_rate, observe
from observer_rt.observer.stream.phi import carry


class FreePhi(NamedTuple):
    """The arrays of a `FreeNetwork`; unit (1,) [1/s]."""

    hidden: NDArray[np.float64]
    output: NDArray[np.float64]
    bias: NDArray[np.float64]
    unit: NDArray[np.float64]

    def nozzle_wear(self, x: NDArray[np.float64], u: NDArray[np.float64], c: Coefficients) -> float:
        """v_H of (27) from phi_1 at state x (3,) and inputs u (2,)."""
        network = FreeNetwork(self.hidden, self.output, self.bias, float(self.unit[0]))
        phi_1, _, _ = free_fault((float(x[0]), float(x[1]), float(x[2])), (float(u[0]), float(u[1])), network)
        flow = c.line.a2_nozzle * root(float(x[2]), c.nozzle.transition)
        return -phi_1 / flow if flow > 0.0 else 0.0


def free_phi(network: FreeNetwork) -> FreePhi:
    """What an observer carries of a network, in arrays of its own."""
    return FreePhi(
        network.hidden.copy(), network.output.copy(), network.bias.copy(), np.array([network.unit])
    )


@inner
def _network(phi: FreePhi) -> FreeNetwork:
    return FreeNetwork(phi.hidden, phi.output, phi.bias, phi.unit[0])


@compiled
def _advance_free(
    phi: FreePhi,
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
) -> None:
    setting = PaperSetting(interval.length, interval.substeps, c, network, phi.unit[0])
    observe(x, interval.start, interval.end, setting, _network(phi))


@compiled
def _read_free(
    phi: FreePhi,
    x: NDArray[np.float64],
    u: tuple[float, float],
    c: Coefficients,
    network: Network,
) -> tuple[tuple[float, float, float], float]:
    rows = free_fault(x, u, _network(phi))
    return rows, balanced_rate(x[2], u[1], rows[0], c)


@compiled
def _put_free(phi: FreePhi, posted: FreePhi, slot: int) -> None:
    phi.hidden[:] = posted.hidden[slot]
    phi.output[:] = posted.output[slot]
    phi.bias[:] = posted.bias[slot]
    phi.unit[:] = posted.unit[slot]


carry(FreePhi, _advance_free, _read_free, _put_free)
