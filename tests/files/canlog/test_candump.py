"""The candump log reader against text as candump writes it, and against text it must refuse."""

from pathlib import Path

import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.candump import CandumpLog
from observer_rt.foundation.errors import UserError


def log(folder: Path, text: str) -> CandumpLog:
    path = folder / "candump.2024-05-03.log"
    path.write_text(text)
    return CandumpLog(path)


def read(folder: Path, text: str) -> list[LogFrame]:
    return list(log(folder, text))


def message(folder: Path, text: str) -> str:
    with pytest.raises(UserError) as raised:
        read(folder, text)
    return str(raised.value)


def test_frames_of_all_kinds(tmp_path: Path) -> None:
    text = (
        "(1700000000.000123) vcan0 100##1AABB\n(1700000000.000124) can1 18DAF110#0102\n"
        "(1700000000.000125) can1 7FF#\n(1700000000.000126) can1 00000100##3\n"
    )
    stamp = 1_700_000_000_000_123_000
    assert read(tmp_path, text) == [
        LogFrame(Frame(0x100, b"\xaa\xbb", stamp, False, True, True), "vcan0"),
        LogFrame(Frame(0x18DAF110, b"\1\2", stamp + 1000, True, False), "can1"),
        LogFrame(Frame(0x7FF, b"", stamp + 2000, False, False), "can1"),
        LogFrame(Frame(0x100, b"", stamp + 3000, True, True, True, True), "can1"),
    ]


def test_direction_and_raw_length_suffixes_are_accepted(tmp_path: Path) -> None:
    text = "(1.5) vcan0 100#AA R\n(1.600001) vcan0 100##0BB T\n(1.700000001) vcan0 100#1122334455667788_C\n"
    frames = read(tmp_path, text)
    payloads = [(entry.frame.payload.hex(), entry.is_sent) for entry in frames]
    assert payloads == [("aa", False), ("bb", True), ("1122334455667788", False)]
    assert [entry.frame.stamp_ns for entry in frames] == [1_500_000_000, 1_600_001_000, 1_700_000_001]


def test_remote_and_error_frames_are_counted_not_yielded(tmp_path: Path) -> None:
    text = (
        "(1.1) vcan0 100#R\n(1.2) vcan0 100#R8\n(1.3) vcan0 20000004#0001000000000000\n"
        "(1.4) vcan0 100##1AA\n(1.5) vcan0 00000100#R\n"
    )
    frames = log(tmp_path, text)
    for _ in range(2):  # the counters belong to one reading
        assert [found.frame.payload for found in frames] == [b"\xaa"]
        assert (frames.remote_frames, frames.error_frames) == (3, 1)


@pytest.mark.parametrize(
    "line", ["vcan0  100   [2]  11 22", "vcan0  RX - -  100   [2]  11 22", "(000.000100)  can0  100   [1]  00"]
)
def test_screen_output_without_absolute_times_is_refused(tmp_path: Path, line: str) -> None:
    text = message(tmp_path, f"(1.5) vcan0 100#00\n{line}\n")
    assert "line 2: this is candump's screen output without seconds since 1970" in text
    assert "candump -l" in text


def test_screen_output_with_times(tmp_path: Path) -> None:
    result = log(
        tmp_path,
        " (1700000000.000123)  vcan0  100   [8]  11 22 33 44 55 66 77 88   '..3DUfw.'\n"
        " (1700000000.000124)  can1  TX B E  18DAF110  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n"
        " (1700000000.000125)  can1  RX - -  100   [0]  remote request\n"
        " (1700000000.000126)  can1  20000004   [8]  00 01 00 00 00 00 00 00   ERRORFRAME\n"
        " (1700000000.000127)  can1  7FF  [00]\n",
    )
    stamp = 1_700_000_000_000_123_000
    assert list(result) == [
        LogFrame(Frame(0x100, bytes.fromhex("1122334455667788"), stamp, False, False), "vcan0"),
        LogFrame(Frame(0x18DAF110, bytes(range(12)), stamp + 1000, True, True, True, True), "can1", True),
        LogFrame(Frame(0x7FF, b"", stamp + 4000, False, True), "can1"),
    ]
    assert (result.remote_frames, result.error_frames) == (1, 1)


@pytest.mark.parametrize(
    "line",
    [
        "hello",
        "(1.5) vcan0 100",
        "(1.5) vcan0 100#A",
        "(1.5) vcan0 100#AABBC",
        "(1.5) vcan0 100##",
        "(1.5) vcan0 1000#AA",
        "(1.5) vcan0 800#AA",
        "(1.5) vcan0 F0000000#AA",
        "(1.5 vcan0 100#AA",
        "(-1.5) vcan0 100#AA",
        "(1.5) vcan0 100#GG",
        "(1.5) vcan0 100#AA BB",
        "(1.5) vc\ufffdn0 100#AA",
        " (1700000000.000123)  can0  100   [1]  00 11",  # and cut screen output
        " (1700000000.000123)  can0  100   [8]  00 11",
        " (1700000000.000123)  can0  100   [12]  00 11",
    ],
)
def test_malformed_line_names_its_number(tmp_path: Path, line: str) -> None:
    text = message(tmp_path, f"(1.5) vcan0 100#00\n\n{line}\n")
    assert "line 3: not a line of a candump log" in text
    assert "remedy: delete it" in text


@pytest.mark.parametrize("line", ["100#" + "00" * 9, "100##1" + "00" * 9, "100##1" + "00" * 65])
def test_impossible_lengths(tmp_path: Path, line: str) -> None:
    assert "line 1: " in message(tmp_path, f"(1.5) vcan0 {line}\n")


def test_words_below_an_error_frame_belong_to_it(tmp_path: Path) -> None:
    result = log(
        tmp_path,
        " (1700000000.100000)  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n"
        "\tcontroller-problem{rx-error-warning}\n\tprotocol-violation{{}{acknowledge-slot}}\n\tbus-error\n"
        " (1700000000.300000)  can0  124   [2]  0A 0B\n",
    )
    assert [entry.frame.frame_id for entry in result] == [0x124]
    assert result.notes() == [f"{result.path}: left out: 1 error frames"]
    assert "line 2: not a line" in message(tmp_path, " (1700000001.500000)  can0  124   [2]  0A 0B\n\tbus-error\n")


def test_frames_of_can_xl_and_colours(tmp_path: Path) -> None:
    result = log(
        tmp_path,
        "(1.1) can0 45123#81:00:12345678#11223344.556677\n"
        " (1700000001.200000)  can0  45123  [0002] (81|00:12345678) 11 22\n"
        "\x1b[31m (1700000001.300000)  can0  124   [2]  0A 0B\x1b[0m\n",
    )
    assert ([entry.frame.payload for entry in result], result.other_entries) == ([b"\x0a\x0b"], 2)


def test_whole_second_stamps_are_refused_but_of_a_single_frame(tmp_path: Path) -> None:
    assert "whole seconds" in message(tmp_path, "(1700000000) vcan0 100#00\n" * 3)
    assert len(read(tmp_path, "(1700000000.000000) vcan0 100#00\n")) == 1


def test_reading_is_lazy_and_channels_may_overtake_each_other(tmp_path: Path) -> None:
    lines = [f"({1 + i * 1e-3 - 0.1 * (i % 2):.6f}) vcan{i % 2} 100#00\n" for i in range(1000)]
    frames = iter(log(tmp_path, "".join([*lines, "broken\n"])))
    assert [next(frames).frame.stamp_ns for _ in range(2)] == [1_000_000_000, 901_000_000]
