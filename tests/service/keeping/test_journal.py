"""The journal: what is written is read, by anyone, at any time; what cannot be written waits."""

import math
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from observer_rt import __version__
from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector import StateConfig
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.observer.stream.state import Reason
from observer_rt.service.keeping.journal_columns import COLUMNS, INDICATORS
from observer_rt.service.keeping.journal_reading import Row, reading_journal
from observer_rt.service.keeping.keeper import keeper_of
from observer_rt.service.keeping.notebook import MOST_WAITING, Notebook
from observer_rt.service.reports.news import MeasuredMass, Mismatch
from observer_rt.service.state_file import model_hash
from tests.service.keeping.report_samples import some_report
from tests.service.participants import until


@pytest.fixture
def bench() -> Bench:
    return load_bench()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "injections.sqlite"


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def notebook(path: Path, bench: Bench, told: list[str]) -> Notebook:
    return Notebook(path, bench, told.append)


def rows(path: Path) -> list[Row]:
    with reading_journal(path) as journal:
        return list(journal.injections())


def numbers(path: Path) -> list[int]:
    return [int(str(row["number"])) for row in rows(path)]


@pytest.fixture
def locked(path: Path) -> Iterator[threading.Event]:
    """Another program that has the journal to itself until the event is set."""
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


def test_an_injection_is_a_row_of_typed_columns(path: Path, notebook: Notebook) -> None:
    notebook(some_report(1))
    notebook.write()
    (row,) = rows(path)
    assert list(row) == ["run", *(column.name for column in COLUMNS)]
    expected = {
        "number": 1,
        "start_index": 6000,
        "end_index": 6100,
        "rail_pressure_MPa": 120.0,
        "mass_mg": pytest.approx(41.501),
        "mass_ci95_low_mg": pytest.approx(41.0),
        "mass_ci95_high_mg": pytest.approx(42.0),
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
    kinds = {"INTEGER": int, "REAL": float, "TEXT": str}
    for column in COLUMNS:
        assert isinstance(row[column.name], kinds[column.kind] | None), column


def test_what_is_not_known_is_null(path: Path, notebook: Notebook) -> None:
    notebook(
        some_report(
            mass=math.nan,
            peak_rate=math.nan,
            mass_ci95=None,
            valid=False,
            reason=Reason.SAMPLES_LOST,
            fuel_temperature=None,
            commanded=None,
        )
    )
    notebook.write()
    (row,) = rows(path)
    for name in ("mass_mg", "mass_ci95_low_mg", "peak_rate_mm3_per_ms", "fuel_temperature_degC", "command"):
        assert row[name] is None
    assert (row["valid"], row["reasons"]) == (0, "SAMPLES_LOST")


def test_a_run_says_what_it_was(path: Path, notebook: Notebook, bench: Bench) -> None:
    notebook.write()
    with reading_journal(path) as journal:
        (run,) = journal.runs()
    assert run["software_version"] == __version__
    assert run["model_sha256"] == model_hash(bench.injector.parameters)
    assert run["bench_file"] == str(bench.path)
    assert '"rate_hz":100000.0' in str(run["configuration_json"])
    assert run["stopped_utc"] is None
    notebook.finish()
    with reading_journal(path) as journal:
        (run,) = journal.runs()
    assert str(run["stopped_utc"]) >= str(run["started_utc"])


def test_runs_follow_one_another_in_one_file(path: Path, bench: Bench) -> None:
    for _ in range(3):
        notebook = Notebook(path, bench, print)
        for number in (1, 2):
            notebook(some_report(number))
        notebook.finish()
    assert numbers(path) == [1, 2, 1, 2, 1, 2]
    assert len({row["run"] for row in rows(path)}) == 3
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]  # whole without files beside it


def test_what_was_measured_is_added(path: Path, notebook: Notebook) -> None:
    report = some_report(1)
    notebook(report)
    notebook.write()
    notebook(MeasuredMass(report, 42.5e-6))
    notebook(some_report(2))
    notebook(MeasuredMass(some_report(2), 43.5e-6))
    notebook(Mismatch(True, 1, 2, 0.003))
    notebook.write()
    assert [row["measured_mass_mg"] for row in rows(path)] == [pytest.approx(42.5), pytest.approx(43.5)]


def test_many_injections_are_written_in_several_batches(path: Path, notebook: Notebook) -> None:
    for number in range(1, 1202):
        notebook(some_report(number))
    notebook.write()
    assert numbers(path) == list(range(1, 1202))
    assert notebook.written == 1201


def test_it_is_read_while_it_is_written(path: Path, notebook: Notebook) -> None:
    notebook(some_report(1))
    notebook.write()
    with reading_journal(path) as journal:
        assert journal.count() == 1
        notebook(some_report(2))
        notebook.write()
        assert journal.count() == 1  # one state of the file
    assert numbers(path) == [1, 2]


