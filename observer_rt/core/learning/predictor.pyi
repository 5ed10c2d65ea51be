"""The identification system x~ and the observer x^ over an event's samples, with their derivatives by theta."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import Terms

def follow(
    window: Any,
    setting: Any,
    learned: Any,
    corrected: int,
    errors: NDArray[np.float64],
    rate: NDArray[np.float64],
    gradient: Any,
    slopes: NDArray[np.float64],
    terms: Terms | None = ...,
    phi: NDArray[np.float64] | None = ...,
    run: Any = ...,
) -> NDArray[np.float64]: ...
def propagate_noise(
    areas: NDArray[np.float64],
    opening: int,
    run: Any,
    interval: float,
    seat: Any,
    start: Any,
    rail: NDArray[np.float64],
    lift: float,
    rate: NDArray[np.float64],
    volume: NDArray[np.float64],
) -> None: ...
def sum_of_squares(errors: NDArray[np.float64]) -> float: ...
