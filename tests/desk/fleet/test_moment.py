"""When a recording was made: by its content, else by when the file was written, and which of them it was."""

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from asammdf import MDF, Signal

from observer_rt.config.bench import load_bench
from observer_rt.desk.fleet.job import Task, evaluated
from observer_rt.desk.fleet.recordings import TimeFrom, zero_of
from observer_rt.files.formats import open_recording, write_recording
from tests.device import worn_recording
from tests.files.signals.foreign import RATE, bench
from tests.files.signals.test_csv_unnamed import FORMATS, ISO, START, rows, write

WHEN = datetime(2026, 3, 1, 12, 5, tzinfo=UTC)


@pytest.mark.parametrize("form", FORMATS)
def test_a_column_of_calendar_time_says_it(tmp_path: Path, form: str) -> None:
    path = write(tmp_path, ["t;p_Rail;lift;p_Line", *rows(";", "." if form == ISO else ",", form)])
    stream = open_recording(path, bench(tmp_path, time=form).injector)
    zero, by = zero_of(path, stream)
    assert by == TimeFrom.COLUMN
    assert abs((zero - START).total_seconds()) < 1e-3


def test_so_does_one_that_counts_from_1970(tmp_path: Path) -> None:
    lines = [f"{WHEN.timestamp() + k / RATE:.5f};{100 + k % 2};{k % 3};{90 + k % 2}" for k in range(400)]
    path = write(tmp_path, ["t;p_Rail;lift;p_Line", *lines])
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
    table = evaluated(Task(load_bench(), tmp_path), path, "hash")
    assert isinstance(table, pa.Table)
    first = table.to_pylist()[0]
    assert first["time_from"] == TimeFrom.WRITTEN
    assert first["time"] < datetime.fromtimestamp(1e9, UTC)
