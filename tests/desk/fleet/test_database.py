"""Results in a database: as those in a folder."""

from collections.abc import Callable
from pathlib import Path

import duckdb
import pytest

from observer_rt.desk.fleet.database import Database, read_injections, results_at
from observer_rt.desk.fleet.dataset import Dataset, Results
from observer_rt.desk.fleet.job import SCHEMA, FailedFile
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import rows

SETTINGS = {"bench": "a", "learning": True}


def test_the_suffix_decides(tmp_path: Path) -> None:
    assert isinstance(results_at(tmp_path / "results", SETTINGS), Dataset)
    assert isinstance(results_at(tmp_path / "results.duckdb", SETTINGS), Database)


@pytest.mark.parametrize("name", ["results", "results.duckdb"])
def test_what_was_taken_is_there_for_the_next_run(tmp_path: Path, name: str) -> None:
    out = tmp_path / name
    with results_at(out, SETTINGS) as first:
        first.take(Path("x.csv"), "aa", rows("aa", "one", [0.1, 0.2], age=12.5))
        first.take(Path("y.csv"), "bb", rows("bb", "two", []))
        first.take_failures([FailedFile(Path("bad.csv"), "cc", "bad.csv: is empty")])
    assert first.injections == 2
    with results_at(out, SETTINGS) as again:
        assert [again.is_done(sha256) for sha256 in ("aa", "bb", "cc")] == [True, True, False]
    found = read_injections(out)
    assert found.select(SCHEMA.names).equals(rows("aa", "one", [0.1, 0.2], age=12.5))
    assert read_injections(out, ("number", "age")).schema.names == ["number", "age"]


def test_rows_are_there_with_the_note_that_they_are_done_or_not_at_all(tmp_path: Path) -> None:
    out = tmp_path / "results.duckdb"
    with Database(out, SETTINGS) as database:
        database.take(Path("x.csv"), "aa", rows("aa", "one", [0.1]))
        with pytest.raises(UserError):  # the note is there already: its second rows must not be
            database.take(Path("x.csv"), "aa", rows("aa", "one", [0.1]))
    assert read_injections(out).num_rows == 1


def test_failures_are_those_of_the_last_run(tmp_path: Path) -> None:
    out = tmp_path / "results.duckdb"
    with Database(out, SETTINGS) as database:
        database.take_failures([FailedFile(Path("bad.csv"), "cc", "bad.csv: is empty")])
        assert [each.sha256 for each in database.failed] == ["cc"]
    with duckdb.connect(str(out)) as opened:
        assert opened.sql("SELECT file, problem FROM errors").fetchall() == [("bad.csv", "bad.csv: is empty")]
    with Database(out, SETTINGS):
        pass
    with duckdb.connect(str(out)) as opened:
        assert opened.sql("FROM errors").fetchall() == []


@pytest.mark.parametrize("opens", [lambda path: Database(path, SETTINGS), read_injections])
def test_a_file_that_is_no_database_is_refused(tmp_path: Path, opens: Callable[[Path], Results]) -> None:
    (tmp_path / "results.duckdb").write_text("a letter")
    with pytest.raises(UserError, match=r"results\.duckdb: is no database"):
        opens(tmp_path / "results.duckdb")


def test_another_model_needs_another_file_and_none_is_said(tmp_path: Path) -> None:
    with Database(tmp_path / "results.duckdb", SETTINGS):
        pass
    with pytest.raises(UserError, match="learning"):
        Database(tmp_path / "results.duckdb", {**SETTINGS, "learning": False})
    with pytest.raises(UserError, match="no such file"):
        read_injections(tmp_path / "other.duckdb")
