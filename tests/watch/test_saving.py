"""An injection that was seen, as files."""

import json
import math
from pathlib import Path

import numpy as np

from observer_rt.bus.mapping.output_messages import SummaryValues
from observer_rt.watch.page.controls import save_injection
from observer_rt.watch.results import SampleCurves, SeenInjection


def test_what_is_not_known_is_null_and_not_a_number_no_json_has(tmp_path: Path) -> None:
    values = [math.nan] * len(SummaryValues._fields)
    values[SummaryValues._fields.index("injection_number")] = 7.0
    line = np.zeros(3, np.float32)
    curves = SampleCurves(line, line, line, line, line, line, np.zeros((3, 3), np.float32))
    path = save_injection(SeenInjection(SummaryValues._make(values), 5, curves, math.nan), tmp_path, "left")

    assert path == tmp_path / "injection_left_7.csv"
    text = path.with_suffix(".json").read_text()
    assert "NaN" not in text
    said = json.loads(text)
    assert (said["nominal_mass"], said["mass"], said["injection_number"]) == (None, None, 7.0)
    assert len(path.read_text().splitlines()) == 1 + line.size
