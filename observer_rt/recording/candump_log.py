"""Reader for the logs that `candump -l` and `candump -L` write: `(1700000000.000123) vcan0 100##1AABB`."""

import re
from collections import deque
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple, NoReturn

from observer_rt.bus.link import Frame
from observer_rt.errors import UserError
from observer_rt.recording.files import file_errors

NANOSECONDS = 1_000_000_000
STAMP_DIGITS = 9
ERROR_FRAME = 0x2000_0000  # CAN_ERR_FLAG in the identifier of an error frame
BIT_RATE_SWITCH = 0x1
ERROR_STATE_INDICATOR = 0x2
CLASSIC_LENGTH = 8
FD_LENGTHS = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))
FRAMES_TO_JUDGE_STAMPS = 100

_LINE = re.compile(
    r"\((?P<seconds>\d+)(?:\.(?P<fraction>\d{1,9}))?\)"
    r"\s+(?P<channel>\S+)"
    r"\s+(?P<id>[0-7][0-9A-Fa-f]{2}|[0-3][0-9A-Fa-f]{7})"
    r"(?:##(?P<flags>[0-9A-Fa-f])(?P<fd_data>(?:[0-9A-Fa-f]{2})*)"
    r"|#(?:(?P<remote>[Rr])[0-9A-Fa-f]?|(?P<data>(?:[0-9A-Fa-f]{2})*))(?:_[0-9A-Fa-f])?)"
    r"(?:\s+[RT])?"
)
_SCREEN_TEXT = re.compile(r"\s*(?:\([^)]*\)\s+)?\S+\s+(?:(?:TX|RX)[\sBE-]*\s+)?[0-9A-Fa-f]+\s+\[\d+\]")


class LogFrame(NamedTuple):
    """A frame of a log, with what a `Frame` does not carry."""

    frame: Frame
    channel: str
    bit_rate_switch: bool
    error_state_indicator: bool


class CandumpLog:
    """Frames of one log, read line by line while iterating; remote and error frames are counted, not yielded.

    Iterating raises `UserError` with the line number for a malformed line, for text printed without `-L`, for
    time that steps backwards on a channel and for stamps in whole seconds only.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.remote_frames = 0
        """Remote frames skipped by the last iteration so far."""
        self.error_frames = 0
        """Error frames skipped by the last iteration so far."""

    def __iter__(self) -> Iterator[LogFrame]:
        self.remote_frames = 0
        self.error_frames = 0
        with file_errors(self.path), self.path.open(encoding="ascii", errors="replace") as file:
            frames = self._in_order(self._parse(file))
            first = deque(islice(frames, FRAMES_TO_JUDGE_STAMPS))
            self._refuse_whole_seconds([frame.frame.stamp_ns for frame in first])
            while first:
                yield first.popleft()
            yield from frames

    def _parse(self, lines: Iterable[str]) -> Iterator[tuple[int, LogFrame]]:
        for number, line in enumerate(lines, start=1):
            text = line.strip()
            if not text:
                continue
            match = _LINE.fullmatch(text)
            if match is None:
                self._refuse_line(number, text)
            identifier = int(match["id"], 16)
            if identifier & ERROR_FRAME and len(match["id"]) > 3:
                self.error_frames += 1
            elif match["remote"]:
                self.remote_frames += 1
            else:
                yield number, self._frame(match, number)

    def _frame(self, match: re.Match[str], number: int) -> LogFrame:
        is_fd = match["flags"] is not None
        payload = bytes.fromhex(match["fd_data"] if is_fd else match["data"])
        allowed = FD_LENGTHS if is_fd else range(CLASSIC_LENGTH + 1)
        if len(payload) not in allowed:
            kind = "CAN FD" if is_fd else "classic CAN"
            raise UserError(
                f"{self.path}, line {number}",
                f"{len(payload)} bytes are no length of a {kind} frame",
                "the line was cut or edited: delete it, or record the log again",
            )
        fraction = (match["fraction"] or "").ljust(STAMP_DIGITS, "0")
        flags = int(match["flags"], 16) if is_fd else 0
        frame = Frame(
            frame_id=int(match["id"], 16),
            payload=payload,
            stamp_ns=int(match["seconds"]) * NANOSECONDS + int(fraction),
            is_extended=len(match["id"]) == 8,
            is_fd=is_fd,
        )
        return LogFrame(
            frame, match["channel"], bool(flags & BIT_RATE_SWITCH), bool(flags & ERROR_STATE_INDICATOR)
        )

    def _in_order(self, frames: Iterable[tuple[int, LogFrame]]) -> Iterator[LogFrame]:
        latest: dict[str, int] = {}
        for number, frame in frames:
            stamp = frame.frame.stamp_ns
            back = latest.get(frame.channel, stamp) - stamp
            if back > 0:
                raise UserError(
                    f"{self.path}, line {number}",
                    f"time on {frame.channel} steps back by {back / NANOSECONDS:.9g} s",
                    "split the log there (the clock was set, or two logs were joined)",
                )
            latest[frame.channel] = stamp
            yield frame

    def _refuse_whole_seconds(self, stamps: list[int]) -> None:
        if len(set(stamps)) < len(stamps) and all(stamp % NANOSECONDS == 0 for stamp in stamps):
            raise UserError(
                f"{self.path}",
                "all stamps are whole seconds, several frames share one: the times of the frames are lost",
                "record the log again with candump -l, which writes microseconds",
            )

    def _refuse_line(self, number: int, text: str) -> NoReturn:
        place = f"{self.path}, line {number}"
        if _SCREEN_TEXT.match(text):
            raise UserError(
                place, "this is candump's screen output, not a log", "record with candump -l (or -L)"
            )
        raise UserError(
            place,
            f"not a candump log line: '{text[:60]}'",
            "a line reads (seconds.microseconds) channel id#data or id##flags data in one word",
        )
