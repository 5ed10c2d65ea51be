"""`observer-rt simulate`: files it writes and mistakes it names."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.files.formats import read_recording
from tests.desk.cli.conftest import Command

FEW = ("--injections", "2", "--sample-rate", "50e3")


def truth_columns(path: Path) -> dict[str, NDArray[np.float64]]:
    """Columns of a truth file by header."""
    header = path.read_text().split("\n", 1)[0].split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return dict(zip(header, table.T, strict=True))


def test_recording_and_its_truth(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "made.mf4"
    outcome = command.done("simulate", *FEW, "--measured-rate", "--output", path)
    assert outcome.out == ""
    assert "2 events" in outcome.err
    recording = read_recording(path)
    assert recording.sample_rate == 50e3
    assert recording.injection_rate is not None
    truth = truth_columns(tmp_path / "made.mf4.truth.csv")
    np.testing.assert_allclose(truth["time_s"], recording.time, atol=1e-9)
    error = recording.injection_rate / 1e-6 - truth["injection_rate_mm3_per_ms"]
    assert 0.2 < np.std(error) < 1.0  # it is a measurement


def test_shots_pressures_and_effects(command: Command, tmp_path: Path) -> None:
    """Two events of pilot and main at their own pressures, through a nozzle that passes 30 % more."""
    shots = ("--shots", "0.4@-2,1.0@0", "--rail-pressure", "60,120", "--noise", "off", *FEW)
    flows = []
    for name, effect in (("healthy", ()), ("worn", ("--effect", "orifice_area:v_H=0.3"))):
        path = tmp_path / f"{name}.csv"
        command.done("simulate", *shots, *effect, "--output", path)
        flows.append(truth_columns(Path(f"{path}.truth.csv"))["injection_rate_mm3_per_ms"])
    healthy, worn = flows
    starts = np.count_nonzero(np.diff((healthy > 1.0).astype(int)) == 1)
    assert starts == 4
    half = healthy.size // 2
    assert healthy[half:].max() > 1.25 * healthy[:half].max()
    assert 1.2 < worn.max() / healthy.max() < 1.3  # the line yields a little
