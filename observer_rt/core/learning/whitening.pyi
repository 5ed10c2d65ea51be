"""Innovations made white, weighed robustly, and the sums by which their colour is found."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

HUBER: float
LEVEL_SAMPLES: int
NO_HIGH_PASS: float

def whiten(
    values: NDArray[np.float64],
    masked: Any,
    forgetting: float,
    taps: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None: ...
def robust_cost(e: NDArray[np.float64], first: int, sigma: float, together: int = ...) -> float: ...
def weigh(
    e: NDArray[np.float64],
    slopes: NDArray[np.float64],
    first: int,
    sigma: float,
    together: int,
    gradient: NDArray[np.float64],
    information: NDArray[np.float64],
) -> None: ...
def high_passed(values: NDArray[np.float64], forgetting: float) -> NDArray[np.float64]: ...
def take_in_products(
    values: NDArray[np.float64],
    weight: float,
    choices: NDArray[np.float64],
    products: NDArray[np.float64],
    by_lag: NDArray[np.float64],
) -> None: ...
