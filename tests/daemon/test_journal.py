"""The journal: entries can be read by anyone, at any time; those that cannot be written wait."""

import math
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from observer_rt import __version__
from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector_sections import StateConfig
from observer_rt.daemon.journal import COLUMNS, JournalWriter, Row, read_journal
from observer_rt.daemon.keeper import keeper_of
from observer_rt.daemon.state_file import model_hash
from observer_rt.engine.reports.news import MeasuredMass, MissingInjection
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.model.surroundings import Surroundings
from tests.daemon.participants import until
from tests.daemon.samples import some_knowledge, some_report


@pytest.fixture(scope="session")
def bench() -> Bench:
    return load_bench()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "injections.sqlite"


@pytest.fixture
def messages() -> list[str]:
    return []


@pytest.fixture
def journal(path: Path, bench: Bench, messages: list[str]) -> JournalWriter:
    return JournalWriter(path, bench, messages.append)


def rows(path: Path) -> list[Row]:
    return read_journal(path).injections


def numbers(path: Path) -> list[int]:
    return [int(str(row["number"])) for row in rows(path)]


def write(journal: JournalWriter, *numbers: int) -> None:
    for number in numbers:
        journal(some_report(number))
    journal.write()


@pytest.fixture
def locked(path: Path) -> Iterator[threading.Event]:
    free, taken = threading.Event(), threading.Event()

    def hold() -> None:
        with closing(sqlite3.connect(path, isolation_level=None)) as connection:
            connection.execute("BEGIN EXCLUSIVE")
            taken.set()
            free.wait(60)

    holder = threading.Thread(target=hold)
    holder.start()
    taken.wait(60)
    yield free
    free.set()
    holder.join()


def test_an_injection_is_a_row_of_typed_columns(path: Path, journal: JournalWriter) -> None:
    write(journal, 1)
    (row,) = rows(path)
    assert list(row) == ["run", *COLUMNS]
    expected = {
        "number": 1,
        "start_index": 6000,
        "end_index": 6100,
        "rail_pressure_MPa": 120.0,
        "mass_mg": pytest.approx(41.501),
        "mass_ci95_low_mg": pytest.approx(41.001),
        "mass_ci95_high_mg": pytest.approx(42.001),
        "mass_source": "event",
        "measured_mass_mg": None,
        "peak_rate_mm3_per_ms": pytest.approx(69.0),
        "valid": 1,
        "reasons": "",
        "state": "ADAPTED",
        "fuel_temperature_degC": pytest.approx(40.0),
        "command": 1,
        "opening_delay_us": pytest.approx(320.0),
        "energizing_time_us": pytest.approx(1100.0),
        "nozzle_v_H": 0.3,
        "nozzle_v_H_ci95_low": pytest.approx(0.3 - 0.0196),
        "nozzle_v_H_ci95_high": pytest.approx(0.3 + 0.0196),
        "line_pressure_sensor_offset_MPa": pytest.approx(30.0),
        "guide_leakage_ci95_low_m3_per_s_Pa": pytest.approx((0.3 - 0.0196) * 6e-5 / 1e8),
    }
    assert {name: row[name] for name in expected} == expected
    for name, kind in COLUMNS.items():
        assert isinstance(row[name], (int if kind is bool else kind) | None), name


def test_what_is_not_known_is_null(path: Path, journal: JournalWriter) -> None:
    unknown: dict[str, Any] = {"budget": None, "commanded": None, "surroundings": Surroundings()}
    unknown |= {"mass": math.nan, "peak_rate": math.nan, "valid": False, "reason": Reason.SAMPLES_LOST}
    journal(some_report(1, **unknown))
    journal.write()
    (row,) = rows(path)
    assert row["mass_source"] == "live_rate"
    for name in ("mass_mg", "mass_ci95_low_mg", "peak_rate_mm3_per_ms", "fuel_temperature_degC", "command"):
        assert row[name] is None
    assert (row["valid"], row["reasons"]) == (0, "SAMPLES_LOST")


def test_a_run_says_what_it_was(path: Path, journal: JournalWriter, bench: Bench) -> None:
    journal.write()
    (run,) = read_journal(path).runs
    assert run["software_version"] == __version__
    assert run["model_sha256"] == model_hash(bench.injector.parameters)
    assert run["bench_file"] == str(bench.path)
    assert '"rate_hz":100000.0' in str(run["configuration_json"])
    assert run["stopped_utc"] is None
    journal.finish()
    (run,) = read_journal(path).runs
    assert str(run["stopped_utc"]) >= str(run["started_utc"])


def test_runs_follow_one_another_in_one_file(path: Path, bench: Bench) -> None:
    path.touch()  # hardly begun
    assert read_journal(path) == ([], [])
    for _ in range(3):
        journal = JournalWriter(path, bench, print)
        write(journal, 1, 2)
        journal.finish()
    assert (numbers(path), len({row["run"] for row in rows(path)})) == ([1, 2, 1, 2, 1, 2], 3)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]  # whole without files beside it


