"""CSV recordings and shots beside them: exact round trip, and errors that name the place for each way to be wrong."""

import re
from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.formats import read_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError

HEADER = "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa"


def write(folder: Path, text: str, shots: str = "") -> Path:
    path = folder / "recording.csv"
    if shots:
        path.with_suffix(".shots.csv").write_text(shots)
    path.write_text(text)
    return path


def rows(count: int = 20) -> list[str]:
    return [f"{i * 1e-5:.5f},100.005,0.01,99.995" for i in range(count)]


def test_units_and_names(tmp_path: Path) -> None:
    header = HEADER.replace("rail_pressure_MPa,needle_lift_mm", "needle_lift_mm,rail_pressure_MPa")
    path = write(
        tmp_path, f"{header},injection_rate_mm3_per_ms\n0,0.15003,100.005,99.995,53.17\n1e-5,0,100,99,-1.5\n"
    )
    recording = read_recording(path)
    assert (recording.rail_pressure[0], recording.needle_lift[0]) == (100_005_000.0, 15003e-8)
    assert recording.line_pressure[0] == 99_995_000.0
    assert recording.injection_rate is not None
    assert (recording.injection_rate.tolist(), recording.sample_rate) == ([5317e-8, -150e-8], 1e5)
    assert recording.path == path


def test_written_header_and_cells(tmp_path: Path) -> None:
    path = tmp_path / "recording.csv"
    nan = np.array([np.nan, 1e8])
    write_recording(path, Recording(np.array([0.0, 0.25]), nan, np.array([1e-8, 3e-4]), nan, np.array([0.0, 1e-8])))
    lines = [HEADER + ",injection_rate_mm3_per_ms", "0,,1e-05,,0", "0.25,100,0.3,100,0.01"]
    assert path.read_text().splitlines() == lines


@pytest.mark.parametrize("cell", ["", " ", "nan", "NaN"])
def test_empty_and_nan_cells_are_not_available(tmp_path: Path, cell: str) -> None:
    recording = read_recording(write(tmp_path, with_row(4, f"0.00004,{cell},0.01,{cell}")))
    assert np.flatnonzero(np.isnan(recording.rail_pressure)).tolist() == [4]
    assert np.flatnonzero(np.isnan(recording.line_pressure)).tolist() == [4]
    assert not np.isnan(recording.needle_lift).any()


def test_byte_order_mark_crlf_and_blank_last_lines(tmp_path: Path) -> None:
    """And a last one without its end, which may be cut."""
    path = tmp_path / "recording.csv"
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join([HEADER, *rows(), "", "", "0.0002,10"]).encode())
    recording = read_recording(path)
    assert recording.samples == 20
    assert recording.notes == (f"{path}: its last line has no line end and is left out: it may be cut short",)


def with_row(number: int, row: str) -> str:
    lines = rows()
    lines[number] = row
    return "\n".join([HEADER, *lines])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEADER.replace("rail_", "rial_") + "\n0,1,1,1\n", "rail_pressure: no heading names it"),
        ("time_s,rail_pressure_MPa,line_pressure_MPa\n0,1,1\n", "needle_lift: no heading names it"),
        (HEADER + ",time_s\n", "'time_s' appears 2 times"),
        ("", "is empty"),
        ("\n", "is empty"),
        (HEADER, "holds no sample"),
        (HEADER + "\n", "holds no sample"),
        (HEADER + "\n0,1,1,1\n", "line 2: holds one sample only"),
        *(
            (with_row(11, f"0.00011,100,{bad},99"), f"line 13: column needle_lift_mm: '{bad}' is not a number")
            for bad in ("abc", "1.2.3", "1_0", "0x10", "10\x1c", "1\0", "True")
        ),
        (with_row(3, "0.00003,inf,0,99"), "line 5: rail_pressure is infinite"),
        (with_row(3, "0.00003,1e308,0,99"), "line 5: rail_pressure is infinite, or larger than any measurement"),
        ("1," * 200_000, "line 1: has more than 262144 characters"),
        ("\n".join([HEADER, *rows(300), "1" * 300_000]), "line 302: has more than 262144 characters"),
        (with_row(11, "0.00011,100,0.01"), "line 13: 3 cells, but there are 4"),
        (with_row(11, "0.00011,100,0.01,99,1"), "line 13: 5 cells, but there are 4"),
        (with_row(11, "0.00009,100,0,99"), "line 13: time steps back"),
        (with_row(11, "0.00010,100,0,99"), "line 13: time repeats"),
        (with_row(11, "0.00012,100,0,99"), "line 13: gap in time"),
        (with_row(11, ",100,0,99"), "line 13: the time is not a finite number"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UserError, match=re.escape(said)) as raised:
        read_recording(write(tmp_path, text))
    assert "cut it at the gap" not in raised.value.remedy or "line 13: " in said  # none of a file too short


