"""Phases of an event, sample by sample, and sums of the innovations in each."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

def phases_of(window: Any, edge: int, afterglow: int) -> NDArray[np.int8]: ...
def sum_innovations(
    innovations: NDArray[np.float64],
    sigma: float,
    limit: float,
    phases: NDArray[np.int8],
    left_out: Any,
    lengths: NDArray[np.int64],
    squares: NDArray[np.float64],
    samples: NDArray[np.float64],
    block_squares: NDArray[np.float64],
    blocks: NDArray[np.float64],
) -> None: ...
