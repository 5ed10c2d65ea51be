"""The JSON document of an evaluated recording, read back."""

import io
import json
from typing import Any

from observer_rt.desk.evaluation.evaluate import Evaluation
from observer_rt.desk.evaluation.results import write_document
from observer_rt.model.effective import Coefficients


def recording_json(evaluation: Evaluation, c: Coefficients) -> dict[str, Any]:
    """The part of one recording; fails for a number that JSON does not have."""
    out = io.StringIO()
    write_document([evaluation], "hash", c, out)
    (recording,) = json.loads(out.getvalue(), parse_constant=int)["recordings"]
    return dict(recording)
