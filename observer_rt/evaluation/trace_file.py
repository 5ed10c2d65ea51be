"""The trace of an evaluated recording as CSV, MDF4 or Parquet: one row a sample."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from observer_rt.evaluation.evaluate import Evaluation, Trace
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.observer.stream.state import State
from observer_rt.recording.signals.table_writers import TABLE_WRITERS, TableWriter, WrittenColumn

SUFFIXES = tuple(TABLE_WRITERS)
TRACE_SUFFIX = ".trace.csv"  # added to a recording's name, in a folder
NUMBER = "%.9g"
_COLUMNS = (
    WrittenColumn("time_s", "time", "s", NUMBER),
    WrittenColumn("injection_rate_mm3_per_ms", "injection_rate", "mm3/ms", NUMBER),
    WrittenColumn("valid", "valid", "", "%d"),
    WrittenColumn("state", "state", "", "%s", tuple(state.name for state in State)),
    *(WrittenColumn(f"x{i}", f"x{i}", "", NUMBER) for i in (1, 2, 3)),
    *(WrittenColumn(f"phi{i}", f"phi{i}", "1/s", NUMBER) for i in (1, 2, 3)),
)


def open_trace(path: Path) -> TableWriter:
    """A trace to be written, in the format of its suffix, one of SUFFIXES."""
    return TABLE_WRITERS[path.suffix.lower()](path, _COLUMNS)


def trace_arrays(time: NDArray[Any], trace: Trace) -> Sequence[NDArray[Any]]:
    """What is written of some samples."""
    rate = trace.injection_rate / MM3_PER_MS
    x = (trace.x[:, i] for i in range(3))
    phi = (trace.phi[:, i] for i in range(3))
    return [time, rate, trace.valid, trace.state, *x, *phi]


def write_trace(path: Path, evaluation: Evaluation) -> None:
    """Write a whole trace; cells are empty where a value is not available.

    Raises `UserError` or `RunError` when the file cannot be written.
    """
    with file_errors(path), open_trace(path) as writer:
        writer.write(trace_arrays(evaluation.recording.time, evaluation.trace))