def test_what_was_measured_is_added(path: Path, journal: JournalWriter) -> None:
    report = some_report(1)
    journal(report)
    journal.write()
    journal(MeasuredMass(report, 42.5e-6))
    journal(some_report(2))
    journal(MeasuredMass(some_report(2), 43.5e-6))
    journal(MissingInjection(1, 2, 0.003))
    journal.write()
    assert [row["measured_mass_mg"] for row in rows(path)] == [pytest.approx(42.5), pytest.approx(43.5)]


def test_many_injections_are_written_in_several_batches(path: Path, journal: JournalWriter) -> None:
    write(journal, *range(1, 1202))
    assert (numbers(path), journal.written) == (list(range(1, 1202)), 1201)


def test_a_file_that_is_moved_away_is_whole_and_a_new_one_begun(path: Path, journal: JournalWriter) -> None:
    write(journal, 1)
    moved = path.with_name("old.sqlite")
    path.rename(moved)
    write(journal, 2)
    assert (numbers(moved), numbers(path)) == ([1], [2])
    path.unlink()
    journal(some_report(3))
    journal.finish()
    assert numbers(path) == [3]


def test_a_removed_journal_is_told_and_counted(path: Path, journal: JournalWriter, messages: list[str]) -> None:
    """Nothing new need be written for that: the next one has the run at once."""
    write(journal, 1, 2, 3)
    path.unlink()
    journal.write()
    journal.write()
    assert [text.split("\n")[0] for text in messages] == [
        f"warning: journal {path}: the journal was removed, with 3 injections of this run"
    ]
    assert [len(each) for each in read_journal(path)] == [1, 0]
    write(journal, 4)
    assert journal.finish() == (
        f"1 injections in the journal {path}, 1 of this run; 3 more were in a journal that was removed"
    )


def test_what_cannot_be_written_waits(path: Path, journal: JournalWriter, locked: threading.Event) -> None:
    with pytest.raises(RunError, match=r"s\.sqlite: the journal cannot be written: database is locked"):
        write(journal, 1, 2, 3)
    assert journal.written == 0
    locked.set()
    until(lambda: not path.with_name(path.name + "-journal").exists())
    write(journal, 4)
    assert numbers(path) == [1, 2, 3, 4]


def test_too_many_waiting_are_counted_and_told(
    path: Path, journal: JournalWriter, messages: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("observer_rt.daemon.journal.MOST_WAITING", 100)
    write(journal, *range(1, 108))
    assert journal.lost == 7
    assert messages == [f"warning: journal {path}: 7 injections lost so far, for want of room to keep them"]
    assert numbers(path) == list(range(1, 101))
    journal.write()
    assert len(messages) == 1


def test_files_that_are_no_journal_are_refused(tmp_path: Path, path: Path, bench: Bench) -> None:
    path.write_text("number,mass_mg\n1,41.5\n" * 100)
    with pytest.raises(UserError, match="is no journal of injections: file is not a database"):
        JournalWriter(path, bench, print)
    other = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(other)) as connection:
        connection.execute("CREATE TABLE songs (title TEXT)")
    for use in (lambda: JournalWriter(other, bench, print), lambda: read_journal(other)):
        with pytest.raises(UserError, match="is a database of another program"):
            use()
    with pytest.raises(UserError, match="no such file"):
        read_journal(tmp_path / "missing.sqlite")


def test_an_older_journal_goes_on_a_newer_is_refused(path: Path, journal: JournalWriter, bench: Bench) -> None:
    write(journal, 1)
    journal.finish()
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("ALTER TABLE injection DROP COLUMN mass_source")
    write(JournalWriter(path, bench, print), 2)
    assert [row["mass_source"] for row in rows(path)] == [None, "event"]
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA user_version = 2")
    with pytest.raises(UserError, match="newer version: schema 2"):
        JournalWriter(path, bench, print)


def test_a_damaged_journal_is_told_of(path: Path, journal: JournalWriter) -> None:
    write(journal, *range(1, 400))
    journal.finish()
    content = bytearray(path.read_bytes())
    content[8192:] = bytes(len(content) - 8192)
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"is damaged: .*\n  remedy: save what is left"):
        rows(path)


def test_the_keeper_writes_it_beside_the_loop(path: Path, bench: Bench, messages: list[str]) -> None:
    quick = bench.with_sections(state=StateConfig(save_within_s=0.4))
    with keeper_of(quick, None, path, messages.append) as keeper, keeper.keeping(some_knowledge):
        (listener,) = keeper.listeners
        for number in range(1, 6):
            listener(some_report(number))
            until(lambda: path.exists() and numbers(path)[-1:] == [number])  # noqa: B023 - called at once
        listener(some_report(6))
    assert numbers(path) == list(range(1, 7))
    assert messages[-1] == f"6 injections in the journal {path}, 6 of this run"
