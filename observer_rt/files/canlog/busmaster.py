"""Logs of BUSMASTER, text: `11:49:12:9420 Rx 1 0x023 s 2 40 FF`, stamps in tenths of a millisecond.

Other programs write it, too: with milliseconds, or without a word on what times mean.
"""

import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from observer_rt.bus.can_frame import CLASSIC_LENGTH
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import NANOSECONDS, LogFormat, LogFrame
from observer_rt.files.canlog.text_log import TextLogReader, head_of

MARK = b"***"
DAY = 24 * 3600 * NANOSECONDS
TENTHS_DIGITS = 4  # of a millisecond, as BUSMASTER itself writes
_MODES = ("***SYSTEM MODE***", "***ABSOLUTE MODE***", "***RELATIVE MODE***")
_START = re.compile(r"\*\*\*START DATE AND TIME (\d+):(\d+):(\d+) (\d+):(\d+):(\d+):(\d{1,3})\*\*\*")
_TIME = r"(?P<hour>\d+):(?P<minute>\d\d?):(?P<second>\d\d?):(?P<fraction>\d{1,4}) "
_ID = r"(?P<id>(?:0x)?[0-9A-Fa-f]+) "
_DATA = r"(?P<length>\d+)(?P<data>(?: [0-9A-Fa-f]{1,3})*)"
_CAN, _J1939 = "CAN", "J1939"
_LINES = {
    _CAN: re.compile(rf"{_TIME}(?P<direction>Rx|Tx) (?P<channel>\d+) {_ID}(?P<kind>s|x|sr|xr) {_DATA}"),
    # with group, type, addresses and priority, which the identifier holds
    _J1939: re.compile(
        rf"{_TIME}(?P<channel>\d+) {_ID}0x\w+ \w+ +\w+ +\w+ +\d+ (?P<direction>Rx|Tx) {_DATA}"
    ),
}


class BusmasterLog(TextLogReader):
    """Reader; channels are named by their number. Dates are taken as local time."""

    kind = "a BUSMASTER log"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._protocol = _CAN
        self._mode = ""
        self._radix = 16
        self._start: int | None = None
        self._is_tenths: bool | None = None
        self._time = 0
        return super()._entries()

    def _header(self, text: str, number: int) -> None:
        if start := _START.fullmatch(text):
            day, month, year, hour, minute, second, millisecond = map(int, start.groups())
            try:
                moment = datetime(year, month, day, hour, minute, second)
            except ValueError:
                self.refuse(
                    number, f"'{text}' has no date", "correct it: day:month:year hour:minute:second:ms"
                )
            self._start = int(moment.timestamp()) * NANOSECONDS + millisecond * 1_000_000
            self._time = 0
        elif text in ("***HEX***", "***DEC***"):
            self._radix = 16 if text == "***HEX***" else 10
        elif text in _MODES:
            self._mode = text.strip("*").removesuffix(" MODE")
        elif text.startswith("***PROTOCOL "):
            self._protocol = text.strip("*").removeprefix("PROTOCOL ")
            if self._protocol not in _LINES:
                self.refuse(number, f"it is a log of {self._protocol}", "give a log of CAN or J1939")

    def _entry(self, text: str, number: int) -> LogFrame | None:
        if text.startswith("***"):
            self._header(text, number)
            return None
        match = _LINES[self._protocol].fullmatch(text)
        if match is None:
            raise ValueError
        kind = match["kind"] if self._protocol == _CAN else "x"
        stamp = self._stamp(match)
        if kind.endswith("r"):
            self.remote_frames += 1
            return None
        identifier = int(match["id"], self._radix)
        payload = bytes(int(byte, self._radix) for byte in match["data"].split())
        if len(payload) != int(match["length"]):
            self.refuse(number, f"{len(payload)} bytes follow the length {match['length']}")
        if self._protocol == _J1939 and len(payload) > CLASSIC_LENGTH:  # put together by a transport protocol
            self.other_entries += 1
            return None
        frame = Frame(identifier, payload, stamp, kind == "x", is_fd=False)
        return LogFrame(frame, match["channel"], match["direction"] == "Tx")

    def _stamp(self, match: re.Match[str]) -> int:
        if self._start is None:
            self._start = 0
            self.remarks.append("its heading has no date: times count from 1970")
        if not self._mode:
            self._mode = "SYSTEM"
            self.remarks.append(
                "its heading does not say what times mean: they are taken as times of the day"
            )
        is_tenths = len(match["fraction"]) == TENTHS_DIGITS  # else milliseconds without leading zeros
        if self._is_tenths is None:
            self._is_tenths = is_tenths
            self.remarks.append(f"its stamps are {'tenths of ' * is_tenths}milliseconds")
        if is_tenths != self._is_tenths:
            raise ValueError
        minutes = int(match["hour"]) * 60 + int(match["minute"])
        seconds = minutes * 60 + int(match["second"])
        time = seconds * NANOSECONDS + int(match["fraction"]) * (100_000 if is_tenths else 1_000_000)
        if self._mode == "SYSTEM":  # of the day
            midnight = datetime.fromtimestamp(self._start // NANOSECONDS).replace(hour=0, minute=0, second=0)
            time += int(midnight.timestamp()) * NANOSECONDS - self._start
            while self._time - time > DAY // 2:  # past midnight
                time += DAY
        elif self._mode == "RELATIVE":  # from line to line
            time += self._time
        self._time = time
        return self._start + time


def is_busmaster(path: Path) -> bool:
    """Whether a file names BUSMASTER as its writer, or begins as what is left of such a one."""
    return head_of(path).lstrip().startswith(MARK)


BUSMASTER = LogFormat((".log",), "BUSMASTER, text", BusmasterLog, is_text=True, recognises=is_busmaster)
