"""A column that is no signal, such as operating hours: its first number."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal

from observer_rt.config.bench import load_bench
from observer_rt.files.formats import first_number, write_recording
from observer_rt.foundation.errors import UserError
from tests.device import worn_recording
from tests.files.signals.foreign import COLUMNS, PLACES, bench, write

OWN = load_bench().injector


def test_beside_our_own_columns(tmp_path: Path) -> None:
    recording = worn_recording(1)
    path = tmp_path / "own.parquet"
    write_recording(path, replace(recording, injection_rate=None))
    hours = np.full(recording.samples, 812.5)
    hours[:3] = np.nan
    pq.write_table(pq.read_table(path).append_column("hours", pa.array(hours)), path)
    assert first_number(path, OWN, "hours") == 812.5


@pytest.mark.parametrize(("text", "column"), [("", "Betriebsstunden"), (PLACES, "5")])
def test_in_a_layout_of_ones_own(tmp_path: Path, text: str, column: str) -> None:
    names = ["t;p_Rail;lift;p_Line;Betriebsstunden"] if not text else []
    lines = [f"0,{k:02};1;2;3;4711,5" for k in range(40)]
    path = write(tmp_path, "\n".join([*names, *lines]) + "\n")
    described = bench(tmp_path, text=text or COLUMNS)
    assert first_number(path, described.injector, column) == 4711.5


def test_in_another_group_of_an_mdf4_file(tmp_path: Path) -> None:
    path, time = tmp_path / "own.mf4", np.arange(50) * 2e-5
    with MDF(version="4.10") as file:
        names = ("rail_pressure", "needle_lift", "line_pressure")
        file.append([Signal(np.ones(50), time, name=name, unit="MPa") for name in names])
        file.append([Signal(np.array([33.0, 34.0]), np.array([0.0, 1.0]), name="hours")])
        file.save(path)
    assert first_number(path, OWN, "hours") == 33.0


def test_a_file_without_it_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    write_recording(path, worn_recording(1))
    with pytest.raises(UserError, match=r"own\.csv.*'hours'"):
        first_number(path, OWN, "hours")
