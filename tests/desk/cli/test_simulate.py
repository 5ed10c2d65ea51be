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
    """Two events of pilot and main at their own pressures, through a nozzle that passes 30 % more."""
    path = tmp_path / "made.mf4"
    shots = ("--shots", "0.4@-2,1.0@0", "--rail-pressure", "60,120", "--effect", "orifice_area:v_H=0.3")
    outcome = command.done("simulate", *FEW, *shots, "--measured-rate", "--output", path)
    assert outcome.out == ""
    assert "2 events, orifice_area" in outcome.err
    recording = read_recording(path)
    assert recording.sample_rate == 50e3
    assert recording.injection_rate is not None
    truth = truth_columns(tmp_path / "made.mf4.truth.csv")
    np.testing.assert_allclose(truth["time_s"], recording.time, atol=1e-9)
    rate = truth["injection_rate_mm3_per_ms"]
    assert 0.2 < np.std(recording.injection_rate / 1e-6 - rate) < 1.0  # it is a measurement
    assert np.count_nonzero(np.diff((rate > 1.0).astype(int)) == 1) == 4
    first, second = np.array_split(rate, 2)
    assert second.max() > 1.25 * first.max()


def test_a_needle_that_starts_slowly_and_bounces(command: Command, tmp_path: Path) -> None:
    lifts = []
    for name, shape in (("plain", ()), ("shaped", ("--curvature", 0.4, "--bounce", 25))):
        path = tmp_path / f"{name}.csv"
        command.done("simulate", *FEW, "--injections", 1, *shape, "--output", path)
        lifts.append(truth_columns(tmp_path / f"{name}.csv.truth.csv")["needle_lift_mm"])
    plain, shaped = lifts
    opening, closed = np.flatnonzero(plain)[[0, -1]]
    ratio = shaped[opening : opening + 10] / plain[opening : opening + 10]
    np.testing.assert_allclose(ratio, 0.6 + 0.4 * plain[opening : opening + 10] / plain.max(), atol=1e-6)
    assert shaped.max() == plain.max()
    assert 0.02 < shaped[closed + 1 : closed + 5].max() <= 0.025
    assert not shaped[closed + 6 :].any()
