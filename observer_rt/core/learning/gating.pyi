"""Best subset of scalars, by one Cholesky factor grown and cut for all subsets."""

import numpy as np
from numpy.typing import NDArray

def search_subsets(
    information: NDArray[np.float64],
    vector: NDArray[np.float64],
    order: NDArray[np.int64],
    free: int,
    lowest: NDArray[np.float64],
    prices: NDArray[np.float64],
    best: NDArray[np.float64],
) -> int: ...
