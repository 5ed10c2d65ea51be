"""The journal and the lock of `observer-rt run`."""

import os
from pathlib import Path

import pytest

from observer_rt.daemon.persistence.journal import reading_journal
from observer_rt.daemon.persistence.keeper import sole_writer
from observer_rt.foundation.errors import RunError
from tests.daemon.participants import ScriptedLink, give_link
from tests.desk.cli.conftest import Command
from tests.device import frames_of


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
    with reading_journal(tmp_path / "mine.sqlite") as journal:
        rows = list(journal.injections())
    for row in rows:
        said = f"injection {row['number']} at index {row['start_index']}: {row['mass_mg']:.2f} mg"
        assert said in outcome.err
        low, value, high = (float(str(row[f"nozzle_v_H{end}"])) for end in ("_ci95_low", "", "_ci95_high"))
        assert low < value < high
    assert [row["reasons"] for row in rows] == ["TOO_FEW_EVENTS", "TOO_FEW_EVENTS", "", ""]


def test_an_evaluation_is_refused_the_state_of_a_daemon(command: Command, worn: Path, tmp_path: Path) -> None:
    state = tmp_path / "learned.json"
    with sole_writer(state):
        outcome = command("evaluate", worn, "--save-state", state)
    assert (outcome.code, outcome.out) == (2, "")
    assert f"in use by process {os.getpid()}" in outcome.err
    command.done("evaluate", worn, "--save-state", state)
    assert [entry.name for entry in tmp_path.iterdir()] == ["learned.json"]
