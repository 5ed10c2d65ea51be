"""Frames for tests of log formats: as strategies, and as a fixed mixture."""

import random
from collections.abc import Iterable
from pathlib import Path

import can
from hypothesis import strategies as st

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.formats import LOGS_WRITTEN, open_writer
from observer_rt.files.replay.framing import TimedFrame

START = 1_700_000_000_123_456_789  # ns since 1970
FORMATS = {".log": True, ".blf": True, ".asc": True, ".trc": False, ".mf4": True}  # whether they hold CAN FD


@st.composite
def log_frames(draw: st.DrawFn, suffix: str, start: int = START) -> list[LogFrame]:
    """Frames in order of time that a format can hold, on the channels 1 and 2."""
    frames = []
    stamp = start
    for step in draw(st.lists(st.integers(0, 10**10), max_size=30)):
        stamp += step
        is_fd = FORMATS[suffix] and draw(st.booleans())
        is_extended = draw(st.booleans())
        length = draw(st.sampled_from(FD_LENGTHS) if is_fd else st.integers(0, 8))
        frame = Frame(
            draw(st.integers(0, 0x1FFFFFFF if is_extended else 0x7FF)),
            draw(st.binary(min_size=length, max_size=length)),
            stamp if suffix == ".log" else stamp // 1000 * 1000,
            is_extended,
            is_fd,
            is_fd and draw(st.booleans()),
            is_fd and draw(st.booleans()),
        )
        frames.append(LogFrame(frame, draw(st.sampled_from(("1", "2"))), draw(st.booleans())))
    return frames


def mixture(suffix: str, count: int) -> list[LogFrame]:
    """The same frames at every call, of all kinds the format can hold, none of them empty."""
    chance = random.Random(5)
    frames = []
    stamp = START // 1000 * 1000
    for _ in range(count):
        stamp += 1000 * chance.randrange(1000)
        is_fd = FORMATS[suffix] and chance.random() < 0.5
        is_extended = chance.random() < 0.5
        length = chance.choice([12, 24, 64] if is_fd else [1, 7, 8])
        frame = Frame(
            chance.randrange(0x20000000 if is_extended else 0x800),
            chance.randbytes(length),
            stamp,
            is_extended,
            is_fd,
            is_fd and chance.random() < 0.5,
            is_fd and chance.random() < 0.5,
        )
        frames.append(LogFrame(frame, chance.choice("12"), chance.random() < 0.5))
    return frames


def write_log(path: Path, frames: list[LogFrame]) -> Path:
    if path.suffix not in LOGS_WRITTEN:
        with can.Logger(path) as logger:
            for frame in frames:
                logger(message_of(frame))
        return path
    with open_writer(path, frames[0].frame.stamp_ns if frames else START) as writer:
        for frame in frames:
            writer.write(frame)
    return path


def message_of(entry: LogFrame) -> can.Message:
    identifier, payload, stamp, is_extended, is_fd, switch, state = entry.frame
    return can.Message(
        timestamp=stamp / 1e9,
        arbitration_id=identifier,
        is_extended_id=is_extended,
        data=payload,
        is_fd=is_fd,
        bitrate_switch=switch,
        error_state_indicator=state,
        is_rx=not entry.is_sent,
        channel=int(entry.channel) - 1,
    )


def sent_log(frames: Iterable[TimedFrame], start: int = START, channel: str = "1") -> list[LogFrame]:
    """What a recorder beside the sender of some frames writes, the first at a time [ns]."""
    return [
        LogFrame(Frame(f.frame_id, f.payload, start + f.stamp_ns, f.is_extended, f.is_fd, f.is_fd), channel)
        for f in frames
    ]


def as_read(frames: list[LogFrame], suffix: str) -> list[LogFrame]:
    if suffix != ".log":
        return frames
    return [frame._replace(channel=f"can{int(frame.channel) - 1}") for frame in frames]


def moved(entries: Iterable[LogFrame], other: Iterable[LogFrame]) -> int:
    """Largest distance [ns] of the stamps of two logs that are the same but for these."""
    entries, other = list(entries), list(other)
    first, second = ([(e.frame._replace(stamp_ns=0), *e[1:]) for e in log] for log in (entries, other))
    assert first == second
    return max((abs(a.frame.stamp_ns - b.frame.stamp_ns) for a, b in zip(entries, other, strict=True)), default=0)
