"""`observer-rt evaluate` on CAN logs: as the recordings they were made of, alone and chained."""

import json
from pathlib import Path

import pytest

from observer_rt.recording.formats import read_recording
from tests.cli.conftest import Command, document
from tests.device import candump_lines, frames_of


def test_a_log_is_evaluated_as_the_recording_it_was_made_of(
    command: Command, worn: Path, bench: Path, tmp_path: Path
) -> None:
    log = tmp_path / "bus.log"
    log.write_text("(0.0) can0 123#R\n" + "".join(candump_lines(frames_of(bench, worn))))
    expected = json.loads(command("evaluate", worn, "--bench", bench, "--json").out)["recordings"][0]
    outcome = command.done("evaluate", log, "--bench", bench, "--json")
    assert f"{log}: left out: 1 remote frame" in outcome.err
    found = json.loads(outcome.out)["recordings"][0]
    assert [i["mass_mg"] for i in found["injections"]] == [i["mass_mg"] for i in expected["injections"]]
    command.refused("evaluate", log, "--bench", bench, "--from-channel", "can7")


def test_logs_of_a_device_that_went_on_are_as_one(
    command: Command, worn: Path, bench: Path, tmp_path: Path
) -> None:
    """Such as files a recorder began anew, here within the third injection."""
    within = 1394  # frames of nine samples
    assert read_recording(worn).needle_lift[9 * within] > 100e-6
    lines = candump_lines(frames_of(bench, worn))
    for name, part in (("whole", lines), ("first", lines[:within]), ("second", lines[within:])):
        (tmp_path / f"{name}.log").write_text("".join(part))
    (known,) = document(command, tmp_path / "whole.log", "--bench", bench)["recordings"]
    parts = (tmp_path / "first.log", tmp_path / "second.log")
    chained = document(command, *parts, "--bench", bench, "--chain")["recordings"]
    found = [injection for part in chained for injection in part["injections"]]
    assert [injection["number"] for injection in found] == [1, 2, 3, 4]
    keys = ("mass_mg", "mass_ci95_mg", "valid", "phi_version", "indicators")
    assert [[i[key] for key in keys] for i in found] == [
        [i[key] for key in keys] for i in known["injections"]
    ]
    apart = document(command, *parts, "--bench", bench)["recordings"]
    assert apart[1]["injections"][0]["number"] == 1


@pytest.mark.parametrize("first", ["bus.log", "worn.csv"])
def test_after_a_restart_a_log_goes_on_with_what_was_learned(
    command: Command, worn: Path, bench: Path, tmp_path: Path, first: str
) -> None:
    log, state = tmp_path / "bus.log", tmp_path / "learned"
    log.write_text("".join(candump_lines(frames_of(bench, worn))))
    before = log if first == "bus.log" else worn
    chained = document(command, before, log, "--bench", bench, "--chain")["recordings"]
    document(command, before, "--bench", bench, "--save-state", state)
    (known,) = document(command, log, "--bench", bench, "--state", state)["recordings"]
    assert chained[1] == known
    (fresh,) = document(command, log, "--bench", bench)["recordings"]
    assert chained[1] != fresh
