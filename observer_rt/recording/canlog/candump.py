"""Logs as `candump -l` and `candump -L` write them, and what `candump` prints on the screen.

`(1700000000.000123) vcan0 100##1AABB`, and `(1700000000.000123)  can0  123   [2]  AA BB`.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import NoReturn

from observer_rt.recording.canlog.can_log import (
    NANOSECONDS,
    ChannelNumbers,
    LogFormat,
    LogFrame,
    LogRecorder,
    lost_note,
    text_nanoseconds,
)
from observer_rt.recording.canlog.text_log import Rising, TextLogReader

EARLIEST_DATE = (
    100_000_000  # s since 1970: what is less counts from the start of the log, or from line to line
)
TWO_DIGITS = 2  # of a length, which only CAN FD frames have
ERROR_FRAME = 0x2000_0000  # CAN_ERR_FLAG in the identifier of an error frame

_SCREEN_LINE = re.compile(
    r"(?:\((?P<stamp>\d+\.\d{6,9}|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{6,9})\)\s+)?(?P<channel>[^\s\ufffd]+)\s+"
    r"(?:(?P<direction>TX|RX) (?P<switch>[B-]) (?P<state>[E-])\s+)?"
    r"(?P<id>[0-9A-F]{3}|[0-9A-F]{8})\s+\[(?P<length>\d{1,2})\]"
    r"(?:\s+(?P<remote>remote request)|(?P<data>(?:\s+[0-9A-F]{2})*)(?:\s+(?:'.*'|ERRORFRAME))?)"
)


@dataclass(frozen=True)
class ScreenLine:
    """One line; `stamp_ns` is None where it has no time, and counts from 1970 only if `is_dated`."""

    stamp_ns: int | None
    is_dated: bool
    channel: str
    identifier: int
    is_extended: bool
    payload: bytes
    is_fd: bool
    bit_rate_switch: bool
    error_state: bool
    is_sent: bool
    is_remote: bool
    is_error: bool


def screen_line(text: str) -> ScreenLine | None:
    """What a line of the screen says, None for another text. Raises `ValueError` for data that are not its length."""
    match = _SCREEN_LINE.fullmatch(text)
    if match is None:
        return None
    stamp = None if match["stamp"] is None else _stamp(match["stamp"])
    payload = bytes.fromhex(match["data"] or "")
    identifier = int(match["id"], 16)
    is_extended = len(match["id"]) == len("12345678")
    is_remote = match["remote"] is not None
    if len(payload) != int(match["length"]) and not is_remote:
        raise ValueError(f"{len(payload)} bytes follow the length {match['length']}")
    return ScreenLine(
        stamp_ns=stamp,
        is_dated=stamp is not None and stamp >= EARLIEST_DATE * NANOSECONDS,
        channel=match["channel"],
        identifier=identifier,
        is_extended=is_extended,
        payload=payload,
        is_fd=len(match["length"]) == TWO_DIGITS,
        bit_rate_switch=match["switch"] == "B",
        error_state=match["state"] == "E",
        is_sent=match["direction"] == "TX",
        is_remote=is_remote,
        is_error=is_extended and bool(identifier & ERROR_FRAME),
    )


def _stamp(text: str) -> int:
    if "-" not in text:
        return text_nanoseconds(text)
    date, _, fraction = text.partition(".")
    moment = datetime.strptime(date, "%Y-%m-%d %H:%M:%S")  # local time, as it is printed
    return int(moment.timestamp()) * NANOSECONDS + text_nanoseconds(f"0.{fraction}")


STAMP_DIGITS = 9
BIT_RATE_SWITCH = 0x1
ERROR_STATE_INDICATOR = 0x2

_LINE = re.compile(
    r"\((?P<seconds>\d+)(?:\.(?P<fraction>\d{1,9}))?\)"
    r"\s+(?P<channel>[^\s\ufffd]+)"
    r"\s+(?P<id>[0-7][0-9A-Fa-f]{2}|[0-3][0-9A-Fa-f]{7})"
    r"(?:##(?P<flags>[0-9A-Fa-f])(?P<fd_data>[0-9A-Fa-f]*)"
    r"|#(?:(?P<remote>[Rr])[0-9A-Fa-f]?|(?P<data>[0-9A-Fa-f]*))(?:_[0-9A-Fa-f])?)"
    r"(?:\s+(?P<direction>[RT]))?"
)


class CandumpLog(TextLogReader):
    """Reader; a line that begins with `#` is a comment."""

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._rising = Rising()
        self._undated = False
        for number, line in self._lines():
            text = line.strip()
            if text.startswith("#"):
                self.note_text(text)
            elif text:
                entry = self._parse(text, number)
                if entry is not None:
                    yield number, entry

    def _parse(self, text: str, number: int) -> LogFrame | None:
        match = _LINE.fullmatch(text)
        if match is None:
            return self._screen(text, number)
        identifier = int(match["id"], 16)
        if identifier & ERROR_FRAME and len(match["id"]) > 3:
            self.error_frames += 1
            return None
        if match["remote"]:
            self.remote_frames += 1
            return None
        is_fd = match["flags"] is not None
        flags = int(match["flags"], 16) if is_fd else 0
        data = match["fd_data"] if is_fd else match["data"]
        if len(data) % 2:
            self._refuse_line(number, text)
        return self.frame(
            number,
            int(match["seconds"]) * NANOSECONDS + int((match["fraction"] or "").ljust(STAMP_DIGITS, "0")),
            identifier,
            len(match["id"]) == 8,
            bytes.fromhex(data),
            is_fd,
            match["channel"],
            bool(flags & BIT_RATE_SWITCH),
            bool(flags & ERROR_STATE_INDICATOR),
            match["direction"] == "T",
        )

    def _screen(self, text: str, number: int) -> LogFrame | None:
        """A frame as it is printed on the screen."""
        try:
            line = screen_line(text)
        except ValueError as error:
            self.refuse(number, str(error))
        if line is None:
            self._refuse_line(number, text)
        if line.stamp_ns is None:
            problem = "this is candump's screen output without times, not a log"
            self.refuse(number, problem, "record with candump -l, or print with candump -ta")
        if not line.is_dated:
            self._judge_times(line.stamp_ns, number)
        if line.is_error or line.is_remote:
            self.error_frames += line.is_error
            self.remote_frames += not line.is_error
            return None
        return self.frame(
            number,
            line.stamp_ns,
            line.identifier,
            line.is_extended,
            line.payload,
            line.is_fd,
            line.channel,
            line.bit_rate_switch,
            line.error_state,
            line.is_sent,
        )

    def _judge_times(self, time: int, number: int) -> None:
        self._rising.add(time)
        if self._rising.is_from_line_to_line:
            self.refuse(
                number,
                "its times are from line to line (candump -td), of all interfaces together",
                "record with candump -l, or print with candump -ta",
            )
        if not self._undated:
            self.remarks.append("its times are taken to count from its start (candump -tz)")
            self._undated = True

    def _refuse_line(self, number: int, text: str) -> NoReturn:
        self.refuse_content(
            number,
            f"not a candump log line: '{text[:60]}'",
            "a line reads (seconds.microseconds) channel id#data or id##flags data in one word",
        )


class CandumpWriter(LogRecorder):
    """Writer; stamps have six digits where those are enough, else nine."""

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._file = path.open("w", encoding="utf-8", newline="\n")
        self._numbers = ChannelNumbers()
        self._size = 0

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        seconds, rest = divmod(frame.stamp_ns, NANOSECONDS)
        stamp = f"{seconds:010d}.{rest:09d}" if rest % 1000 else f"{seconds:010d}.{rest // 1000:06d}"
        channel = entry.channel
        if channel.isdigit():
            channel = f"can{self._numbers.of(channel) - 1}"
        mark = "#"
        if frame.is_fd:
            flags = (
                BIT_RATE_SWITCH * frame.bit_rate_switch | ERROR_STATE_INDICATOR * frame.error_state_indicator
            )
            mark = f"##{flags:X}"
        identifier = f"{frame.frame_id:08X}" if frame.is_extended else f"{frame.frame_id:03X}"
        direction = " T" if entry.is_sent else ""
        self._write(f"({stamp}) {channel} {identifier}{mark}{frame.payload.hex().upper()}{direction}\n")

    def write_lost(self, frames: int) -> None:
        self._write(f"# {lost_note(frames)}\n")

    def _write(self, line: str) -> None:
        self._size += self._file.write(line)

    @property
    def size(self) -> int:
        return self._size

    def flush(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()


CANDUMP = LogFormat((".log",), "text of `candump -l`", CandumpLog, CandumpWriter, CandumpWriter, is_text=True)
