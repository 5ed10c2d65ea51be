"""CSV recordings: exact round trip, and an error that names the place for each way to be wrong."""

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.foundation.errors import UserError
from observer_rt.recording.formats import read_recording, write_recording
from observer_rt.recording.signals.recording import Recording

HEADER = "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa"

reuse_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


def write(folder: Path, text: str) -> Path:
    path = folder / "recording.csv"
    path.write_text(text)
    return path


def rows(count: int = 20) -> list[str]:
    return [f"{i * 1e-5:.5f},100.005,0.01,99.995" for i in range(count)]


def message(path: Path) -> str:
    with pytest.raises(UserError) as raised:
        read_recording(path)
    return str(raised.value)


def test_units_and_names(tmp_path: Path) -> None:
    header = HEADER + ",injection_rate_mm3_per_ms"
    path = write(tmp_path, f"{header}\n0,100.005,0.15003,99.995,53.17\n1e-5,100,0,99,-1.5\n")
    recording = read_recording(path)
    assert recording.rail_pressure[0] == 100_005_000.0
    assert recording.needle_lift[0] == 15003e-8
    assert recording.line_pressure[0] == 99_995_000.0
    assert recording.injection_rate is not None
    assert recording.injection_rate.tolist() == [5317e-8, -150e-8]
    assert recording.sample_rate == 1e5
    assert recording.path == path


def test_written_header_and_cells(tmp_path: Path) -> None:
    path = tmp_path / "recording.csv"
    nan = np.array([np.nan, 1e8])
    write_recording(
        path, Recording(np.array([0.0, 0.25]), nan, np.array([1e-8, 3e-4]), nan, np.array([0.0, 1e-8]))
    )
    assert path.read_text().splitlines() == [
        HEADER + ",injection_rate_mm3_per_ms",
        "0,,1e-05,,0",
        "0.25,100,0.3,100,0.01",
    ]


@given(order=st.permutations(range(4)))
@reuse_folder
def test_columns_in_any_order(tmp_path: Path, order: list[int]) -> None:
    names = HEADER.split(",")
    cells = [["0", "100", "0.1", "90"], ["1e-5", "101", "0.2", "91"]]
    lines = [",".join(names[i] for i in order), *(",".join(row[i] for i in order) for row in cells)]
    recording = read_recording(write(tmp_path, "\n".join(lines)))
    assert recording.rail_pressure.tolist() == [100e6, 101e6]
    assert recording.line_pressure.tolist() == [90e6, 91e6]


@pytest.mark.parametrize("cell", ["", " ", "nan", "NaN"])
def test_empty_and_nan_cells_are_not_available(tmp_path: Path, cell: str) -> None:
    lines = rows()
    lines[4] = f"0.00004,{cell},0.01,{cell}"
    recording = read_recording(write(tmp_path, "\n".join([HEADER, *lines])))
    assert np.flatnonzero(np.isnan(recording.rail_pressure)).tolist() == [4]
    assert np.flatnonzero(np.isnan(recording.line_pressure)).tolist() == [4]
    assert not np.isnan(recording.needle_lift).any()


def test_byte_order_mark_crlf_and_blank_last_lines(tmp_path: Path) -> None:
    path = tmp_path / "recording.csv"
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join([HEADER, *rows(), "", ""]).encode())
    assert read_recording(path).samples == 20


def test_unknown_column_names_the_nearest(tmp_path: Path) -> None:
    path = write(tmp_path, HEADER.replace("rail_pressure_MPa", "rail_presure_MPa") + "\n")
    text = message(path)
    assert "line 1: unknown column 'rail_presure_MPa'" in text
    assert "the nearest is 'rail_pressure_MPa'" in text


def test_missing_column(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,rail_pressure_MPa,line_pressure_MPa\n0,1,1\n")
    assert "column 'needle_lift_mm' is missing" in message(path)


def test_column_twice(tmp_path: Path) -> None:
    assert "'time_s' appears 2 times" in message(write(tmp_path, HEADER + ",time_s\n"))


def test_semicolons(tmp_path: Path) -> None:
    assert "separated by ';'" in message(write(tmp_path, HEADER.replace(",", ";") + "\n0;1,5;0;1\n"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("\n", "is empty, or begins with an empty line"),
        (HEADER, "holds no sample"),
        (HEADER + "\n", "holds no sample"),
        (HEADER + "\n0,1,1,1\n", "line 2: holds one sample only"),
    ],
)
def test_too_short_files(tmp_path: Path, text: str, said: str) -> None:
    found = message(write(tmp_path, text))
    assert said in found
    assert "cut it at the gap" not in found


@pytest.mark.parametrize("bad", ["abc", "1.2.3", "--", "0x10", "10\x1c"])
def test_non_numeric_cell_names_line_and_column(tmp_path: Path, bad: str) -> None:
    lines = rows()
    lines[11] = f"0.00011,100,{bad},99"
    text = message(write(tmp_path, "\n".join([HEADER, *lines])))
    assert f"line 13: column needle_lift_mm: '{bad}' is not a number" in text


def test_infinite_cell(tmp_path: Path) -> None:
    lines = rows()
    lines[3] = "0.00003,inf,0,99"
    assert "line 5: rail_pressure is infinite" in message(write(tmp_path, "\n".join([HEADER, *lines])))


@pytest.mark.parametrize("line", ["0.00011,100,0.01", "0.00011,100,0.01,99,1"])
def test_line_with_too_few_or_many_cells(tmp_path: Path, line: str) -> None:
    lines = rows()
    lines[11] = line
    found = f"line 13: {line.count(',') + 1} cells, but the header has 4"
    assert found in message(write(tmp_path, "\n".join([HEADER, *lines])))


@pytest.mark.parametrize(
    ("stamp", "problem"),
    [("0.00009", "steps back"), ("0.00010", "repeats"), ("0.00012", "gap"), ("", "not a finite number")],
)
def test_bad_time_names_the_line(tmp_path: Path, stamp: str, problem: str) -> None:
    lines = rows()
    lines[11] = f"{stamp},100,0,99"
    text = message(write(tmp_path, "\n".join([HEADER, *lines])))
    assert "line 13: " in text
    assert problem in text


def test_blank_lines_count_as_lines(tmp_path: Path) -> None:
    lines = rows()
    lines[15] = "0.5,100,0,99"
    text = message(write(tmp_path, "\n".join([HEADER, "", *lines[:4], "", *lines[4:]])))
    assert "line 19: gap in time" in text


@pytest.mark.slow
def test_a_million_rows_take_seconds(tmp_path: Path) -> None:
    n = 1_000_000
    pressure = np.random.default_rng(0).integers(0, 60_000, n).astype(np.float64) * 5000.0
    recording = Recording(np.arange(n) / 1e5, pressure, pressure / 1e13, pressure)
    begin = time.perf_counter()
    write_recording(tmp_path / "long.csv", recording)
    read = read_recording(tmp_path / "long.csv")
    assert time.perf_counter() - begin < 20.0  # 2 s on an idle machine
    assert np.array_equal(read.rail_pressure, pressure)


def test_truth_of_a_simulation_is_refused_by_name(tmp_path: Path) -> None:
    """`*.csv` catches it, too."""
    path = tmp_path / "worn.csv.truth.csv"
    path.write_text("time_s,sac_pressure_MPa\n0,5\n")
    with pytest.raises(UserError, match="truth behind a simulated recording") as error:
        read_recording(path)
    assert "leave it out" in str(error.value.remedy)
