"""The identification system x~ and the observer x^ over an event's samples, with their derivatives by theta."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

class Followed:
    def __init__(self, window: Any, setting: Any, learned: Any, clock: Any) -> None: ...

def follow(
    window: Any,
    setting: Any,
    learned: Any,
    corrected: int,
    errors: NDArray[np.float64],
    rate: NDArray[np.float64],
    gradient: Any,
    slopes: NDArray[np.float64],
) -> NDArray[np.float64]: ...
def run_open_loop(
    window: Any, setting: Any, learned: Any, x: NDArray[np.float64], tangent: Any, clock: Any, result: Any
) -> None: ...
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
def run_from_rest(
    window: Any,
    setting: Any,
    learned: Any,
    x: NDArray[np.float64],
    rate: NDArray[np.float64],
    phi: NDArray[np.float64],
) -> None: ...
def sum_of_squares(errors: NDArray[np.float64]) -> float: ...
