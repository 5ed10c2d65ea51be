"""Feather (Arrow's own file): columns of numbers and moments, units from the fields' metadata `unit`."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow
from pyarrow import feather

from observer_rt.files.signals.column import Column


def columns(path: Path) -> Iterator[Column]:
    """All columns that hold one value a row."""
    table = feather.read_table(path, memory_map=False)
    for field, column in zip(table.schema, table.columns, strict=True):
        if pyarrow.types.is_nested(field.type):
            continue
        unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace").strip()
        yield Column(field.name, np.asarray(column.to_numpy()), unit)
