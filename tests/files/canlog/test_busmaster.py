"""Logs as BUSMASTER writes them, in its modes of time and number, and what must be refused of them."""

from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.busmaster import BusmasterLog
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.candump import CandumpLog
from observer_rt.files.formats import is_log, open_log
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import log_frames

START = int(datetime(2014, 8, 5, 11, 49, 7).timestamp()) * 10**9 + 965_000_000
NOON = int(datetime(2014, 8, 5, 12).timestamp()) * 10**9


def log(
    folder: Path, *lines: str, mode: str = "SYSTEM", radix: str = "HEX", protocol: str = "CAN"
) -> BusmasterLog:
    path = folder / "bus.log"
    head = (
        f"***BUSMASTER Ver 2.4.0***\n***PROTOCOL {protocol}***\n***NOTE: PLEASE DO NOT EDIT THIS DOCUMENT***\n"
        f"***[START LOGGING SESSION]***\n***START DATE AND TIME 5:8:2014 11:49:7:965***\n***{radix}***\n"
        f"***{mode} MODE***\n***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***\n"
    )
    path.write_text(head + "".join(f"{line}\n" for line in lines) + "***[STOP LOGGING SESSION]***\n")
    return BusmasterLog(path)


def test_frames_of_all_kinds(tmp_path: Path) -> None:
    found = log(
        tmp_path,
        "12:00:00:9420 Rx 1 0x023 s 1 40",
        "12:00:00:9440 Tx 2 0x18FEF100 x 8 03 E0 00 00 C0 00 00 FF ",
        "12:00:01:0000 Rx 1 0x023 sr 0 ",
        "12:00:01:5000 Rx 1 0x7FF s 0",
    )
    assert list(found) == [
        LogFrame(Frame(0x23, b"\x40", NOON + 942_000_000, False, False), "1"),
        LogFrame(
            Frame(0x18FEF100, bytes.fromhex("03E00000C00000FF"), NOON + 944_000_000, True, False), "2", True
        ),
        LogFrame(Frame(0x7FF, b"", NOON + 1_500_000_000, False, False), "1"),
    ]
    assert found.remote_frames == 1
    assert f"{found.path}: its stamps are tenths of milliseconds" in found.notes()


