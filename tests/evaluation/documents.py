"""Files of an evaluated recording, in one go: its JSON document, read back, and its trace."""

import io
import json
from pathlib import Path
from typing import Any

from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.evaluation.results import Evaluated, write_document
from observer_rt.evaluation.trace import open_trace, trace_arrays
from observer_rt.model.effective import Coefficients


def recording_json(evaluation: Evaluated, c: Coefficients) -> dict[str, Any]:
    """The part of one recording; fails for a number that JSON does not have."""
    out = io.StringIO()
    write_document([evaluation], "hash", c, out)
    (recording,) = json.loads(out.getvalue(), parse_constant=int)["recordings"]
    return dict(recording)


def write_trace(path: Path, evaluation: Evaluation) -> None:
    """The whole trace of a recording in memory, as files have it that were evaluated part by part."""
    with open_trace(path) as writer:
        writer.write(trace_arrays(evaluation.recording.time, evaluation.trace))
