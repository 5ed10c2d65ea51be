"""Logs as `candump -l` and `candump -L` write them, and what `candump` prints on the screen.

`(1700000000.000123) vcan0 100##1AABB`, and `(1700000000.000123)  can0  123   [2]  AA BB`.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path

from observer_rt.bus.can_frame import BIT_RATE_SWITCH, ERROR_FLAG, ERROR_STATE
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFormat, LogFrame, LogWriter, lost_note, text_nanoseconds
from observer_rt.files.canlog.text_log import EARLIEST_DATE, TextLogReader
from observer_rt.foundation.units import NANOSECONDS

EXTENDED_DIGITS = 8  # of an identifier
_LINE = re.compile(
    r"\((?P<stamp>\d+(?:\.\d{1,9})?)\)\s+(?P<channel>[^\s\ufffd]+)\s+(?P<id>[0-7][0-9A-F]{2}|[0-3][0-9A-F]{7})"
    r"#(?:#(?P<flags>[0-9A-F])|(?P<remote>R)?)(?P<data>[0-9A-F]*)(?:_[0-9A-F])?(?:\s+(?P<direction>[RT]))?",
    re.IGNORECASE,
)
_SCREEN_LINE = re.compile(
    r"(?:\((?P<stamp>\d+\.\d{6,9})\)\s+)?(?P<channel>[^\s\ufffd]+)\s+"
    r"(?:(?P<direction>TX|RX) (?P<switch>[B-]) (?P<state>[E-])\s+)?"
    r"(?P<id>[0-9A-F]{3}|[0-9A-F]{8})\s+\[(?P<length>\d{1,2})\]"
    r"(?:\s+(?P<remote>remote request)|(?P<data>(?:\s+[0-9A-F]{2})*)(?:\s+(?:'.*'|ERRORFRAME))?)"
)
_XL_FRAME = re.compile(r"[0-9A-F]#[0-9A-F]{2}:[0-9A-F]{2}:[0-9A-F]{8}#|\[\d{4}\] \(")
_ERROR_TEXT = re.compile(r"[a-z][a-z-]*(\{.*\})?,?")  # below an error frame
_COLOUR = re.compile(r"\x1b\[[\d;]*m")


class CandumpLog(TextLogReader):
    """Reader: python-can reads no comments (`#`), screen output and ns, and takes error frames for data frames."""

    kind = "a candump log"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        explains_error = False
        for number, text in self._lines():
            if explains_error and _ERROR_TEXT.fullmatch(text):
                continue
            errors = self.error_frames
            try:
                entry = self._entry(text, number)
            except ValueError:
                self.refuse_line(number, text)
            explains_error = self.error_frames > errors
            if entry is not None:
                yield number, entry

    def _entry(self, text: str, number: int) -> LogFrame | None:
        if text.startswith("#"):
            self.note_text(text)
            return None
        match = _LINE.fullmatch(text)
        if match is None:
            return self._screen(_COLOUR.sub("", text).strip(), number)
        flags = int(match["flags"] or "0", 16)
        is_fd, switch, state = match["flags"] is not None, flags & BIT_RATE_SWITCH, flags & ERROR_STATE
        return self._frame(match, text_nanoseconds(match["stamp"]), is_fd, bool(switch), bool(state))

    def _screen(self, text: str, number: int) -> LogFrame | None:
        if _XL_FRAME.search(text):
            self.other_entries += 1
            return None
        match = _SCREEN_LINE.fullmatch(text)
        if match is None:
            raise ValueError
        stamp = text_nanoseconds(match["stamp"] or "0.0")
        if stamp < EARLIEST_DATE:
            problem = "this is candump's screen output without seconds since 1970, not a log"
            self.refuse(number, problem, "record with candump -l, or print with candump -ta")
        if not match["remote"] and len(match["data"].split()) != int(match["length"]):
            raise ValueError
        is_fd = len(match["length"]) > 1
        return self._frame(match, stamp, is_fd, match["switch"] == "B", match["state"] == "E")

    def _frame(self, match: re.Match[str], stamp: int, is_fd: bool, switch: bool, state: bool) -> LogFrame | None:
        """Frame of a line of either kind, None of an error or remote frame, which is counted."""
        identifier, is_extended = int(match["id"], 16), len(match["id"]) == EXTENDED_DIGITS
        if is_extended and identifier & ERROR_FLAG:
            self.error_frames += 1
            return None
        if match["remote"]:
            self.remote_frames += 1
            return None
        frame = Frame(identifier, bytes.fromhex(match["data"]), stamp, is_extended, is_fd, switch, state)
        return LogFrame(frame, match["channel"], (match["direction"] or "").startswith("T"))


class CandumpWriter(LogWriter):
    """Writer; stamps have six digits where those are enough, else nine."""

    def __init__(self, path: Path, start_ns: int) -> None:
        super().__init__(path, start_ns)
        self._file = path.open("w", encoding="utf-8", newline="\n")

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        seconds, fraction = divmod(frame.stamp_ns, NANOSECONDS)
        stamp = f"{seconds:010d}." + (f"{fraction:09d}" if fraction % 1000 else f"{fraction // 1000:06d}")
        channel = entry.channel
        if channel.isdigit():
            channel = f"can{self._numbers.of(channel) - 1}"
        mark = "#"
        if frame.is_fd:
            flags = BIT_RATE_SWITCH * frame.bit_rate_switch | ERROR_STATE * frame.error_state_indicator
            mark = f"##{flags:X}"
        identifier = f"{frame.frame_id:08X}" if frame.is_extended else f"{frame.frame_id:03X}"
        direction = " T" if entry.is_sent else ""
        self._file.write(f"({stamp}) {channel} {identifier}{mark}{frame.payload.hex().upper()}{direction}\n")

    def write_lost(self, frames: int) -> None:
        self._file.write(f"# {lost_note(frames)}\n")

    def flush(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()


CANDUMP = LogFormat(".log", CandumpLog, CandumpWriter)
