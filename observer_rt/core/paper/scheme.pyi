"""The paper's scheme: three free rows phi = unit (W tanh(V z) + b), its pair over an event, cost and gradient."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stepper import CarriedPhi

class FreePhi(CarriedPhi):
    def __init__(self, phi: Any, posted: Any) -> None: ...

class FaultCost:
    def __init__(
        self, z: NDArray[np.float64], target: NDArray[np.float64], counts: NDArray[np.float64]
    ) -> None: ...
    def value(self, theta: NDArray[np.float64]) -> float: ...
    def gradient(self, theta: NDArray[np.float64]) -> NDArray[np.float64]: ...

def fault_of(x: Any, u: Any, network: Any) -> tuple[float, float, float]: ...
def rate_by_balance(x_3: float, u_2: float, phi_1: float, coefficients: Any) -> float: ...
def sweep(window: Any, setting: Any, network: Any, result: Any) -> None: ...
def add_two_products(
    matrix: NDArray[np.float64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
    d: NDArray[np.float64],
) -> None: ...
