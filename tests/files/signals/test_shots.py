"""Tables of shots beside recordings: where they stand for a column, and the tables that are refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from observer_rt.files.formats import read_recording, write_recording
from observer_rt.foundation.errors import UserError
from tests.device import simulated

OWN, FOREIGN = "start_s,length_us", "No;Start [ms];Length [ms]"


def _recorded(folder: Path, header: str, shots: str, suffix: str = ".csv") -> Path:
    """A recording of .3 s at 50 kHz without lift, and a table of shots beside it."""
    path, recording = folder / f"run{suffix}", simulated()
    columns = {"p_Rail [MPa]": recording.rail_pressure / 1e6, "p_line [MPa]": recording.line_pressure / 1e6}
    if header == FOREIGN:
        pd.DataFrame({"t [s]": recording.time, **columns}).to_csv(path, sep=";", index=False)
    elif suffix == ".csv":
        own = dict(zip(("rail_pressure_MPa", "line_pressure_MPa"), columns.values(), strict=True))
        pd.DataFrame({"time_s": recording.time, **own}).to_csv(path, index=False)
    else:
        own = {"rail_pressure_Pa": recording.rail_pressure, "line_pressure_Pa": recording.line_pressure}
        pd.DataFrame({"time_s": recording.time, **own}).to_parquet(path)
    path.with_suffix(".shots.csv").write_text(f"{header}\n{shots}\n")
    return path


@pytest.mark.parametrize(
    ("header", "shots", "suffix"),
    [
        (OWN, "0.150004,300\n0.152,1900", ".csv"),
        (OWN, "0.150004,300\n0.152,1900", ".parquet"),
        (FOREIGN, "1;150.004;.3\n2;152;1.9", ".csv"),
    ],
)
def test_it_stands_for_the_column(tmp_path: Path, header: str, shots: str, suffix: str) -> None:
    recording = read_recording(_recorded(tmp_path, header, shots, suffix))
    assert not recording.has_lift
    assert recording.energizing is not None
    edges = np.flatnonzero(np.diff(recording.energizing))
    assert (edges + 1).tolist() == [7500, 7515, 7600, 7695]


@pytest.mark.parametrize(
    ("header", "shots", "line", "problem"),
    [
        ("start,length_us", "0.15,300", 1, "no column is named start with a unit"),
        (OWN, "0.15,300\n0.16,-1", 3, "length that is not above 0"),
        (OWN, "0.15,300\n0.16,", 3, "no start, or no length"),
        (OWN, "0.16,300\n0.15,300", 3, "starts before the one above it"),
        (OWN, "0.15,1900\n0.151,300", 3, "before the one above it has ended"),
        (OWN, "0.15,300\n9,300", 3, "not within its recording, 0 to"),
        (OWN, "-0.1,300\n0.15,300", 2, "not within its recording, 0 to"),
    ],
)
def test_wrong_tables_are_refused(tmp_path: Path, header: str, shots: str, line: int, problem: str) -> None:
    path = _recorded(tmp_path, header, shots)
    with pytest.raises(UserError, match=problem) as raised:
        read_recording(path)
    assert raised.value.location == f"{path.with_suffix('.shots.csv')}, line {line}"
    assert raised.value.remedy


def test_one_source_is_needed_and_not_two(tmp_path: Path) -> None:
    path = _recorded(tmp_path, OWN, "0.15,300")
    with pytest.raises(UserError, match="the shots beside a recording"):
        read_recording(path.with_suffix(".shots.csv"))
    level = np.zeros(simulated().samples)
    write_recording(path, simulated().with_arrays({"energizing": level}))
    with pytest.raises(UserError, match="with a column 'energizing'"):
        read_recording(path)
    path.with_suffix(".shots.csv").unlink()
    assert read_recording(path).has_lift
