"""ASC text as Vector's tools write it, and what must be refused of it."""

from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.python_can import AscLog
from observer_rt.foundation.errors import UserError

DATE = "Sam Sep 30 15:06:13.191 2017"
START = int(datetime(2017, 9, 30, 15, 6, 13).timestamp()) * 10**9 + 191_000_000
FD_TAIL = "  102187  133   303000 e000fb6c 46500250 4b140250 20011736 2001040d"


def log(folder: Path, *lines: str, base: str = "hex", times: str = "absolute", date: str = DATE) -> AscLog:
    head = f"date {date}\nbase {base}  timestamps {times}\ninternal events logged\n// version 9.0.0\n"
    path = folder / "bus.asc"
    path.write_text(
        f"{head}Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
        + "".join(f"{line}\n" for line in lines)
        + "End TriggerBlock\n",
        encoding="utf-8",
    )
    return AscLog(path)


def read(folder: Path, *lines: str, base: str = "hex", times: str = "absolute") -> list[LogFrame]:
    return list(log(folder, *lines, base=base, times=times))


def test_classic_frames_with_what_follows_them(tmp_path: Path) -> None:
    """A length code above 8 means 8 bytes."""
    extended, standard, longer = read(
        tmp_path,
        "   3.098426 1  18EBFF00x       Rx d 8 01 A0 0F A6 60 3B D1 40    Length = 273910 BitCount = 141",
        " 113.016026 2  6F9             Tx   d 2 05 0C  Length = 240015 BitCount = 124 ID = 1785",
        " 113.258671 1  3FF             Tx   d D 55 AA 01 02 03 04 05 06  Length = 2",
    )
    assert longer.frame.payload == bytes.fromhex("55AA010203040506")
    data = bytes.fromhex("01A00FA6603BD140")
    assert extended == LogFrame(Frame(0x18EBFF00, data, START + 3_098_426_000, True, False), "1")
    assert standard == LogFrame(Frame(0x6F9, b"\x05\x0c", START + 113_016_026_000, False, False), "2", True)


def test_fd_frames_with_and_without_a_name(tmp_path: Path) -> None:
    named, plain = read(
        tmp_path,
        f"   0.045522 CANFD   62 Rx         7d  BrakeSnData_4      1 0 9 12 {'1b ' * 12}{FD_TAIL}",
        f"   0.045636 CANFD   62 Tx         88x                    0 1 8  8 {'00 ' * 8}{FD_TAIL}",
    )
    assert named == LogFrame(Frame(0x7D, b"\x1b" * 12, START + 45_522_000, False, True, True), "62")
    frame = Frame(0x88, bytes(8), START + 45_636_000, True, True, False, True)
    assert plain == LogFrame(frame, "62", True)


def test_the_flags_of_a_line_say_whether_it_is_fd_unless_its_length_does(tmp_path: Path) -> None:
    tail = "  102187  133   200000 e000fb6c 46500250 4b140250 20011736 2001040d"
    classic, longer = read(
        tmp_path,
        f"   0.045522 CANFD   1 Rx         7d      0 0 8  8 {'00 ' * 8}{tail}",
        f"   0.1 CANFD   4 Rx        123              1 0 9 12 {'11 ' * 12}200000 11 0 0 0 0",
    )
    assert not classic.frame.is_fd
    assert (longer.frame.is_fd, longer.frame.bit_rate_switch, longer.frame.payload) == (True, True, b"\x11" * 12)


def test_decimal_numbers_and_comments(tmp_path: Path) -> None:
    lines = (";  time  can ident", "// 1.0 1 7 Rx d 0", "   -0.5 1  256x       Rx d 3 255 16 7")
    (entry,) = read(tmp_path, *lines, base="dec")
    assert (entry.frame.frame_id, entry.frame.payload) == (256, bytes((255, 16, 7)))
    assert entry.frame.stamp_ns - START == -500_000_000  # before the trigger
    with pytest.raises(UserError, match="line 7: its CAN FD frames are hexadecimal"):
        read(tmp_path, "   0.1 CANFD   1 Rx  291  1 0 3  3 1 17 255" + FD_TAIL, base="dec")


