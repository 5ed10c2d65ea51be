"""The Riccati equation of the identification system's gain, from a start on."""

import numpy as np
from numpy.typing import NDArray

def solve_riccati(
    transition: NDArray[np.float64],
    process: NDArray[np.float64],
    measurement: float,
    shown: NDArray[np.float64],
    shown_before: NDArray[np.float64],
    covariance: NDArray[np.float64],
    gains: NDArray[np.float64],
    mends: bool,
) -> float: ...
