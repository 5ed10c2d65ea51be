"""Recording and replaying on a real vcan0: what was sent is in the file, and goes out again as it is there."""

import math
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from observer_rt.bus.links.link import Link
from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench_file import LinkConfig
from observer_rt.files.formats import open_log
from observer_rt.files.recorder import RecordLimits, RecordStatistics, record
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.log_frames import LogPart, Sent, log_frames
from observer_rt.files.replay.player import play, refuse_traffic
from observer_rt.foundation.errors import UserError

pytestmark = pytest.mark.vcan

SENT = [
    TimedFrame(
        n * 1e-3,
        0x100 + n % 3,
        n % 2 == 0,
        n % 3 == 0,
        bytes([n % 256] * (64 if n % 3 == 0 else 8)),
        "",
        n % 9 == 0,
        n % 6 == 0,
    )
    for n in range(300)
]


def recorded(vcan: str, path: Path, count: int, send: Callable[[Link], object]) -> RecordStatistics:
    """What `record` finds of frames that `send` sends."""
    stop = threading.Event()
    found: list[RecordStatistics] = []
    with open_link("socketcan", vcan, True) as link, open_link("socketcan", vcan, True, []) as sender:

        def run() -> None:
            found.append(record({vcan: link}, path, RecordLimits(frames=count, duration=30.0), stop))

        recorder = threading.Thread(target=run)
        recorder.start()
        send(sender)
        recorder.join()
    return found[0]


@pytest.mark.parametrize("suffix", [".blf", ".log"])
def test_what_is_sent_is_recorded_and_replayed(vcan: str, tmp_path: Path, suffix: str) -> None:
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    statistics = recorded(vcan, first, len(SENT), lambda link: play(SENT, link, 2.0))
    assert (statistics.frames, statistics.lost) == (len(SENT), 0)
    recorded(vcan, second, len(SENT), lambda link: play(log_frames(LogPart(first)), link, 1.0))
    for path in (first, second):
        found = [entry.frame for entry in open_log(path)]
        assert [(f.frame_id, f.payload, *f[3:]) for f in found] == [
            (
                f.frame_id,
                f.payload,
                f.is_extended,
                f.is_fd,
                f.is_fd and f.bit_rate_switch,
                f.is_fd and f.error_state_indicator,
            )
            for f in SENT
        ]
        taken = (found[-1].stamp_ns - found[0].stamp_ns) / 1e9
        assert 0.07 < taken < 2.0  # as sent, .1495 s, but for what else the machine does


def test_a_full_queue_is_waited_for(vcan: str, tmp_path: Path) -> None:
    many = [TimedFrame(0.0, 0x123, False, True, n.to_bytes(8, "big")) for n in range(5000)]
    path = tmp_path / "bus.blf"
    recorded(vcan, path, len(many), lambda link: play(many, link, math.inf))
    numbers = [int.from_bytes(entry.frame.payload, "big") for entry in open_log(path)]
    assert numbers == list(range(len(many)))


def test_other_senders_are_noticed(vcan: str) -> None:
    over = threading.Event()

    def send() -> None:
        with open_link("socketcan", vcan, True, []) as link:
            while not over.wait(0.02):
                link.send(0x123, b"\1", False, False)

    sender = threading.Thread(target=send)
    sender.start()
    try:
        config = LinkConfig(channel=vcan)
        refuse_traffic({0: config}, [Sent(0, 0x123, True), Sent(0, 0x124, False)], threading.Event())
        with pytest.raises(UserError, match="identifier 0x123 come in already"):
            refuse_traffic({0: config}, [Sent(0, 0x123, False)], threading.Event())
    finally:
        over.set()
        sender.join()