def test_a_file_that_is_moved_away_is_whole_and_a_new_one_begun(path: Path, notebook: Notebook) -> None:
    notebook(some_report(1))
    notebook.write()
    moved = path.with_name("old.sqlite")
    path.rename(moved)
    notebook(some_report(2))
    notebook.write()
    assert numbers(moved) == [1]
    assert numbers(path) == [2]
    path.unlink()
    notebook(some_report(3))
    notebook.finish()
    assert numbers(path) == [3]


def test_what_cannot_be_written_waits(path: Path, notebook: Notebook, locked: threading.Event) -> None:
    for number in range(1, 4):
        notebook(some_report(number))
    with pytest.raises(
        RunError, match=r"injections\.sqlite: the journal cannot be written: database is locked"
    ):
        notebook.write()
    assert notebook.written == 0
    locked.set()
    until(lambda: not path.with_name(path.name + "-journal").exists())
    notebook(some_report(4))
    notebook.write()
    assert numbers(path) == [1, 2, 3, 4]


def test_too_many_waiting_are_counted_and_told(path: Path, notebook: Notebook, told: list[str]) -> None:
    for number in range(1, MOST_WAITING + 8):
        notebook(some_report(number))
    notebook.write()
    assert notebook.lost == 7
    assert told == [f"warning: journal {path}: 7 injections lost so far, for want of room to keep them"]
    assert numbers(path) == list(range(1, MOST_WAITING + 1))
    notebook.write()
    assert len(told) == 1


def test_a_journal_of_a_version_that_learned_less_goes_on(
    path: Path, notebook: Notebook, bench: Bench
) -> None:
    notebook(some_report(1))
    notebook.finish()
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(f"ALTER TABLE injection DROP COLUMN {INDICATORS[-1].value}")
    assert INDICATORS[-1].value not in rows(path)[0]
    again = Notebook(path, bench, print)
    again(some_report(1))
    again.finish()
    assert [row[INDICATORS[-1].value] is None for row in rows(path)] == [True, False]


def test_files_that_are_no_journal_are_refused(tmp_path: Path, path: Path, bench: Bench) -> None:
    path.write_text("number,mass_mg\n1,41.5\n" * 100)
    with pytest.raises(UserError, match="is no journal of injections: file is not a database"):
        Notebook(path, bench, print)
    other = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(other)) as connection:
        connection.execute("CREATE TABLE songs (title TEXT)")
    for use in (lambda: Notebook(other, bench, print), lambda: reading_journal(other).__enter__()):
        with pytest.raises(UserError, match="is a database of another program"):
            use()
    with pytest.raises(UserError, match="no such file"):
        reading_journal(tmp_path / "missing.sqlite").__enter__()


def test_a_newer_schema_is_refused(path: Path, notebook: Notebook, bench: Bench) -> None:
    notebook.finish()
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA user_version = 2")
    with pytest.raises(UserError, match="newer version: schema 2"):
        Notebook(path, bench, print)


def test_a_journal_that_is_hardly_begun_is_an_empty_one(path: Path, bench: Bench) -> None:
    path.touch()
    with reading_journal(path) as journal:
        assert (journal.count(), journal.runs(), list(journal.injections()), journal.spans(3)) == (
            0,
            [],
            [],
            [],
        )
    notebook = Notebook(path, bench, print)
    notebook(some_report(1))
    notebook.finish()
    assert numbers(path) == [1]


def test_a_damaged_journal_is_told_of(path: Path, notebook: Notebook) -> None:
    for number in range(1, 400):
        notebook(some_report(number))
    notebook.finish()
    content = bytearray(path.read_bytes())
    content[8192:] = bytes(len(content) - 8192)
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"is damaged: .*\n  remedy: save what is left"):
        rows(path)


class Knowing:
    """Learns nothing."""

    knowledge = None


def test_the_keeper_writes_it_beside_the_loop(path: Path, bench: Bench, told: list[str]) -> None:
    quick = bench.with_sections(state=StateConfig(save_within_s=0.4))
    with keeper_of(quick, None, path, told.append) as keeper, keeper.keeping(Knowing()):  # type: ignore[arg-type]
        (listener,) = keeper.listeners
        for number in range(1, 6):
            listener(some_report(number))
            until(lambda: path.exists() and numbers(path)[-1:] == [number])  # noqa: B023 - called at once
        listener(some_report(6))
    assert numbers(path) == list(range(1, 7))
    assert told[-1] == f"6 injections in the journal {path}"


def test_the_wear_over_time_is_that_of_valid_injections(path: Path, notebook: Notebook) -> None:
    for number in range(1, 25):
        notebook(some_report(number, valid=number > 2, rail_pressure=1e6 * (60 + number)))
    notebook.write()
    with reading_journal(path) as journal:
        spans = journal.spans(12)
    assert [span.injections for span in spans] == [2] * 12
    assert [span.valid for span in spans] == [0] + [2] * 11
    assert (spans[1].lowest_rail_MPa, spans[1].highest_rail_MPa) == (63.0, 64.0)
    assert spans[0].wear[0].value is None
    assert spans[1].wear[0].value == pytest.approx(0.3)
    assert spans[1].wear[0].low == pytest.approx(0.3 - 0.0196)