def test_blank_lines_count_as_lines(tmp_path: Path) -> None:
    lines = rows()
    lines[15] = "0.5,100,0,99"
    with pytest.raises(UserError, match="line 19: gap in time"):
        read_recording(write(tmp_path, "\n".join([HEADER, "", *lines[:4], "", *lines[4:]])))


@pytest.mark.parametrize("name", ["worn.csv.truth.csv", "worn.shots.csv"])
def test_what_is_beside_a_recording_is_refused_by_name(tmp_path: Path, name: str) -> None:
    """`*.csv` catches it, too."""
    path = tmp_path / name
    path.write_text("time_s,sac_pressure_MPa\n0,5\n")
    with pytest.raises(UserError, match=r"behind a simulated recording, or the shots.*\n  remedy: .*leave it out"):
        read_recording(path)


NO_LIFT = "\n".join([HEADER.replace("needle_lift_mm", "note"), *rows(), ""])
FOREIGN = "\n".join(["t_s,p_Rail_MPa,note,p_line_MPa", *rows(300), ""])
SHOTS = "start_s,length_us\n"
WRONG_SHOTS = ("0.0001,", "0.0001,-20", "0.0001,9", "0.00004,20", "0.00019,20")  # after a shot from 0 to 50 us


@pytest.mark.parametrize("text", [NO_LIFT, FOREIGN])
@pytest.mark.parametrize("shots", [f"{SHOTS}0.000024,50\n0.0001,30", "Beginn [ms];Dauer [ms]\n,024;,05\n,1;,03\n"])
def test_shots_stand_for_the_lift(tmp_path: Path, text: str, shots: str) -> None:
    recording = read_recording(write(tmp_path, text, shots))
    assert np.flatnonzero(recording.signals["energizing"]).tolist() == [2, 3, 4, 5, 6, 10, 11, 12]


@pytest.mark.parametrize(
    ("shots", "text", "said"),
    [
        ("start,length_us\n0.00002,50\n", NO_LIFT, "shots.csv, line 1: no start and length with units"),
        ("start_s,length_us,length_ms\n0,50,.05\n", NO_LIFT, "shots.csv, line 1: no start and length with units"),
        (SHOTS, NO_LIFT, "shots.csv: has no 2 numbers in a line"),
        (f"{SHOTS},50\n0,50", NO_LIFT, "shots.csv, line 2: nan to nan s is no shot between 0 and 0.0002 s"),
        (f"{SHOTS}0,50\n1,2,3", NO_LIFT, "shots.csv, line 3: 3 cells"),
        (f"{SHOTS}0,50\n1,long", NO_LIFT, "shots.csv, line 3: column length_us (energizing): 'long' is not a number"),
        *((f"{SHOTS}0,50\n{shot}", NO_LIFT, "no shot between 5e-05 and 0.0002 s") for shot in WRONG_SHOTS),
        (f"{SHOTS}0,50", NO_LIFT.replace("note", "energizing"), "'energizing'"),
        (f"{SHOTS}0,50", FOREIGN + FOREIGN.partition("\n")[2], "or whose time begins anew"),
    ],
)
def test_shots_that_cannot_be_are_refused(tmp_path: Path, shots: str, text: str, said: str) -> None:
    with pytest.raises(UserError, match=re.escape(said)):
        read_recording(write(tmp_path, text, shots))
