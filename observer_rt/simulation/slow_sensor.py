"""What a first-order sensor shows of a signal."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled
from observer_rt.model.sensor import lagged


@compiled
def shown_slowly(values: NDArray[np.float64], interval: float, lag: float) -> NDArray[np.float64]:
    """Values (n,) at every interval [s], at rest before, as a sensor of this lag [s] shows them."""
    shown = values.copy()
    for k in range(1, values.size):
        shown[k] = lagged(shown[k - 1], values[k - 1], values[k], interval, lag)
    return shown
