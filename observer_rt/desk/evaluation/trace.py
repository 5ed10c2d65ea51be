"""The trace of evaluated recordings: its samples in memory, its columns in a file."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.stream.state import State
from observer_rt.files.signals.table_writers import TABLE_WRITERS, TableWriter, WrittenColumn
from observer_rt.foundation.units import MM3_PER_MS, Floats, Structs

SUFFIXES = tuple(TABLE_WRITERS)
TRACE_SUFFIX = ".trace.csv"  # added to a recording's name, in a folder
NUMBER = "%.9g"
_RATES = (  # m3/s
    "injection_rate",
    "injection_rate_sigma",  # as it was known while the injection ran
    "corrected_rate_sigma",  # over windows of injections that were learned from
    "corrected_rate",  # by the injection's own pressures, over the same windows
    "nominal_rate",  # by the model with phi = 0 on the same frames
    "open_loop_rate",  # of x^
)
_STATES = {"x": "", "phi": "1/s"}  # units of fields of three numbers, x normalised
_PARTS = {f"{name}{part + 1}": (name, part) for name in _STATES for part in range(3)}
"""Such a field, and the place of one of its numbers, by the channel of their column."""
_COLUMNS = (
    WrittenColumn("time_s", "time", "s", NUMBER),
    *(WrittenColumn(f"{name}_mm3_per_ms", name, "mm3/ms", NUMBER, factor=MM3_PER_MS) for name in _RATES),
    WrittenColumn("valid", "valid", "", "%d"),
    WrittenColumn("state", "state", "", "%s", tuple(state.name for state in State)),
    *(WrittenColumn(part, part, _STATES[field], NUMBER) for part, (field, _) in _PARTS.items()),
)
TRACE_COLUMNS = tuple(column.header for column in _COLUMNS)
"""Names of the columns of a written trace, units included."""
_FIELDS: list[Any] = [
    ("number", np.int64),  # of the sample in its history
    ("time", np.float64),  # s
    ("line_pressure", np.float64),  # normalised, as the observer was given it
    ("measured_rate", np.float64),  # m3/s
    *((name, np.float64) for name in _RATES),
    ("valid", np.bool_),  # whether the rate is to be used
    ("state", np.int8),  # `State`
    *((name, np.float64, 3) for name in _STATES),
]
SAMPLE = np.dtype(_FIELDS, align=True)
"""The observer at a sample of a recording; nan where not available."""
Trace: TypeAlias = np.recarray[Any, np.dtype[np.void]]
"""Samples (n,) of dtype `SAMPLE`, whose fields are attributes."""
UNKNOWN = np.zeros(1, SAMPLE)
"""A sample (1,) of which nothing is known yet."""
UNKNOWN["state"] = State.STARTING
for _name, _kind, *_ in _FIELDS:
    if _kind is np.float64:
        UNKNOWN[_name] = math.nan


class InjectionSamples(NamedTuple):
    """Samples of an injection's window, and its limits [s]; is_whole: none of them was too far back."""

    trace: Trace
    start: float
    end: float
    is_whole: bool


def trace_of(samples: Structs) -> Trace:
    """Trace of samples (n,) of dtype `SAMPLE`."""
    return samples.view(np.recarray)


def unknown(first: int, time: Floats) -> Trace:
    """Samples (n,) from a number on, at these times [s] (n,), all else of them unknown."""
    trace = trace_of(np.repeat(UNKNOWN, time.size))
    trace.number, trace.time = np.arange(first, first + time.size), time
    return trace


def open_trace(path: Path) -> TableWriter:
    """A trace to be written, in the format of its suffix, one of SUFFIXES."""
    return TABLE_WRITERS[path.suffix.lower()](path, _COLUMNS)


def trace_arrays(rows: Trace) -> Sequence[NDArray[Any]]:
    """Columns of a written trace, in the order of the table, in memory of their own."""
    return [_values(rows, column) for column in _COLUMNS]


def _values(rows: Trace, column: WrittenColumn) -> NDArray[Any]:
    """A column of a written trace, of a field or, as `x1`, of one of its three numbers."""
    field, part = _PARTS.get(column.channel, (column.channel, None))
    values = rows[field] if part is None else rows[field][:, part]
    return np.array(values) if column.factor == 1.0 else np.asarray(values / column.factor)
