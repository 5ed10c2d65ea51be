"""`observer-rt journal`, and the journal and the lock of `observer-rt run`."""

import csv
import io
import json
import os
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.daemon.persistence.journal import JournalWriter
from observer_rt.daemon.persistence.keeper import sole_writer
from observer_rt.foundation.errors import RunError
from tests.daemon.participants import ScriptedLink, give_link
from tests.daemon.samples import some_report
from tests.desk.cli.conftest import Command
from tests.device import frames_of


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A journal of two runs, of 15 and 3 injections; the second was killed."""
    path = tmp_path / "injections.sqlite"
    for count in (15, 3):
        journal = JournalWriter(path, load_bench(), print)
        for number in range(1, count + 1):
            journal(some_report(number))
        if count == 3:
            journal.write()
        else:
            journal.finish()
    return path


def test_tables_show_the_last_injections_and_the_wear(command: Command, path: Path) -> None:
    outcome = command.done("journal", path)
    assert outcome.out.startswith("injections: 18 since 20")
    assert "; runs: 2, 1 of them killed or still running\n" in outcome.out
    wear, last = outcome.out.split("Last injections")
    assert wear.count("+30.0% [+28.0%, +32.0%]") == 2 * 12  # nozzle and seat
    assert last.count("120.0") == 10
    assert command("journal", path, "--last", 2).out.split("Last injections")[1].count("120.0") == 2


def test_csv_has_all_columns_of_all_injections(command: Command, path: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(command("journal", path, "--csv").out)))
    assert [int(row["number"]) for row in rows] == [*range(1, 16), 1, 2, 3]
    assert float(rows[4]["mass_mg"]) == pytest.approx(41.505)
    assert rows[4]["measured_mass_mg"] == ""
    assert len(list(csv.reader(io.StringIO(command("journal", path, "--csv", "--last", 4).out)))) == 5


def test_json_has_the_runs_too(command: Command, path: Path) -> None:
    document = json.loads(command("journal", path, "--json", "--last", 1).out)
    assert document["schema"] == 1
    assert [run["stopped_utc"] is None for run in document["runs"]] == [False, True]
    assert document["runs"][0]["configuration"]["sampling"]["rate_hz"] == 100e3
    (injection,) = document["injections"]
    assert (injection["number"], injection["valid"], injection["reasons"]) == (3, True, [])


def test_a_daemon_writes_what_it_says(
    command: Command, bench: Path, worn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = bench.read_text().replace("lockstep = false", "lockstep = true")
    bench.write_text(text.replace('# journal = "injections.sqlite"', 'journal = "mine.sqlite"'))
    frames = frames_of(bench, worn)
    link = ScriptedLink(frames, RunError("vcan9 went away"))
    give_link(monkeypatch, link)
    outcome = command("run", "--bench", bench)
    assert f"4 injections in the journal {tmp_path / 'mine.sqlite'}" in outcome.err
    rows = json.loads(command("journal", tmp_path / "mine.sqlite", "--json").out)["injections"]
    for row in rows:
        said = f"injection {row['number']} at index {row['start_index']}: {row['mass_mg']:.2f} mg"
        assert said in outcome.err
        assert row["nozzle_v_H_ci95_low"] < row["nozzle_v_H"] < row["nozzle_v_H_ci95_high"]
    assert [row["reasons"] for row in rows] == [["TOO_FEW_EVENTS"], ["TOO_FEW_EVENTS"], [], []]


def test_a_second_daemon_is_refused_the_state_of_the_first(
    command: Command, bench: Path, tmp_path: Path
) -> None:
    state = tmp_path / "learned.json"
    with sole_writer(state):
        outcome = command("run", "--bench", bench, "--state", state)
    assert outcome.code == 2
    assert f"learned.json: is in use by process {os.getpid()}" in outcome.err
    assert "remedy: stop that one first" in outcome.err


def test_an_evaluation_is_refused_the_state_of_a_daemon(command: Command, worn: Path, tmp_path: Path) -> None:
    state = tmp_path / "learned.json"
    with sole_writer(state):
        outcome = command("evaluate", worn, "--save-state", state)
    assert (outcome.code, outcome.out) == (2, "")
    assert f"in use by process {os.getpid()}" in outcome.err
    command.done("evaluate", worn, "--save-state", state)
    assert [entry.name for entry in tmp_path.iterdir()] == ["learned.json"]
