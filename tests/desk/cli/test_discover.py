"""`observer-rt discover`: what it writes and prints; mistakes it names."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

import observer_rt.identification.discovery.discover
from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.files.formats import read_recording, write_recording
from observer_rt.foundation.errors import RunError
from tests.desk.cli.conftest import Command
from tests.device import candump_lines, frames_of


def test_a_search_interrupted_writes_nothing(
    command: Command, worn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted = Mock(side_effect=KeyboardInterrupt)
    monkeypatch.setattr(observer_rt.identification.discovery.discover, "answer", interrupted)
    done = command("discover", "--out", tmp_path / "found", worn)
    assert done.code == 130
    assert not list((tmp_path / "found").iterdir())


def test_a_search_names_a_worn_nozzle_and_amends_the_model(command: Command, worn: Path, tmp_path: Path) -> None:
    result = tmp_path / "found"
    done = command.done("discover", "--out", result, worn)
    assert done.out.startswith("named: orifice_area")
    assert "MPa" in done.out
    assert "mg" in done.out
    assert {path.name for path in result.iterdir()} == {"findings.json", "amended.toml", "report.html"}
    (effect,) = load_injector(result / "amended.toml").effects
    assert effect.parameters["v_H"].value == pytest.approx(0.3, abs=0.02)
    findings = json.loads((result / "findings.json").read_text())
    assert findings["seconds"] > 0.0
    assert len(findings["held_out"]) == 1  # two rail pressures in one recording
    amended = tmp_path / "in_force.toml"
    shutil.copy(result / "amended.toml", amended)
    for name in ("findings.json", "report.html"):
        kept = (result / name).read_bytes()
        said = command.refused("discover", "--model", amended, "--out", result, worn)
        assert name in said
        assert "--force" in said
        assert (result / name).read_bytes() == kept
    again = command.done("discover", "--model", amended, "--out", result, "--json", "--force", worn)
    assert json.loads(again.out)["verdict"] == "none"
    assert json.loads(again.out) == json.loads((result / "findings.json").read_text())
    assert not (result / "amended.toml").exists()  # that of another question


@pytest.mark.parametrize("named_by", ["--model", "--bench"])
def test_no_model_is_overwritten(command: Command, worn: Path, bench: Path, tmp_path: Path, named_by: str) -> None:
    model = tmp_path / "amended.toml"
    shutil.copy(NOMINAL_INJECTOR, model)
    bench.write_text(bench.read_text().replace("[model]", '[model]\nfile = "amended.toml"'))
    named = model if named_by == "--model" else bench
    assert "name another folder" in command.refused("discover", named_by, named, "--out", tmp_path, worn)
    assert model.read_bytes() == NOMINAL_INJECTOR.read_bytes()


@pytest.mark.slow
def test_of_two_that_are_tied_the_one_chosen_is_amended(command: Command, tmp_path: Path) -> None:
    recording, result = tmp_path / "seat.csv", tmp_path / "found"
    command(
        *("simulate", "--measured-rate", "--rail-pressure", "60,140", "--injections", "4"),
        *("--sample-rate", "50e3", "--effect", "seat_area:v_S=-0.2", "--output", recording),
    )
    asked = ("discover", "--out", result, "--choose")
    assert "which leave open: " in command.refused(*asked, "orifice_area", recording)
    assert not (result / "amended.toml").exists()
    headline, *remaining = command.done(*asked, "seat_area", recording).out.splitlines()
    assert re.match(r"ambiguous: (lift_gain, or seat_area|seat_area, or lift_gain) \(", headline)
    advice = next(line for line in remaining if line.strip().startswith("to tell"))
    assert "rate" not in advice  # which was measured
    (effect,) = load_injector(result / "amended.toml").effects
    assert effect.id == "seat_area"
    assert "chosen" in effect.evidence


@pytest.mark.slow
def test_a_model_that_is_wrong_on_healthy_recordings_is_told(command: Command, worn: Path, tmp_path: Path) -> None:
    healthy = shutil.copy(worn, tmp_path / "copy.csv")
    done = command.done("discover", "--out", tmp_path / "found", "--healthy", healthy, "--json", worn)
    findings = json.loads(done.out)
    assert "orifice_area" in findings["healthy_warning"]
    assert findings["confidence"] <= 0.8


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("no injection", "is 0 mm all the time, though the line pressure moves"),
        ("without rate", "no measured injection rate"),
        ("given twice", "given twice"),
        ("out is a file", "is a file"),
    ],
)
def test_mistakes_are_named_before_anything_is_written(
    command: Command, worn: Path, tmp_path: Path, fault: str, message: str
) -> None:
    out, other = tmp_path / "found", tmp_path / "other.csv"
    recording = read_recording(worn)
    match fault:
        case "no injection":
            write_recording(other, replace(recording, needle_lift=np.zeros(recording.samples)))
        case "without rate":
            write_recording(other, replace(recording, injection_rate=None))
        case "given twice":
            other = worn
        case "out is a file":
            out.write_text("mine")
            shutil.copy(worn, other)
    said = command.refused("discover", "--out", out, worn, other)
    assert message in said
    assert "remedy" in said
    assert not out.is_dir()


def test_a_log_with_gaps_is_judged_by_what_is_whole(
    command: Command, worn: Path, bench: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped = Mock(side_effect=RunError("not wanted here"))
    monkeypatch.setattr(observer_rt.identification.discovery.discover, "answer", stopped)
    lines = candump_lines(frames_of(bench, worn))
    lift = read_recording(worn).needle_lift
    opening = int(np.flatnonzero(lift > 20e-6)[0]) // 9  # of the first injection, in frames of nine samples
    log = tmp_path / "bus.log"
    log.write_text("".join(lines[: opening + 1] + lines[opening + 3 :]))
    done = command("discover", "--bench", bench, "--out", tmp_path / "found", log)
    assert "18 missing, 3 of 4 injections judged" in done.err
    assert "left out, samples are missing in it or beside it: at 0.15" in done.err