def test_the_kind_of_times_may_stand_on_its_own_line(tmp_path: Path) -> None:
    complete = log(tmp_path, *["   0.5 1  123             Rx   d 1 AA"] * 3, times="relative")
    text = complete.path.read_text()
    complete.path.write_text(text.replace("hex  timestamps", "hex\ntimestamps"))
    assert [entry.frame.stamp_ns - START for entry in complete] == [500_000_000, 10**9, 1_500_000_000]


@given(st.lists(st.integers(1, 20_000), min_size=100, max_size=300))
def test_distances_are_no_times_from_the_start(steps: list[int]) -> None:
    with TemporaryDirectory() as folder:
        lines = [f"   {step / 1e6:.6f} 1  123             Rx   d 1 AA" for step in steps]
        entries = read(Path(folder), *lines, times="relative")
    assert entries[-1].frame.stamp_ns - START == sum(steps) * 1000


def test_times_from_line_to_line_count_every_line(tmp_path: Path) -> None:
    first, second = read(
        tmp_path,
        "   1.000000 1  100       Rx d 0",
        "   0.250000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%",
        "   0.250001 1  100       Rx d 0",
        times="relative",
    )
    assert (first.frame.stamp_ns - START, second.frame.stamp_ns - START) == (1_000_000_000, 1_500_001_000)


@pytest.mark.parametrize(
    ("date", "moment"),
    [
        ("Thu Apr 28 10:44:52.480 am 2022", datetime(2022, 4, 28, 10, 44, 52, 480_000)),
        ("Thu Apr 28 10:44:52.480 pm 2022", datetime(2022, 4, 28, 22, 44, 52, 480_000)),
        ("Thu Apr 28 12:44:52 am 2022", datetime(2022, 4, 28, 0, 44, 52)),
        ("Mit Mär 2 13:00:00.000 2019", datetime(2019, 3, 2, 13)),
        ("Don Mai 2 13:00:00 2019", datetime(2019, 5, 2, 13)),
        ("Mon Dez 2 13:00:00.000 2019", datetime(2019, 12, 2, 13)),
    ],
)
def test_dates_of_twelve_hours_and_german_ones(tmp_path: Path, date: str, moment: datetime) -> None:
    (entry,) = log(tmp_path, " 0.0 1  1   Rx d 0", date=date)
    assert entry.frame.stamp_ns == int(moment.timestamp()) * 10**9 + moment.microsecond * 1000


def test_a_date_not_understood_is_told_and_times_count_from_0(tmp_path: Path) -> None:
    entries = log(tmp_path, " 1.5 1  1   Rx d 0", date="mer. août 2 13:00:00.000 2019")
    assert [entry.frame.stamp_ns for entry in entries] == [1_500_000_000]
    assert any("not understood, times count from 0" in note for note in entries.notes())


@pytest.mark.parametrize(
    ("time", "base", "first", "late"),
    [
        ("3:06:14 pm", "", 54400.5, 26.5),
        ("3:06:14 pm", " timestamps absolute", 54400.5, 54400.5),
        ("3:06:14 pm", "", 0.5, 0.5),
        ("12:00:14 am", "", 20.5, 20.5),
    ],
)
def test_times_of_day_are_known_by_the_date(tmp_path: Path, time: str, base: str, first: float, late: float) -> None:
    """As BUSMASTER writes them."""
    path = tmp_path / "bus.asc"
    path.write_text(f"date Sat Sep 30 {time} 2017\nbase hex{base}\n{first} 1 7 Rx d 0\n")
    start = datetime(2017, 9, 30, 15, 6, 14) if "pm" in time else datetime(2017, 9, 30, 0, 0, 14)
    reader = AscLog(path)
    assert [entry.frame.stamp_ns for entry in reader] == [round((start.timestamp() + late) * 10) * 10**8]
    assert any("of the day" in note for note in reader.notes()) == (late == 26.5)


