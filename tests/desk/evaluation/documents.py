"""The JSON document of an evaluated recording, read back, and its text on a screen."""

import io
import json
from typing import Any

from rich.console import Console

from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.results import print_evaluation, write_document
from observer_rt.model.effective import Coefficients


def recording_json(evaluation: Evaluation, c: Coefficients) -> dict[str, Any]:
    """The part of one recording; fails for a number that JSON does not have."""
    out = io.StringIO()
    write_document([evaluation], "hash", c, out)
    (recording,) = json.loads(out.getvalue(), parse_constant=int)["recordings"]
    return dict(recording)


def screen_text(evaluation: Evaluation, c: Coefficients) -> str:
    screen = io.StringIO()
    print_evaluation(evaluation, c, Console(file=screen, width=80, color_system=None))
    return screen.getvalue()
