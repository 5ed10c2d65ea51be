"""TRC text in the versions PEAK's tools write, and what must be refused of it."""

from pathlib import Path

import pytest

from observer_rt.files.canlog.python_can import TrcLog
from observer_rt.foundation.errors import UserError

HEADS = {
    "1.0": ";##########################################################################\n;   a.trc\n",
    "1.1": ";$FILEVERSION=1.1\n;$STARTTIME=44548.6028595139\n;\n",
    "1.3": ";$FILEVERSION=1.3\n;$STARTTIME=44548.6028595139\n;\n",
    "2.0": ";$FILEVERSION=2.0\n;$STARTTIME=44548.6028595139\n;$COLUMNS=N,O,T,I,d,l,D\n;\n",
    "2.1": ";$FILEVERSION=2.1\n;$STARTTIME=44548.6028595139\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n",
}
ROWS = {
    "1.0": (
        "     1)     17535  00000100  8  00 01 02 03 04 05 06 07\n"
        "     2)     17540  FFFFFFFF  4  00 00 00 08 -- -- -- -- BUSHEAVY\n"
        "     3)     19295      0704  1  RTR\n     4)     21097      0705  0\n"
    ),
    "1.1": (
        "     1)     17535.4  Rx     00000100  8  00 01 02 03 04 05 06 07 \n"
        "     2)     17540.3  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY \n"
        "     3)     19295.4  Rx         0704  1  RTR\n     4)     21097.1  Tx         0705  0\n"
    ),
    "1.3": (
        "     1)     17535.4 1  Rx    00000100 -  8    00 01 02 03 04 05 06 07\n"
        "     2)     17540.3 1  Warng FFFFFFFF -  4    00 00 00 08\n"
        "     3)     19295.4 1  Rx        0704 -  1    RTR\n     4)     21097.1 1  Tx        0705 -  0\n"
    ),
    "2.0": (
        "      1     17535.400 DT  00000100 Rx 8  00 01 02 03 04 05 06 07\n"
        "      2     17540.300 ST         - Rx 4  00 00 00 08\n"
        "      3     19295.400 RR      0704 Rx 1\n      4     21097.100 DT      0705 Tx 0\n"
    ),
    "2.1": (
        "      1     17535.400 DT 1  00000100 Rx -  8    00 01 02 03 04 05 06 07\n"
        "      2     17540.300 ST 1         - Rx -  4    00 00 00 08\n"
        "      3     19295.400 RR 1      0704 Rx -  1\n      4     21097.100 DT 1      0705 Tx -  0\n"
    ),
}

ERRORS = {
    "1.0": "     5)     21098      0008  4  ERROR 00 1C 02 05\n",
    "1.1": "     5)     21098.0  Error      0008  4  00 1C 02 05\n",
    "1.3": "     5)     21098.000 1  Error     0008 -  4    00 1C 02 05\n",
    "2.0": "      5     21098.000 ER          Rx    02 01 0A 00 00\n",
    "2.1": "      5     21098.000 ER 1         - Rx -  5    02 01 0A 00 00\n",
}


def log(folder: Path, text: str) -> TrcLog:
    path = folder / "bus.trc"
    path.write_text(text)
    return TrcLog(path)


@pytest.mark.parametrize("version", HEADS)
def test_versions(tmp_path: Path, version: str) -> None:
    entries = log(tmp_path, HEADS[version] + ROWS[version] + ERRORS[version])
    first, last = entries
    assert (first.frame.frame_id, first.frame.is_extended) == (0x100, True)
    assert first.frame.payload == bytes(range(8))
    assert (last.frame.frame_id, last.frame.is_extended, last.frame.payload) == (0x705, False, b"")
    assert last.is_sent is (version != "1.0")
    assert (entries.error_frames, entries.remote_frames, entries.other_entries) == (1, 1, 1)
    step = last.frame.stamp_ns - first.frame.stamp_ns
    assert step == (3_562_000_000 if version == "1.0" else 3_561_700_000)


