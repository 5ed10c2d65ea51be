"""Recordings of every sample rate through the commands that judge them: a result, or a refusal with its remedy."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.desk.cli.conftest import Command
from tests.desk.cli.injector_files import FITTED, injector
from tests.device import simulated

HEADER = "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa"
KINDS = {"lump": ("lump", "nozzle", ""), "fitted": ("wave_two_part", "seat", FITTED)}


@pytest.fixture(scope="module")
def source() -> NDArray[np.float64]:
    """Time [s], pressures [MPa] and lift [mm] of three injections, (n, 4)."""
    simulation = simulated()
    pressures = simulation.rail_pressure / 1e6, simulation.line_pressure / 1e6
    return np.column_stack([simulation.time, pressures[0], simulation.needle_lift * 1e3, pressures[1]])


def resampled(path: Path, source: NDArray[np.float64], rate: float) -> Path:
    """The same at another rate [Hz], on straight lines."""
    time = np.arange(int(source[-1, 0] * rate)) / rate
    columns = [np.interp(time, source[:, 0], source[:, i]) for i in (1, 2, 3)]
    np.savetxt(path, np.column_stack([time, *columns]), "%.9g", ",", header=HEADER, comments="")
    return path


def model(folder: Path, kind: str) -> Path:
    line, outflow, end = KINDS[kind]
    return injector(
        folder / "injector.toml", line, outflow, end=end.format(adequate="true", rate=1e5) if end else ""
    )


def has_result_or_remedy(command: Command, *arguments: object) -> bool:
    """Whether there is a result; else it is refused with a remedy."""
    outcome = command(*arguments)
    assert outcome.code == 0 or (outcome.code == 2 and "remedy: " in outcome.err), outcome.err
    return outcome.code == 0


@pytest.mark.parametrize(
    ("kind", "rate", "has_result"),
    [
        *(("lump", 5e3, False), ("lump", 12e3, True)),
        *(("fitted", 500.0, False), ("fitted", 1e3, True), ("fitted", 5e3, True)),
    ],
)
def test_evaluate(
    command: Command, tmp_path: Path, source: NDArray[np.float64], kind: str, rate: float, has_result: bool
) -> None:
    made = resampled(tmp_path / "made.csv", source, rate)
    result = has_result_or_remedy(command, "evaluate", made, "--model", model(tmp_path, kind))
    assert result is has_result


@pytest.mark.parametrize(("name", "rate"), [("fit", 500.0), ("discover", 5e3), ("fit", 2e6)])
def test_fit_and_discover_refuse_what_shows_nothing(
    command: Command, tmp_path: Path, source: NDArray[np.float64], name: str, rate: float
) -> None:
    made = resampled(tmp_path / "made.csv", source[: len(source) // 2], rate)
    out = ("--output", tmp_path / "fitted.toml") if name == "fit" else ("--out", tmp_path / "out")
    assert not has_result_or_remedy(command, name, made, "--model", model(tmp_path, "fitted"), *out)
