"""The trace of an evaluated recording as CSV: one row per input sample (design 4.1)."""

from pathlib import Path

import numpy as np
import pandas as pd

from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.foundation.errors import file_errors
from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.observer.stream.state import State

SUFFIX = ".trace.csv"


def write_trace(path: Path, evaluation: Evaluation) -> None:
    """Write the trace; cells are empty where a value is not available.

    Raises `UserError` or `RunError` when the file cannot be written.
    """
    trace = evaluation.trace
    names = np.array([state.name for state in State])
    columns: dict[str, object] = {
        "time_s": evaluation.recording.time,
        "injection_rate_mm3_per_ms": trace.injection_rate / MM3_PER_MS,
        "valid": trace.valid.astype(np.int8),
        "state": names[trace.state],
    }
    columns |= {f"x{i + 1}": trace.x[:, i] for i in range(3)}
    columns |= {f"phi{i + 1}": trace.phi[:, i] for i in range(3)}
    with file_errors(path):
        pd.DataFrame(columns).to_csv(path, index=False, float_format="%.9g")