def test_the_start_time_counts_in_days(tmp_path: Path) -> None:
    """A semicolon may end it."""
    text = ";$FILEVERSION=1.1\n;$STARTTIME=25569.5;\n     1)      0.1  Rx     0100  0\n"
    (only,) = log(tmp_path, text)
    assert only.frame.stamp_ns == 43_200 * 10**9 + 100_000


@pytest.mark.parametrize(
    ("kind", "switched", "state"),
    [("FD", False, False), ("FB", True, False), ("FE", True, True), ("BI", False, True)],
)
def test_fd_frames_by_length_code_and_by_length(tmp_path: Path, kind: str, switched: bool, state: bool) -> None:
    data = "00 " * 12
    (coded,) = log(tmp_path, HEADS["2.1"] + f"  1  1.000 {kind} 2 0100 Rx -  9 {data}\n")
    (plain,) = log(tmp_path, HEADS["2.0"] + f"  1  1.000 {kind}  0100 Rx 12 {data}\n")
    for item in (coded, plain):
        assert (item.frame.payload, item.frame.is_fd) == (bytes(12), True)
        assert (item.frame.bit_rate_switch, item.frame.error_state_indicator) == (switched, state)
    assert (coded.channel, plain.channel) == ("2", "1")


def test_messages_of_a_transport_protocol_are_left_out_and_told(tmp_path: Path) -> None:
    rows = (
        "     5)     21098.000 1  Rx    18ECFF00 -  9    01 02 03 04 05 06 07 08 09\n"
        "     6)     21099.000 1  Rx    18ECFF00 -  2    AA BB\n"
    )
    entries = log(tmp_path, HEADS["1.3"] + rows)
    assert [entry.frame.payload for entry in entries] == [b"\xaa\xbb"]
    assert any("left out: 1 entries that are no frames" in note for note in entries.notes())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEADS["2.1"] + "  1  1.0 DT 1 0100 Rx -  8 00 00\n", "line 5: not a line of a TRC log"),
        (HEADS["2.1"] + "  1  1.0 DT 1 0100 Rx -  2 00 0\n", "line 5: not a line of a TRC log"),
        (HEADS["2.1"] + "  1  1.0 DT 1 0100\n", "line 5: not a line of a TRC log"),
        (HEADS["2.1"] + "  1  1.0 DT 1 0800 Rx -  0\n", "line 5: 800 is no standard identifier"),
        (HEADS["1.1"].replace("1.1", "1.2") + "  1  1.0\n", "line 1: version '1.2' is not read"),
        (HEADS["2.1"].replace("2.1", "3.0") + "  1  1.0\n", "line 1: version '3.0' is not read"),
        (HEADS["2.1"].replace(",I,", ",") + "  1  1.0\n", "line 3: columns N,O,T,B,d,R,L,D do not suffice"),
        (HEADS["2.1"].replace("44548.6", "today "), "line 2: not a line of a TRC log"),
        ("  1  1.0 DT 1 0100 Rx -  0\n", "line 1: not a line of a TRC log"),
    ],
)
def test_malformed_logs_are_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UserError) as raised:
        list(log(tmp_path, text))
    assert said in str(raised.value)


def test_what_is_left_of_a_frame_is_not_a_shorter_one(tmp_path: Path) -> None:
    """A length cut in its second digit, and all its data with it: an empty CAN FD frame, if it were a line."""
    entries = log(tmp_path, HEADS["2.1"] + ROWS["2.1"] + "      5     21098.100 FD 1      0705 Rx -  0")
    assert len(list(entries)) == 2
    assert any("line 9 is cut short" in note for note in entries.notes())


@pytest.mark.parametrize("start", ["0", "0.0;"])
def test_a_start_of_0_is_none(tmp_path: Path, start: str) -> None:
    head = HEADS["1.1"].replace("44548.6028595139", start)
    entries = log(tmp_path, head + ROWS["1.1"])
    assert [entry.frame.stamp_ns for entry in entries] == [17_535_400_000, 21_097_100_000]
    assert f"{entries.path}: its times are taken to count from its start" in entries.notes()