def test_a_date_stands_unless_the_trigger_block_has_another(tmp_path: Path) -> None:
    text = log(tmp_path, "   0.500000 1  123             Rx   d 1 AA").path.read_text()
    path = tmp_path / "other.asc"
    for block in ("Begin Triggerblock", "Begin Triggerblock Dies Datum liest niemand"):
        path.write_text(text.replace(f"Begin Triggerblock {DATE}", block))
        reader = AscLog(path)
        assert ([entry.frame.stamp_ns for entry in reader], reader.notes()) == ([START + 500_000_000], [])


def test_what_is_no_data_frame_is_counted(tmp_path: Path) -> None:
    result = log(
        tmp_path,
        "   0.015991 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0",
        "   1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%",
        "   2.501000 1 ErrorFrame",
        "   2.501010 1 ErrorFrame ECC: 10100010",
        "   2.501020 CANFD 2 Rx ErrorFrame Not Acknowledge error, dominant error flag",
        "   2.520002 3 200 Tx r Length = 1704000 BitCount = 145 ID = 88888888x",
        "   2.584921 4 300 Tx r 8 Length = 1704000 BitCount = 145 ID = 88888888x",
        "   3.297743 1  J1939TP FEE3p        6    0  0   -   Rx   d 23 A0 0F A6 60",
        "   3.3 1  100   TxRq d 1 00",
        "   3.4 1  100   Tx d 1 00",
    )
    assert len(list(result)) == 1
    assert (result.error_frames, result.remote_frames, result.other_entries) == (3, 2, 4)
    (note,) = result.notes()
    assert note == f"{result.path}: left out: 3 error frames, 2 remote frames, 4 entries that are no frames"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("   3.1 1  100   Rx d 4 01 02 03 04 05 06 07 08", "not a line of an ASC log"),
        ("   3.1 1  100   Rx d 8 " + "00 " * 12, "not a line of an ASC log"),
        ("   3.1 1  100   Rx d 9 " + "00 " * 11, "not a line of an ASC log"),
        ("   3.1 1  100   Rx d 8 01 A0 0F", "not a line of an ASC log"),
        ("   3.1 1  100   Rx d 3 01 A0 F", "not a line of an ASC log"),
        ("   3.1 1  100   Rx d 3 01 A0 GG", "not a line of an ASC log"),
        ("   3.1 1  100   Rx x 3 01 A0 00", "not a line of an ASC log"),
        ("   3.1 1  100", "not a line of an ASC log"),
        ("   3.1 1  800   Rx d 0", "800 is no standard identifier"),
        ("   3.1 1  EngineData   Rx d 1 00", "not a line of an ASC log: '3.1 1  EngineData"),
        ("   3.1 CANFD 1 Rx 100  1 0 9 12 00 00", "not a line of an ASC log"),
        ("   3.1 CANFD 1 Rx 100  1 0 9 8 00 00 00 00 00 00 00 00", "not a line of an ASC log"),
        ("   3.1 CANFD 1 Rx 100  1 0 9 11 " + "00 " * 11, "not a line of an ASC log"),
        ("\x01\x02\x03", "not a line of an ASC log"),
    ],
)
def test_malformed_lines_are_refused_with_their_number(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(UserError, match=r"line 7: ") as raised:
        read(tmp_path, line)
    assert said in str(raised.value)


def test_a_decimal_line_without_its_end_is_left_out(tmp_path: Path) -> None:
    entries = log(tmp_path, "   0.5 1  256       Rx d 1 255", base="dec")
    entries.path.write_text(entries.path.read_text().removesuffix("5\nEnd TriggerBlock\n"))
    assert list(entries) == []
    assert any("line 7 is cut short" in note for note in entries.notes())


def test_an_empty_frame_and_a_remote_one_on_a_channel_of_can_fd(tmp_path: Path) -> None:
    """Both count as remote frames: neither carries data."""
    tail = "  102187  133   {} e000fb6c 46500250 4b140250 20011736 2001040d"
    lines = [
        f"   0.1 CANFD   1 Rx   7d   0 0 {flags[1]} 0 {tail.format(flags[0])}" for flags in (("1000", 0), ("10", 8))
    ]
    entries = log(tmp_path, *lines)
    assert not list(entries)
    assert entries.remote_frames == 2
