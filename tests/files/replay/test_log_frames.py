"""Logs as frames: as recorded, of chosen channels, and without results."""

from pathlib import Path

import pytest

from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.player import LogFrames, Sent
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
    frames = LogFrames(log, {0: None})
    for _ in range(2):
        assert list(frames) == [
            TimedFrame(0.0, 0x100, False, True, b"\xaa\x01"),
            TimedFrame(0.25, 0x200, False, False, b"\x01\x02", False),
            TimedFrame(0.5, 0x1ABCDEF0, True, True, b"", False),
            TimedFrame(1.0, 0x100, False, True, b"\xaa\x02"),
        ]
    assert (frames.duration, frames.channels) == (1.0, ("can0", "can1"))
    assert frames.sent == {Sent(0, 0x100, False), Sent(0, 0x200, False), Sent(0, 0x1ABCDEF0, True)}


def test_channels_go_onto_their_buses_and_results_nowhere(log: Path) -> None:
    frames = LogFrames(log, {0: "can0", 2: "can1"}, [Sent(0, 0x100, False)])
    assert [(frame.bus, frame.frame_id) for frame in frames] == [(0, 0x200), (0, 0x1ABCDEF0), (2, 0x100)]
    assert Sent(2, 0x100, False) in frames.sent


def test_a_log_without_a_frame_to_send_is_refused(log: Path) -> None:
    with pytest.raises(UserError, match="holds no data frame of channel can7"):
        LogFrames(log, {0: "can7"})
    log.write_text("(1.5) can0 100#R\n(1.6) can0 200#00\n")
    with pytest.raises(UserError, match=r"but results of the observer; .*1 remote frames"):
        LogFrames(log, {0: None}, [Sent(0, 0x200, False)])


def test_a_malformed_log_is_refused_before_anything_is_sent(log: Path) -> None:
    log.write_text(LOG + "broken\n")
    with pytest.raises(UserError, match="line 5"):
        LogFrames(log, {0: None})
