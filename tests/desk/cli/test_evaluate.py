"""`observer-rt evaluate`: results on the screen, as JSON, trace, figure and learned state; mistakes it names."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.daemon.lock import sole_writer
from observer_rt.files.formats import read_recording
from tests.desk.cli.conftest import Command, document
from tests.device import candump_lines, frames_of

RECORDING_KEYS = {
    *("file", "samples", "sample_rate_hz", "lost_samples", "spikes", "bridged_samples"),
    *("checks", "injections", "summary", "learned", "learned_surfaces"),
}
INJECTION_KEYS = {
    *("number", "event", "start_index", "end_index", "start_s", "end_s", "rail_pressure_MPa", "mass_mg"),
    *("mass_ci95_mg", "nominal_mass_mg", "measured_mass_mg", "rate_rmse_mm3_per_ms"),
    *("nominal_rate_rmse_mm3_per_ms", "rate_ci95_halfwidth_mm3_per_ms", "valid", "reasons", "state"),
    *("phi_version", "posterior", "indicators", "live_mass_mg", "predicted_mass_mg", "remainder_percent"),
    *("mass_noise_mg", "mass_learning_mg", "mass_calibration_mg", "mass_source"),
}
INDICATORS = {
    *("nozzle_v_H", "seat_v_S", "line_friction", "guide_leakage", "line_pressure_sensor_offset"),
    *("line_pressure_sensor_lag", "bulk_modulus", "entrained_air", "control_flow", "needle_lift_sensor_lag"),
}


def test_json_document(command: Command, worn: Path) -> None:
    json_document = document(command, worn)
    assert json_document.keys() == {"schema", "model_sha256", "recordings"}
    assert json_document["schema"] == 1
    (recording,) = json_document["recordings"]
    assert recording.keys() == RECORDING_KEYS
    counts = {"adoptions", "rejected_adoptions", "unseen_injections", "commands", "lift_failed"}
    assert recording["summary"].keys() == {"valid_share", *counts, "level_ci95_pct", "calibrated"}
    assert recording["summary"]["calibrated"] is False  # for nothing is stated
    assert (recording["file"], recording["sample_rate_hz"]) == (str(worn), 50e3)
    assert (recording["lost_samples"], recording["checks"][0]["id"]) == (0, "rail_line_offset")
    assert recording["checks"][0]["passed"] is True
    assert [i["number"] for i in recording["injections"]] == [1, 2, 3, 4]
    for injection in recording["injections"]:
        assert (injection.keys(), injection["indicators"].keys()) == (INJECTION_KEYS, INDICATORS)
        assert (injection["valid"], injection["reasons"]) == (True, [])
    last = recording["injections"][-1]
    assert last["valid"]
    assert last["state"] == "ADAPTED"
    assert last["mass_mg"] == pytest.approx(last["measured_mass_mg"], rel=0.01)
    assert last["nominal_mass_mg"] < 0.85 * last["measured_mass_mg"]
    assert last["rate_rmse_mm3_per_ms"] < 0.2 * last["nominal_rate_rmse_mm3_per_ms"]
    low, high = last["indicators"]["nozzle_v_H"]["ci95"]
    assert low < 0.3 < high
    assert recording["summary"]["valid_share"] == 1.0
    assert recording["summary"]["adoptions"] >= 2
    (unlearned,) = document(command, worn, "--no-learning")["recordings"]
    assert unlearned["summary"]["adoptions"] == 0
    (over_drop, *_) = recording["learned"]
    assert (over_drop["flow"], over_drop["variable"]) == ("orifice_area", "pressure_drop_MPa")
    assert over_drop["change"][-1] == pytest.approx(0.3, abs=over_drop["ci95_halfwidth"][-1])


WHOLE = EXAMPLE_BENCH.read_text().replace("rate_hz = 100e3", "rate_hz = 50e3")
LAYOUT = "[sampling]\nrate_hz = 50e3\n" + "".join(
    f'[recording.{role}]\ncolumn = "{role}_{unit}"\nunit = "{unit}"\n'
    for role, unit in {"time": "s", "rail_pressure": "MPa", "needle_lift": "mm", "line_pressure": "MPa"}.items()
)


@pytest.mark.parametrize("bench", ["", LAYOUT, WHOLE], ids=["none", "layout", "whole"])
def test_a_level_that_nobody_measured_is_said(command: Command, worn: Path, tmp_path: Path, bench: str) -> None:
    (tmp_path / "bench.toml").write_text(bench)
    real = ("evaluate", worn, *(("--bench", tmp_path / "bench.toml") if bench else ()))
    assert "level ±4.2 %, not calibrated" in command.done(*real).out.splitlines()
    (recording,) = json.loads(command.done(*real, "--json").out)["recordings"]
    assert not recording["summary"]["calibrated"]
    last = recording["injections"][-1]
    assert last["valid"]  # the model explains it, for all that
    parts = [last[f"mass_{part}_mg"] for part in ("noise", "learning", "calibration")]
    low, high = last["mass_ci95_mg"]
    assert np.hypot.reduce(parts) == pytest.approx(0.5 * (high - low), rel=0.01)
    level = 0.01 * recording["summary"]["level_ci95_pct"]
    assert parts[2] == pytest.approx(level * 0.5 * (low + high), rel=0.01)


def test_table_fits_80_columns(command: Command, worn: Path) -> None:
    outcome = command.done("evaluate", worn)
    title, *table = outcome.out.splitlines()
    assert title.startswith(f"{worn}: ")
    assert max(len(line.rstrip()) for line in table if not line.startswith("(they")) <= 80
    rows = [line.split() for line in table[2:6]]
    assert [row[-1] for row in rows] == ["yes"] * 4
    assert [line.split(" %")[0] for line in table if line.startswith("injection ")] == ["injection 1: flow 24"]


def test_recording_without_injections(command: Command, resting: Path, tmp_path: Path) -> None:
    figure = tmp_path / "empty.svg"
    outcome = command.done("evaluate", resting, "--plot", figure)
    assert "no injection found" in outcome.out
    assert "no injection found" in figure.read_text()
    (recording,) = document(command, resting)["recordings"]
    assert (recording["injections"], recording["summary"]["valid_share"]) == ([], 0.0)


def test_first_middle_and_last_injection_are_drawn_with_units(command: Command, worn: Path, tmp_path: Path) -> None:
    figure = tmp_path / "worn.svg"
    command.done("evaluate", worn, "--plot", figure)
    # every text stands as a comment beside its outlines
    words = " ".join(re.findall("<!-- (.*?) -->", figure.read_text(), re.DOTALL))
    assert re.findall(r"injection (\d), ", words) == ["1", "3", "4"]
    for name, unit in (
        ("injection rate", "mm³/ms"),
        ("line pressure", "MPa"),
        ("mass error against measured", "%"),
        ("95 % interval", "%"),
        ("time", "ms"),
    ):
        assert re.search(rf"{name} \[{unit}\]", words), name


def test_traces_of_several_files_go_to_a_folder(command: Command, worn: Path, resting: Path, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "traces"
    command.done("evaluate", worn, resting, "--output", folder)
    assert {path.name for path in folder.iterdir()} == {"worn.csv.trace.csv", "resting.csv.trace.csv"}


def test_learned_state_is_saved_and_goes_on(command: Command, worn: Path, tmp_path: Path) -> None:
    state = tmp_path / "learned.json"
    document(command, worn, "--save-state", state)
    outcome = command("evaluate", worn, "--state", state, "--json")
    assert "learned from 4 events" in outcome.err
    injections = json.loads(outcome.out)["recordings"][0]["injections"]
    assert [i["valid"] for i in injections] == [True] * 4
    assert injections[0]["mass_mg"] == pytest.approx(injections[0]["measured_mass_mg"], rel=0.02)


def test_the_state_of_a_daemon_is_refused(command: Command, worn: Path, tmp_path: Path) -> None:
    state = tmp_path / "learned.json"
    with sole_writer(state):
        assert f"in use by process {os.getpid()}" in command.refused("evaluate", worn, "--save-state", state)
    command.done("evaluate", worn, "--save-state", state)
    assert [entry.name for entry in tmp_path.iterdir()] == ["learned.json"]


def test_chain_is_one_history_and_apart_are_several(command: Command, worn: Path) -> None:
    """The second begins with what was learned from the first, and counts on."""
    chained = document(command, worn, worn, "--chain")["recordings"]
    later = chained[1]["injections"]
    assert [i["number"] for i in later] == [5, 6, 7, 8]
    assert all(i["valid"] and i["phi_version"] > 0 for i in later)
    assert later[0]["mass_mg"] == pytest.approx(later[0]["measured_mass_mg"], rel=0.02)
    first, second = document(command, worn, worn)["recordings"]
    assert first == second
    assert first["injections"] == chained[0]["injections"]


def test_logs_of_a_device_that_went_on_are_as_one(command: Command, worn: Path, bench: Path, tmp_path: Path) -> None:
    """Such as files a recorder began anew, here within the third injection."""
    within = 1394  # frames of nine samples
    assert read_recording(worn).needle_lift[9 * within] > 100e-6
    lines = candump_lines(frames_of(bench, worn))
    for name, part in (("whole", lines), ("first", lines[:within]), ("second", lines[within:])):
        (tmp_path / f"{name}.log").write_text("".join(part))
    (reference,) = document(command, tmp_path / "whole.log", "--bench", bench)["recordings"]
    parts = (tmp_path / "first.log", tmp_path / "second.log")
    chained = document(command, *parts, "--bench", bench, "--chain")["recordings"]
    result = [injection for part in chained for injection in part["injections"]]
    assert [injection["number"] for injection in result] == [1, 2, 3, 4]
    keys = ("mass_mg", "mass_ci95_mg", "valid", "phi_version", "indicators")
    assert [[i[key] for key in keys] for i in result] == [[i[key] for key in keys] for i in reference["injections"]]
    apart = document(command, *parts, "--bench", bench)["recordings"]
    assert apart[1]["injections"][0]["number"] == 1
    log = tmp_path / "whole.log"  # Once more: a device that was restarted, which begins with what was learned.
    again = document(command, log, log, "--bench", bench, "--chain")["recordings"][1]
    assert [injection["valid"] for injection in again["injections"]] == [True] * 4
