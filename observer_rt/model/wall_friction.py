"""The line's wall friction that remembers how the flow changed (`line.wave`): what it does to all flows in a step."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import inner
from observer_rt.model.line.wave import MEMORIES, fading, flow_at, memory_at, pull_in_middle

_CHANGE, BEFORE = 2, 3  # rows of a tangent's scratch, of which the flows' take 0 and 1


@inner
def mean_flow(x: NDArray[np.float64], cells: int) -> float:
    total = 0.0
    for i in range(1, cells + 1):
        total += x[flow_at(i, cells)]
    return total / cells


@inner
def mean_flow_row(by: NDArray[np.float64], cells: int, rows: NDArray[np.float64], row: int) -> None:
    """The derivatives of the mean flow into a row."""
    for j in range(by.shape[1]):
        rows[row, j] = 0.0
    for i in range(1, cells + 1):
        place = flow_at(i, cells)
        for j in range(by.shape[1]):
            rows[row, j] += by[place, j] / cells


@inner
def drag(
    x: NDArray[np.float64], cells: int, mean_before: float, step: float, memory: float, tangent: Any
) -> None:
    """What friction that remembers does to all flows in a step [s], by the mean in its middle; what it remembers."""
    change, pull, by_change = mean_flow(x, cells) - mean_before, 0.0, 0.0
    for k in range(MEMORIES):
        by_memory, by_flow = pull_in_middle(k, step, memory)
        pull += by_memory * x[memory_at(k, cells)]
        by_change += by_flow
    push = step / (1.0 + step * by_change)
    shift = -push * (pull + by_change * change)
    if tangent is not None:
        _drag_rows(tangent.by, tangent.moved, cells, step, memory)
    for i in range(1, cells + 1):
        x[flow_at(i, cells)] += shift
    for k in range(MEMORIES):
        keep, take = fading(k, step)
        x[memory_at(k, cells)] = keep * x[memory_at(k, cells)] + take * (change + shift)


@inner
def _drag_rows(
    by: NDArray[np.float64], scratch: NDArray[np.float64], cells: int, step: float, memory: float
) -> None:
    """The derivatives of what `drag` does; row BEFORE of `scratch` holds those of the mean flow before the step."""
    mean_flow_row(by, cells, scratch, _CHANGE)
    by_change = 0.0
    for j in range(by.shape[1]):
        scratch[_CHANGE, j] -= scratch[BEFORE, j]
        scratch[BEFORE, j] = 0.0  # from here on that of the pull
    for k in range(MEMORIES):
        by_memory, by_flow = pull_in_middle(k, step, memory)
        by_change += by_flow
        for j in range(by.shape[1]):
            scratch[BEFORE, j] += by_memory * by[memory_at(k, cells), j]
    push = step / (1.0 + step * by_change)
    for j in range(by.shape[1]):
        shift = -push * (scratch[BEFORE, j] + by_change * scratch[_CHANGE, j])
        scratch[_CHANGE, j] += shift
        for i in range(1, cells + 1):
            by[flow_at(i, cells), j] += shift
    for k in range(MEMORIES):
        place, (keep, take) = memory_at(k, cells), fading(k, step)
        for j in range(by.shape[1]):
            by[place, j] = keep * by[place, j] + take * scratch[_CHANGE, j]
