"""The simulated injector: the model's equations under wear, in fine steps with the exact needle lift."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import Model, Terms, Weights

def lift_of_stroke(time: float, stroke: Any) -> float: ...
def run_injector(
    x: NDArray[np.float64],
    number: int,
    indicated: float,
    due: int,
    first: int,
    last: int,
    time: NDArray[np.float64],
    rail: NDArray[np.float64],
    strokes: NDArray[np.float64],
    steps: int,
    model: Model,
    weights: Weights,
    sensor: Any,
    terms: Terms,
    states: NDArray[np.float64],
    lift: NDArray[np.float64],
    rate: NDArray[np.float64],
    recorded: NDArray[np.float64],
) -> tuple[int, float, int]: ...
def show_slowly(
    values: NDArray[np.float64], interval: float, lag: float, shown: NDArray[np.float64]
) -> None: ...