@given(
    log_frames(".trc"),
    st.sampled_from((("HEX", "02X"), ("DEC", "d"))),
    st.booleans(),
)
def test_whatever_is_logged_is_read(
    entries: list[LogFrame], numbers: tuple[str, str], of_j1939: bool
) -> None:
    radix, form = numbers
    lines, expected, previous = [], [], 0
    for entry in sorted(entries, key=lambda entry: entry.frame.stamp_ns):
        frame = entry.frame
        if of_j1939 and not frame.is_extended:
            continue
        time = previous + frame.stamp_ns % 10**12 // 100_000 * 100_000 % (3600 * 10**9)
        minutes, rest = divmod(time, 60 * 10**9)
        seconds, fraction = divmod(rest, 10**9)
        stamp = f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}:{fraction // 100_000:04d}"
        direction = "Tx" if entry.is_sent else "Rx"
        data = f"{len(frame.payload)}{''.join(f' {byte:{form}}' for byte in frame.payload)}"
        identifier = f"{frame.frame_id:{'X' if radix == 'HEX' else 'd'}}"
        lines.append(
            f"{stamp} {entry.channel} {identifier} 0x00EE00 ACL 00  FF  006 {direction} {data} "
            if of_j1939
            else f"{stamp} {direction} {entry.channel} {identifier} {'x' if frame.is_extended else 's'} {data} "
        )
        expected.append(entry._replace(frame=frame._replace(stamp_ns=START + time)))
        previous = time
    with TemporaryDirectory() as folder:
        found = log(
            Path(folder), *lines, mode="ABSOLUTE", radix=radix, protocol="J1939" if of_j1939 else "CAN"
        )
        assert list(found) == expected


def test_times_after_midnight_are_of_the_next_day(tmp_path: Path) -> None:
    found = log(
        tmp_path,
        "23:59:59:9999 Rx 1 0x023 s 0",
        "00:00:00:0001 Rx 1 0x023 s 0",
        "00:00:01:0001 Rx 1 0x023 s 0",
    )
    first, second, third = (entry.frame.stamp_ns for entry in found)
    assert (second - first, third - second) == (200_000, 10**9)


@pytest.mark.parametrize(("mode", "last"), [("ABSOLUTE", 500_000_000), ("RELATIVE", 600_000_000)])
def test_times_from_the_start_and_from_line_to_line(tmp_path: Path, mode: str, last: int) -> None:
    found = log(tmp_path, "0:00:00:1000 Rx 1 0x023 s 0", "0:00:00:5000 Rx 1 0x023 s 0", mode=mode)
    assert [entry.frame.stamp_ns - START for entry in found] == [100_000_000, last]


def test_decimal_numbers(tmp_path: Path) -> None:
    (found,) = log(tmp_path, "12:00:00:9420 Rx 1 291 s 3 255 16 7", radix="DEC")
    assert (found.frame.frame_id, found.frame.payload) == (0x123, bytes((255, 16, 7)))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("12:00:00:94201 Rx 1 0x023 s 1 40", "line 9: not a line of a BUSMASTER log"),
        ("12:00:00:9420 Rx 1 0x023 q 1 40", "line 9: not a line of a BUSMASTER log"),
        ("12:00:00:9420 Rx 1 0x023 s 1 140", "line 9: not a line of a BUSMASTER log"),
        ("12:00:00:9420 Rx 1 0x023 s 2 40", "line 9: 1 bytes follow the length 2"),
        ("12:00:00:9420 Rx 1 0x023 s 1 40 41", "line 9: 2 bytes follow the length 1"),
        ("12:00:00:9420 Rx 1 0x823 s 1 40", "line 9: 823 is no standard identifier"),
        ("***START DATE AND TIME 50:8:2014 11:49:7:965***", "line 9: .* has no date"),
    ],
)
def test_malformed_lines_are_refused(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(UserError, match=said):
        list(log(tmp_path, line))


def test_a_log_without_a_mode_of_times_is_taken_as_of_the_day(tmp_path: Path) -> None:
    """As BUSMASTER's own converters write it."""
    found = log(tmp_path, "12:00:00:9420 Rx 1 0x023 s 1 40", mode="NO")
    assert [entry.frame.stamp_ns for entry in found] == [NOON + 942_000_000]
    assert any(
        "does not say what times mean: they are taken as times of the day" in note for note in found.notes()
    )


def test_a_log_without_the_first_lines_of_its_heading(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_text("\n***HEX***\n***RELATIVE MODE***\n0:0:0:0012 Tx 1 9 s 1 07 \n0:0:0:0010 Tx 1 9 s 0 \n")
    found = open_log(path)
    assert [entry.frame.stamp_ns for entry in found] == [1_200_000, 2_200_000]
    assert f"{path}: its heading has no date: times count from 1970" in found.notes()


def test_milliseconds_without_leading_zeros_as_savvycan_writes_them(tmp_path: Path) -> None:
    found = log(tmp_path, "12:00:00:942 Rx 0 0000021A s 1 FE ", "12:00:01:2 Rx 0 0000021A s 1 FE ")
    assert [entry.frame.stamp_ns - NOON for entry in found] == [942_000_000, 1_002_000_000]
    assert f"{found.path}: its stamps are milliseconds" in found.notes()
    with pytest.raises(UserError, match="line 10: not a line of"):
        list(log(tmp_path, "12:00:00:9420 Rx 1 0x023 s 0", "12:00:01:942 Rx 1 0x023 s 0"))


def test_a_log_of_j1939(tmp_path: Path) -> None:
    found = log(
        tmp_path,
        "12:00:00:5344 1 18eeff00 0x00EE00 ACL 00  FF  006 Tx 8 01 00 00 00 00 00 00 80 ",
        "12:00:00:7168 2 1ceafffe 0x00EA00 RQST_ACL FE  FF  007 Rx 3 00 EE 00 ",
        "12:00:00:9000 2 18fecaf9 0x00FECA BAM F9  FF  006 Rx 9 00 EE 00 00 00 00 00 00 00 ",
        protocol="J1939",
    )
    assert list(found) == [
        LogFrame(Frame(0x18EEFF00, bytes((1, *[0] * 6, 0x80)), NOON + 534_400_000, True, False), "1", True),
        LogFrame(Frame(0x1CEAFFFE, b"\x00\xee\x00", NOON + 716_800_000, True, False), "2"),
    ]
    assert found.other_entries == 1  # put together by a transport protocol


def test_a_log_of_another_bus_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="line 2: it is a log of LIN"):
        list(log(tmp_path, "13:11:35:4424 Tx 1 0x001 1 FF  0x3E (Enhanced) ", protocol="LIN"))


def test_its_content_tells_it_from_candumps(tmp_path: Path) -> None:
    path = log(tmp_path, "12:00:00:9420 Rx 1 0x023 s 1 40").path
    assert is_log(path)
    assert isinstance(open_log(path), BusmasterLog)
    path.write_text("(1.5) can0 123#00\n")
    assert isinstance(open_log(path), CandumpLog)
