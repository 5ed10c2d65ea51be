"""Normalised seat areas of a recorded lift, its ramps extended to where the needle leaves its seat."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

def slope_of_means(partial: float, full: float, slope: float, tolerance: float) -> float: ...
def fill_areas(
    lift: NDArray[np.float64],
    openings: NDArray[np.int64],
    ramps: NDArray[np.float64],
    factor: float,
    shift: float,
    rounding: float,
    tolerance: float,
    seat: Any,
    area: NDArray[np.float64],
) -> None: ...
