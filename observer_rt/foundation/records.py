"""Dtypes of the core's structs, so that each record is stated once, in a .pxd of the core."""

from collections.abc import Mapping
from typing import Any

import numpy as np

Record = tuple[memoryview, Mapping[str, Any]]
"""One struct in memory, and its fields by name, as the core gives them."""


def dtype_of(record: Record) -> np.dtype[np.void]:
    """Dtype of the arrays that the core takes as such structs; a single `unsigned char` is a bool."""
    view, fields = record
    return _dtype(np.asarray(view).dtype, fields)


def _dtype(described: np.dtype[Any], value: Any) -> np.dtype[Any]:
    if described.kind == "c":  # how the core shows a struct of two doubles
        return np.dtype([(name, np.float64) for name in value], align=True)
    if described == np.uint8:
        return np.dtype(np.bool_)
    if described.fields is None:
        return described
    fields = dict(described.fields)
    layout: Any = {
        "names": list(fields),
        "formats": [_dtype(field[0], value[name]) for name, field in fields.items()],
        "offsets": [field[1] for field in fields.values()],
        "itemsize": described.itemsize,
    }
    made: np.dtype[Any] = np.dtype(layout, align=True)
    return made
