"""What the observer says at every sample: the trace of a recording, as CSV, MDF4 or Parquet, one row a sample."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.observer.stream.state import State
from observer_rt.recording.signals.table_writers import TABLE_WRITERS, TableWriter, WrittenColumn

Signal = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """The observer at every sample of a recording (n samples); nan where not available.

    injection_rate [m3/s]; injection_rate_sigma [m3/s]: its standard deviation over the windows of injections that
    were learned from; state: `State`; x normalised (n, 3); phi [1/s] (n, 3); nominal_rate [m3/s]: the model
    with phi = 0 on the same frames.
    """

    injection_rate: Signal
    injection_rate_sigma: Signal
    valid: NDArray[np.bool_]
    state: NDArray[np.int8]
    x: Signal
    phi: Signal
    nominal_rate: Signal


def joined(traces: Sequence[Trace]) -> Trace:
    """One after another, in memory of its own."""
    return Trace(*(np.concatenate([getattr(trace, each.name) for trace in traces]) for each in fields(Trace)))


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
