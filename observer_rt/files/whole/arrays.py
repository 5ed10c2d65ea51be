"""Arrays of numbers as columns."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.files.signals.column import Column

_MOST_COLUMNS = 64  # of a matrix: more is no table


def columns_of_array(name: str, array: NDArray[Any], unit: str = "") -> Iterator[Column]:
    """A vector, the fields of a structured one, or the columns of a matrix by `name 1`, `name 2`, ...

    A matrix has more rows than columns, whichever way it is stored. What holds no numbers gives nothing.
    """
    array = np.squeeze(array)
    if array.dtype.names and array.ndim == 1:
        for field in array.dtype.names:
            yield from columns_of_array(f"{name}/{field}" if name else field, array[field])
        return
    if array.dtype.kind not in "iufmM":
        return
    if array.ndim == 1 and array.size > 1:
        yield Column(name, array, unit)
    elif array.ndim == 2 and min(array.shape) <= _MOST_COLUMNS:
        rows = array if array.shape[0] >= array.shape[1] else array.T
        for place in range(rows.shape[1]):
            yield Column(f"{name} {place + 1}".strip(), np.ascontiguousarray(rows[:, place]), unit)
