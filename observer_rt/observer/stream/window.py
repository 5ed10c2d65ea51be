"""Samples of an event, copied out of the ring. Compiled."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled
from observer_rt.observer.stream.state import LINE, RING

_MASK = RING - 1


@compiled
def copy_window(
    ring: NDArray[np.void],
    start: int,
    late: int,
    inputs: NDArray[np.float64],
    output: NDArray[np.float64],
    resting: NDArray[np.bool_],
    knots: NDArray[np.float64],
    masked: NDArray[np.bool_],
) -> None:
    """As many samples as the arrays of a `Window` have, from a position on; late: samples y is recorded late."""
    for number in range(output.size):
        row, recorded = ring[(start + number) & _MASK], ring[(start + number + late) & _MASK]
        inputs[number, 0] = row.rail_pressure
        inputs[number, 1] = row.seat_area
        output[number] = recorded.line_pressure
        resting[number] = row.resting
        knots[number, 0] = row.lift_after
        knots[number, 1] = row.lift_area
        masked[number] = (recorded.bridged >> LINE) & 1 != 0
