"""Logs as frames: as recorded, in parts, in loops."""

from pathlib import Path

import pytest

from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.log_frames import LogPart, Sent, log_frames
from observer_rt.foundation.errors import UserError

LOG = """(1700000000.000000) can0 100##1AA01
(1700000000.250000) can0 200#0102
(1700000000.500000) can0 1ABCDEF0##0
(1700000001.000000) can1 100##5AA02
"""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "bus.log"
    path.write_text(LOG)
    return path


def test_a_log_is_sent_as_recorded(log: Path) -> None:
    assert list(log_frames(LogPart(log))) == [
        TimedFrame(0.0, 0x100, False, True, b"\xaa\x01", "can0"),
        TimedFrame(0.25, 0x200, False, False, b"\x01\x02", "can0", False),
        TimedFrame(0.5, 0x1ABCDEF0, True, True, b"", "can0", False),
        TimedFrame(1.0, 0x100, False, True, b"\xaa\x02", "can1"),
    ]
    extent = LogPart(log).extent()
    assert (extent.duration, extent.frames) == (1.0, 4)


def test_a_part_of_a_log_begins_at_its_start(log: Path) -> None:
    frames = list(LogPart(log, start=0.2, stop=1.0))
    assert [frame.frame_id for frame in frames] == [0x200, 0x1ABCDEF0]
    assert [frame.time for frame in frames] == pytest.approx([0.05, 0.3])
    left = LogPart(log, start=0.2, stop=1.0, leave_out=[Sent(0, 0x200, False)])
    assert [frame.frame_id for frame in left] == [0x1ABCDEF0]


def test_the_time_of_a_looped_log_goes_on(log: Path) -> None:
    frames = list(log_frames(LogPart(log), loop=2))
    assert [frame.payload for frame in frames] == [frame.payload for frame in log_frames(LogPart(log))] * 2
    assert [frame.time for frame in frames[4:]] == pytest.approx([4 / 3 + t for t in (0.0, 0.25, 0.5, 1.0)])
    endless = log_frames(LogPart(log), loop=0)
    times = [next(endless).time for _ in range(100)]
    assert times == sorted(times)


def test_a_log_of_one_instant_cannot_be_looped(tmp_path: Path) -> None:
    path = tmp_path / "short.log"
    path.write_text("(1.5) can0 100#\n")
    assert len(list(LogPart(path))) == 1
    with pytest.raises(UserError, match="no duration"):
        list(log_frames(LogPart(path), loop=2))


@pytest.mark.parametrize(("start", "stop"), [(1.5, None), (None, 0.0), (0.6, 0.9), (1.0, 0.5)])
def test_an_empty_part_of_a_log(log: Path, start: float | None, stop: float | None) -> None:
    with pytest.raises(UserError, match="--start, --stop"):
        LogPart(log, start=start, stop=stop).extent()


def test_frames_of_some_channels_only(log: Path) -> None:
    assert [frame.payload for frame in LogPart(log, buses={"can1": 0})] == [b"\xaa\x02"]
    with pytest.raises(UserError, match=r"channel can7: is not in .* which has can0, can1"):
        LogPart(log, buses={"can7": 0}).extent()


def test_what_a_log_holds(log: Path) -> None:
    with log.open("a") as file:
        file.write("(1700000001.000000) can1 100#R\n(1700000001.000000) can1 20000004#0001000000000000\n")
    extent = LogPart(log, buses={"can1": 2}).extent()
    assert extent.identifiers == {Sent(2, 0x100, False)}
    assert extent.channels == ("can1",)
    assert extent.notes == (f"{log}: left out: 1 error frame, 1 remote frame",)


@pytest.mark.parametrize(
    ("text", "said"), [("", "holds no data frame"), ("(1.5) can0 100#R\n", "1 remote frame")]
)
def test_a_log_without_frames(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "empty.log"
    path.write_text(text)
    with pytest.raises(UserError, match=said) as raised:
        LogPart(path).extent()
    assert "--start" not in str(raised.value)


def test_a_malformed_log_is_refused_before_anything_is_sent(log: Path) -> None:
    with log.open("a") as file:
        file.write("(1700000001.500000) can0 100##1A\n")
    with pytest.raises(UserError, match="line 5"):
        LogPart(log).extent()
