"""Outliers of an event: leaps, spikes, stretches of a held signal, bursts of noise, ends of a range."""

import numpy as np
from numpy.typing import NDArray

AT_LEVEL: float
BETTER: float
FEWEST: int
LENGTH: int

def largest_of(innovations: NDArray[np.float64], first: int) -> tuple[float, float]: ...
def find_held(
    y: NDArray[np.float64],
    innovations: NDArray[np.float64],
    masked: NDArray[np.bool_],
    innovation: float,
    noise: float,
    first: int,
) -> NDArray[np.float64]: ...
def find_loud(y: NDArray[np.float64], noise: float, loud: NDArray[np.bool_]) -> int: ...
def find_pile(
    y: NDArray[np.float64],
    innovations: NDArray[np.float64],
    masked: NDArray[np.bool_],
    noise: float,
    first: int,
) -> tuple[int, float, float, float]: ...
def smoothed(y: NDArray[np.float64]) -> NDArray[np.float64]: ...
