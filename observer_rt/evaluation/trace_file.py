"""The trace of an evaluated recording as CSV: one row per input sample."""

from pathlib import Path

import numpy as np

from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.foundation.file_errors import file_errors
from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.observer.stream.state import State
from observer_rt.recording.signals.csv_file import write_table

SUFFIX = ".trace.csv"
NUMBER = "%.9g"


def write_trace(path: Path, evaluation: Evaluation) -> None:
    """Write the trace; cells are empty where a value is not available.

    Raises `UserError` or `RunError` when the file cannot be written.
    """
    trace = evaluation.trace
    names = np.array([state.name for state in State])
    columns = {
        "time_s": (NUMBER, evaluation.recording.time),
        "injection_rate_mm3_per_ms": (NUMBER, trace.injection_rate / MM3_PER_MS),
        "valid": ("%d", trace.valid),
        "state": ("%s", names[trace.state]),
    }
    columns |= {f"x{i + 1}": (NUMBER, trace.x[:, i]) for i in range(3)}
    columns |= {f"phi{i + 1}": (NUMBER, trace.phi[:, i]) for i in range(3)}
    with file_errors(path):
        write_table(path, columns)
