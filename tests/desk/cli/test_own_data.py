"""Files of the user's own layout, wrong units, overwriting, logs with a restart: at the command line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.formats import read_recording, write_recording
from observer_rt.files.signals.recording import Recording
from tests.desk.cli.conftest import Command, document

SECTION = """
[recording]
[recording.time]
column = "Zeit"
unit = "ms"
[recording.rail_pressure]
column = "p_Rail"
unit = "bar"
[recording.needle_lift]
column = "Hub"
unit = "um"
[recording.line_pressure]
column = "p_Leitung"
unit = "bar"
"""


@pytest.fixture
def own(bench: Path) -> Path:
    bench.write_text(bench.read_text() + SECTION)
    return bench


@pytest.fixture
def foreign(worn: Path, tmp_path: Path) -> Path:
    """The worn injector as another tool would write it, a few rows lost, 20 ms not recorded."""
    recording = read_recording(worn)
    kept = np.delete(np.arange(recording.samples), [500, *range(6000, 7000)])
    rows = [
        f"{recording.time[k] * 1e3:.4f};{recording.rail_pressure[k] / 1e5:.2f};{recording.needle_lift[k] * 1e6:.2f};"
        f"{recording.line_pressure[k] / 1e5:.2f};on"
        for k in kept
    ]
    text = "\n".join(["Bench 7", "Zeit;p_Rail;Hub;p_Leitung;Mode", *rows]) + "\n"
    path = tmp_path / "foreign.csv"
    path.write_text(text.replace(".", ","))
    return path


def test_a_foreign_file_is_evaluated(command: Command, foreign: Path, own: Path, worn: Path) -> None:
    outcome = command.done("evaluate", foreign, "--bench", own)
    assert "1 gaps are bridged" in outcome.err
    assert "split into 2 stretches" in outcome.err
    (recording_document,) = document(command, foreign, "--bench", own)["recordings"]
    (reference,) = document(command, worn, "--bench", own)["recordings"]
    assert len(recording_document["injections"]) in (3, 4)
    masses = [each["mass_mg"] for each in reference["injections"]]
    assert recording_document["injections"][0]["mass_mg"] == pytest.approx(masses[0], rel=5e-3)


def test_check_shows_what_it_makes_of_a_file(command: Command, foreign: Path, own: Path) -> None:
    outcome = command("check", "--bench", own, "--recording", foreign, "--json")
    texts = [each["text"] for each in json.loads(outcome.out)["findings"] if each["topic"] == "recording"]
    text = "\n".join(texts)
    for part in (
        "names in line 2",
        "separated by ';'",
        "decimal ','",
        "rail_pressure is 'p_Rail' in bar (as the bench file says), every 0.02 ms",
        "not used: Mode",
        "samples at 50000 Hz",
        "split into 2 stretches",
        "needle_lift: ",
    ):
        assert part in text
    own.write_text(own.read_text().replace('column = "Hub"\nunit = "um"', 'column = "Hub"\nunit = "mm"'))
    outcome = command("check", "--bench", own, "--recording", foreign)
    assert outcome.code == 1
    assert "likely um" in " ".join(outcome.out.split())


def test_a_foreign_file_with_units_in_its_headings_needs_no_section(command: Command, foreign: Path) -> None:
    names, units = "Zeit;p_Rail;Hub;p_Leitung", "Zeit [ms];p_Rail [bar];Hub [µm];p_Leitung [bar]"
    foreign.write_text(foreign.read_text().replace(names, units))
    message = command.done("evaluate", foreign).err
    assert "by its headings time is 'Zeit' in ms, rail_pressure is 'p_Rail' in bar" in message
    message = " ".join(command.done("check", "--recording", foreign).out.split())
    assert "line_pressure is 'p_Leitung' in bar (by its heading)" in message
    assert message.count("is 'p_Leitung' in bar") == 1
    assert "bus database" not in message


def test_stretches_become_files(command: Command, foreign: Path, own: Path, tmp_path: Path) -> None:
    command.done("convert", foreign, tmp_path / "x.parquet", "--bench", own)
    first, second = (read_recording(tmp_path / f"x_000{number}.parquet") for number in (1, 2))
    assert (first.samples, first.sample_rate) == (6000, 50e3)
    assert second.time[0] == pytest.approx(7000 / 50e3)
    command.refused("convert", foreign, tmp_path / "x.parquet", "--bench", own)


def test_wrong_units_are_refused_by_every_command(command: Command, worn: Path, tmp_path: Path) -> None:
    right = read_recording(worn)
    path, out = tmp_path / "wrong.csv", tmp_path / "out.csv"
    wrong = Recording(right.time, right.rail_pressure, 1e3 * right.needle_lift, right.line_pressure)
    write_recording(path, wrong)
    for words in (("evaluate", path), ("convert", path, out), ("replay", path), ("discover", path, "--out", out)):
        said = command.refused(*words)
        assert "wrong.csv, needle_lift" in said
        assert "check the unit" in said
        assert not out.exists()


def test_truths_beside_recordings_are_left_out(command: Command, worn: Path, tmp_path: Path) -> None:
    shutil.copy(worn, tmp_path / "worn.csv")
    (tmp_path / "worn.csv.truth.csv").write_text("time_s,sac_pressure_MPa\n0,5\n")
    outcome = command.done("evaluate", *sorted(tmp_path.glob("*.csv")))
    assert "left out: 1 files beside recordings" in outcome.err
    command.refused("evaluate", tmp_path / "worn.csv.truth.csv")


def test_the_last_of_many_injections_are_shown(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "many.csv"
    arguments = ("--injections", 51, "--period", 12, "--energizing-time", 0.4, "--sample-rate", 50e3)
    command.done("simulate", *arguments, "--output", path)
    outcome = command.done("evaluate", path, "--no-learning")
    rows = [words for line in outcome.out.splitlines() if (words := line.split())[-1] in ("yes", "no")]
    assert [int(words[0]) for words in rows] == [*range(2, 52)]
    assert "the last 50 of 51 injections" in outcome.out
