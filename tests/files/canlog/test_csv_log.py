"""CSV logs of python-can: read as it writes them, distinguished from recordings, refused where malformed."""

import base64
from pathlib import Path

import can
import pytest

from observer_rt.files.formats import is_log, open_log
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import message_of, mixture, moved

HEADING = "timestamp,arbitration_id,extended,remote,error,dlc,data"


def test_what_python_can_writes(tmp_path: Path) -> None:
    """It has no channels, and seconds as floats."""
    path = tmp_path / "bus.csv"
    frames = [frame._replace(channel="1", is_sent=False) for frame in mixture(".trc", 50)]
    with can.CSVWriter(path) as writer:
        for frame in frames:
            writer(message_of(frame))
        end = frames[-1].frame.stamp_ns / 1e9
        writer(can.Message(timestamp=end, is_error_frame=True))
        writer(can.Message(timestamp=end, is_remote_frame=True))
    assert is_log(path)
    log = open_log(path)
    assert moved(log, frames) < 2000
    assert (log.error_frames, log.remote_frames) == (1, 1)


def test_times_from_a_start(tmp_path: Path) -> None:
    path = tmp_path / "bus.csv"
    path.write_text(f"{HEADING}\n1e-05,0x1,0,0,0,1,{base64.b64encode(b'a').decode()}\n")
    log = open_log(path)
    assert [entry.frame.stamp_ns for entry in log] == [10_000]
    assert log.notes() == [f"{path}: its times are taken to count from its start"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1e999,0x1,0,0,0,1,YQ==", "line 2: not a line of a CSV log of python-can"),
        ("1e18,0x1,0,0,0,1,YQ==", "line 2: its time is before 1970, or after 2262"),
        ("1.5,0x1,0,0,0,2,YQ==", "line 2: not a line of a CSV log of python-can"),
        ("1.5,0x1,0,0,0,1", "line 2: not a line of a CSV log of python-can"),
        ("1.5,0x823,0,0,0,1,YQ==", "line 2: 823 is no standard identifier"),
    ],
)
def test_malformed_lines_are_refused(tmp_path: Path, line: str, said: str) -> None:
    path = tmp_path / "bus.csv"
    path.write_text(f"{HEADING}\n{line}\n")
    with pytest.raises(UserError, match=said):
        list(open_log(path))


@pytest.mark.parametrize("heading", ["time_s,rail_pressure_MPa", "ID,Data Bytes", "", "TimestampEpoch,BusChannel"])
def test_other_csv_files_are_no_logs(tmp_path: Path, heading: str) -> None:
    path = tmp_path / "bus.csv"
    path.write_text(f"{heading}\n1,2\n")
    assert not is_log(path)
