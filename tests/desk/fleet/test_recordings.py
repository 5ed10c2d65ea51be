"""What a user names as recordings, what their paths say, and what says when they were made."""

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from asammdf import MDF, Signal

from observer_rt.config.bench import load_bench
from observer_rt.desk.fleet.job import Task, evaluate_file
from observer_rt.desk.fleet.recordings import PathPattern, TimeFrom, injector_of, recordings_in, zero_of
from observer_rt.files.formats import open_recording, write_recording
from observer_rt.foundation.errors import UserError
from tests.device import worn_recording
from tests.files.signals.foreign import RATE, bench, write
from tests.files.signals.test_csv_dialects import FORMATS, ISO, OF_DAY, START, lines, named


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b.csv", "a.mf4", "a.csv.truth.csv", "b.shots.csv", "notes.txt", "deep/er/c.blf"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return tmp_path


def test_a_folder_is_all_recordings_below_it(folder: Path) -> None:
    names = [str(path.relative_to(folder)) for path in recordings_in([str(folder)])]
    assert names == ["a.mf4", "b.csv", "deep/er/c.blf"]


def test_patterns_and_files_come_in_order_and_once(folder: Path) -> None:
    paths = recordings_in([str(folder / "b.csv"), str(folder / "*.csv"), str(folder / "**" / "*.blf")])
    assert [path.name for path in paths] == ["b.csv", "a.csv.truth.csv", "c.blf"]


@pytest.mark.parametrize("nothing", ["absent.csv", "absent_*.csv", "empty"])
def test_a_name_of_nothing_is_refused(folder: Path, nothing: str) -> None:
    (folder / "empty").mkdir()
    with pytest.raises(UserError, match=nothing.replace("*", r"\*")):
        recordings_in([str(folder / nothing)])


def test_the_injector_is_read_off_the_path() -> None:
    path = Path("runs/inj_07/x.csv")
    assert PathPattern.read("--injector-from", r"inj_(\d+)").text_in(path) == "07"
    assert PathPattern.read("--injector-from", r"inj_\d+").text_in(path) == "inj_07"
    assert injector_of(path, None, load_bench()) == "injector_1"
    with pytest.raises(UserError, match=r"x\.csv"):
        PathPattern.read("--injector-from", r"inj_(\d+)").text_in(Path("x.csv"))
    with pytest.raises(UserError, match=r"--injector-from \(: is no regular expression"):
        PathPattern.read("--injector-from", "(")


@pytest.mark.parametrize(
    ("path", "date"),
    [
        ("a/injector_7_20260301_120501.csv", datetime(2026, 3, 1, 12, 5, 1, tzinfo=UTC)),
        ("2026-03-01/run.csv", datetime(2026, 3, 1, tzinfo=UTC)),
    ],
)
def test_a_path_says_when_a_recording_was_made(path: str, date: datetime) -> None:
    dates = PathPattern.read("--time-from", r"(\d{8}_\d{6}|\d{4}-\d\d-\d\d)")
    assert dates.date_in(Path(path)) == date
    with pytest.raises(UserError, match="finds no date"):
        dates.date_in(Path("a/run_99999999_999999.csv"))


WHEN = datetime(2026, 3, 1, 12, 5, tzinfo=UTC)


@pytest.mark.parametrize("form", [form for form in FORMATS if form != OF_DAY])
def test_a_column_of_calendar_time_says_it(tmp_path: Path, form: str) -> None:
    path = write(tmp_path, named(*lines(decimal="." if form == ISO else ",", form=form)))
    stream = open_recording(path, bench(tmp_path, time=form).injector)
    zero, by = zero_of(path, stream)
    assert by == TimeFrom.COLUMN
    assert abs((zero - START).total_seconds()) < 1e-3


def test_so_does_one_that_counts_from_1970(tmp_path: Path) -> None:
    rows = [f"{WHEN.timestamp() + k / RATE:.5f};{100 + k % 2};{k % 3};{90 + k % 2}" for k in range(400)]
    path = write(tmp_path, named(*rows))
    stream = open_recording(path, bench(tmp_path, time='unit = "s"').injector)
    zero, by = zero_of(path, stream)
    assert (zero.timestamp(), by) == (0.0, TimeFrom.COLUMN)
    assert stream.stretches[0].start == pytest.approx(WHEN.timestamp(), abs=0.1)


def test_the_header_of_an_mdf_file_says_it(tmp_path: Path) -> None:
    path, time = tmp_path / "own.mf4", np.arange(5000) * 2e-5
    with MDF(version="4.10") as file:
        for name, unit in (("rail_pressure", "MPa"), ("needle_lift", "mm"), ("line_pressure", "MPa")):
            file.append(Signal(np.linspace(1.0, 2.0, 5000), time, name=name, unit=unit))
        file.start_time = WHEN
        file.save(path)
    assert zero_of(path, open_recording(path)) == (WHEN, TimeFrom.HEADER)


def test_else_it_is_when_the_file_was_written_which_the_rows_say(tmp_path: Path) -> None:
    path = tmp_path / "worn_20260301_1205.parquet"
    write_recording(path, worn_recording(3))
    os.utime(path, (1e9, 1e9))
    table = evaluate_file(Task(load_bench().exact, tmp_path), path, "hash")
    assert isinstance(table, pa.Table)
    first = table.to_pylist()[0]
    assert first["time_from"] == TimeFrom.WRITTEN
    assert first["time"] < datetime.fromtimestamp(1e9, UTC)
