"""CSV logs of other programs: read as they are written, told from recordings, refused where malformed."""

import base64
from pathlib import Path
from tempfile import TemporaryDirectory

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.can_frame import FD_LENGTHS, length_code
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.csv_log import CsvLog
from observer_rt.files.formats import is_log, open_log
from observer_rt.foundation.errors import UserError

START = 1_581_670_628_161_550_000
SAVVYCAN = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"
CSS = "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes"
PYTHON_CAN = "timestamp,arbitration_id,extended,remote,error,dlc,data"


@st.composite
def entries(draw: st.DrawFn, with_fd: bool) -> list[LogFrame]:
    found = []
    stamp = START
    for _ in range(draw(st.integers(1, 6))):
        stamp += draw(st.integers(1, 10**6)) * 1000
        is_fd, is_extended = with_fd and draw(st.booleans()), draw(st.booleans())
        size = draw(st.sampled_from(FD_LENGTHS if is_fd else FD_LENGTHS[:9]))
        payload = draw(st.binary(min_size=size, max_size=size))
        identifier = draw(st.integers(0, 0x1FFF_FFFF if is_extended else 0x7FF))
        frame = Frame(identifier, payload, stamp, is_extended, is_fd, is_fd and draw(st.booleans()))
        found.append(LogFrame(frame, str(draw(st.integers(0, 3))), draw(st.booleans())))
    return found


def read(text: str) -> list[LogFrame]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bus.csv"
        path.write_text(text)
        assert is_log(path)
        return list(open_log(path))


@given(entries(with_fd=False))
def test_logs_of_savvycan(frames: list[LogFrame]) -> None:
    lines = [SAVVYCAN]
    for frame, channel, is_sent in frames:
        cells = [f"{byte:02X}" for byte in frame.payload.ljust(8, b"\0")]
        flags = f"{str(frame.is_extended).lower()},{'Tx' if is_sent else 'Rx'},{channel}"
        lines.append(
            f"{frame.stamp_ns // 1000},{frame.frame_id:08X},{flags},{len(frame.payload)},{','.join(cells)},"
        )
    assert read("\n".join([*lines, ""])) == frames


@given(entries(with_fd=True))
def test_logs_of_css_electronics(frames: list[LogFrame]) -> None:
    lines = [CSS]
    for frame, channel, is_sent in frames:
        seconds, rest = divmod(frame.stamp_ns, 10**9)
        length = len(frame.payload)
        lines.append(
            f"{seconds}.{rest // 1000:06d};{channel};{frame.frame_id:X};{frame.is_extended:d};{length_code(length)};"
            f"{length};{is_sent:d};{frame.is_fd:d};{frame.bit_rate_switch:d};{frame.payload.hex().upper()}"
        )
    assert read("\r\n".join([*lines, ""])) == frames


@given(entries(with_fd=False))
def test_logs_of_python_can(frames: list[LogFrame]) -> None:
    """By its own writer; it has no channels, and seconds as floats."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bus.csv"
        with can.CSVWriter(path) as writer:
            for frame, *_ in frames:
                writer.on_message_received(
                    can.Message(
                        timestamp=frame.stamp_ns / 1e9,
                        arbitration_id=frame.frame_id,
                        is_extended_id=frame.is_extended,
                        data=frame.payload,
                    )
                )
            writer.on_message_received(can.Message(timestamp=START / 1e9, is_error_frame=True))
            writer.on_message_received(can.Message(timestamp=START / 1e9, is_remote_frame=True))
        log = open_log(path)
        found = list(log)
    assert [entry.frame._replace(stamp_ns=0) for entry in found] == [
        frame._replace(stamp_ns=0) for frame, *_ in frames
    ]
    assert all(abs(a.frame.stamp_ns - b.frame.stamp_ns) < 1000 for a, b in zip(found, frames, strict=True))
    assert (log.error_frames, log.remote_frames) == (1, 1)


def test_times_from_a_start(tmp_path: Path) -> None:
    path = tmp_path / "bus.csv"
    path.write_text(f"{PYTHON_CAN}\n1e-05,0x1,0,0,0,1,{base64.b64encode(b'a').decode()}\n")
    log = open_log(path)
    assert [entry.frame for entry in log] == [Frame(1, b"a", 10_000, False, False)]
    assert log.notes() == [f"{path}: its times are taken to count from its start"]


def test_columns_that_are_not_known_are_told(tmp_path: Path) -> None:
    """As one whose name is damaged."""
    path = tmp_path / "bus.csv"
    path.write_text(f"{SAVVYCAN.replace('Dir', 'Dhr')}\n166064000,21A,false,Tx,0,1,FE\n")
    log = open_log(path)
    assert [entry.is_sent for entry in log] == [False]
    assert f"{path}: its columns Dhr are not known and left out" in log.notes()


@pytest.mark.parametrize(
    ("heading", "line", "said"),
    [
        (CSS, "1581670628.1;1;123;0;2;2;0;0;0;12", "line 2: 1 bytes follow the length 2"),
        (CSS, "1581670628.1;1;123;0;1;1;0;0;0;1_2", "line 2: not a line of a CSV log"),
        (CSS, "1581670628.1;1;123;2;1;1;0;0;0;12", "line 2: not a line of a CSV log"),
        (CSS, "1581670628.1;1;823;0;1;1;0;0;0;12", "line 2: 823 is no standard identifier"),
        (CSS, "1581670628.1;1;123", "line 2: not a line of a CSV log"),
        (SAVVYCAN, "166064000,21A,false,Rx,0,3,FE,36", "line 2: 2 bytes follow the length 3"),
        (SAVVYCAN, "166064000,21A,false,Rx,0,2,FE,361", "line 2: not a line of a CSV log"),
        (SAVVYCAN, "166064000,21A,false,Rx,0,2,,36", "line 2: not a line of a CSV log"),
        (SAVVYCAN, "1660640:0,21A,false,Rx,0,1,FE", "line 2: not a line of a CSV log"),
        (PYTHON_CAN, "1e999,0x1,0,0,0,1,YQ==", "line 2: not a line of a CSV log"),
        (PYTHON_CAN, "1e300,0x1,0,0,0,1,YQ==", "line 2: its time is before 1970, or after 2262"),
        (PYTHON_CAN, "1.5,0x1,0,0,0,1,Y?==", "line 2: not a line of a CSV log"),
    ],
)
def test_malformed_lines_are_refused(tmp_path: Path, heading: str, line: str, said: str) -> None:
    path = tmp_path / "bus.csv"
    path.write_text(f"{heading}\n{line}\n")
    with pytest.raises(UserError, match=said):
        list(open_log(path))


@pytest.mark.parametrize(
    "heading", ["time_s,rail_pressure_MPa", "ID,Data Bytes", "", "TimestampEpoch;BusChannel;ID"]
)
def test_other_csv_files_are_no_logs(tmp_path: Path, heading: str) -> None:
    path = tmp_path / "bus.csv"
    path.write_text(f"{heading}\n1,2\n")
    assert not is_log(path)
    with pytest.raises(UserError, match="line 1: not a line of a CSV log" if heading else "line 2"):
        list(CsvLog(path))
