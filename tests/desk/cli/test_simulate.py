"""`observer-rt simulate`: files it writes and mistakes it names."""

from pathlib import Path

import numpy as np
import pandas as pd

from observer_rt.files.formats import read_recording
from tests.desk.cli.conftest import Command

FEW = ("--injections", "2", "--sample-rate", "50e3")


def test_recording_and_its_truth(command: Command, tmp_path: Path) -> None:
    """Two events of pilot and main at their own pressures, through a nozzle that passes 30 % more."""
    path = tmp_path / "made.mf4"
    shots = ("--shots", "0.4@-2,1.0@0", "--rail-pressure", "60,120", "--effect", "orifice_area:v_H=0.3")
    outcome = command.done("simulate", *FEW, *shots, "--measured-rate", "--bounce", 25, "--output", path)
    assert outcome.out == ""
    assert "2 events, orifice_area" in outcome.err
    recording = read_recording(path)
    assert recording.sample_rate == 50e3
    assert recording.injection_rate is not None
    truth = pd.read_csv(tmp_path / "made.mf4.truth.csv")
    np.testing.assert_allclose(truth["time_s"], recording.time, atol=1e-9)
    rate = truth["injection_rate_mm3_per_ms"].to_numpy()
    assert 0.2 < np.std(recording.injection_rate / 1e-6 - rate) < 1.0  # it is a measurement
    assert np.count_nonzero(np.diff((rate > 1.0).astype(int)) == 1) == 4
    rises = [np.count_nonzero(np.diff((truth["needle_lift_mm"] > mm).astype(int)) == 1) for mm in (0.015, 0.026)]
    assert rises == [8, 4]  # the needle bounces after each
    first, second = np.array_split(rate, 2)
    assert second.max() > 1.25 * first.max()
