"""Correction phi that x^ carries: chosen once, when the observer is made."""

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stepper import CarriedPhi
from observer_rt.model.effective import Coefficients


class Phi(Protocol):
    """A named tuple of arrays; what is learned is put into them in place."""

    def nozzle_wear(self, x: NDArray[np.float64], u: NDArray[np.float64], c: Coefficients) -> float | None:
        """v_H of (27) at state x (3,) and inputs u (2,); None where theta says it."""

    def carried(self, posted: Any) -> CarriedPhi:
        """Correction for compiled code; posted: such a tuple of arrays with slots as their first dimension."""


class StructuredPhi(NamedTuple):
    """phi = G(x, u) N of theta: the network that x~ carries as well, in the observer's memory."""

    def nozzle_wear(self, x: NDArray[np.float64], u: NDArray[np.float64], c: Coefficients) -> None:
        """Theta says it."""

    def carried(self, posted: Any) -> CarriedPhi:
        """Empty correction: there is nothing beside the posted arrays."""
        return CarriedPhi()
