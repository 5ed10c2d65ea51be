"""Logs of BUSMASTER, text: `11:49:12:9420 Rx 1 0x023 s 2 40 FF`, stamps in tenths of a millisecond."""

import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from observer_rt.bus.links.link import Frame
from observer_rt.recording.canlog.can_log import NANOSECONDS, LogFormat, LogFrame
from observer_rt.recording.canlog.text_log import TextLogReader, head_of

MARK = b"***BUSMASTER"
DAY = 24 * 3600 * NANOSECONDS
TENTH_OF_MILLISECOND = NANOSECONDS // 10_000
_START = re.compile(r"\*\*\*START DATE AND TIME (\d+):(\d+):(\d+) (\d+):(\d+):(\d+):(\d{1,3})\*\*\*")
_LINE = re.compile(
    r"(?P<hour>\d+):(?P<minute>\d\d?):(?P<second>\d\d?):(?P<fraction>\d{4}) (?P<direction>Rx|Tx) (?P<channel>\d+) "
    r"(?P<id>(?:0x)?[0-9A-Fa-f]+) (?P<kind>s|x|sr|xr) (?P<length>\d+)(?P<data>(?: [0-9A-Fa-f]{1,3})*)"
)


class BusmasterLog(TextLogReader):
    """Reader; channels are named by their number. Dates are taken as local time."""

    kind = "a BUSMASTER log"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._mode = ""
        self._radix = 16
        self._start = 0
        self._time = 0
        self.remarks.append("its stamps are tenths of milliseconds")
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
        elif text.endswith(" MODE***"):
            self._mode = text.strip("*").removesuffix(" MODE")

    def _entry(self, text: str, number: int) -> LogFrame | None:
        if text.startswith("***"):
            self._header(text, number)
            return None
        match = _LINE.fullmatch(text)
        if match is None:
            raise ValueError
        stamp = self._stamp(match, number)
        if match["kind"].endswith("r"):
            self.remote_frames += 1
            return None
        identifier = int(match["id"], self._radix)
        payload = bytes(int(byte, self._radix) for byte in match["data"].split())
        if len(payload) != int(match["length"]):
            self.refuse(number, f"{len(payload)} bytes follow the length {match['length']}")
        frame = Frame(identifier, payload, stamp, match["kind"] == "x", is_fd=False)
        return LogFrame(frame, match["channel"], match["direction"] == "Tx")

    def _stamp(self, match: re.Match[str], number: int) -> int:
        minutes = int(match["hour"]) * 60 + int(match["minute"])
        seconds = minutes * 60 + int(match["second"])
        time = seconds * NANOSECONDS + int(match["fraction"]) * TENTH_OF_MILLISECOND
        if self._mode == "SYSTEM":  # of the day
            midnight = datetime.fromtimestamp(self._start // NANOSECONDS).replace(hour=0, minute=0, second=0)
            time += int(midnight.timestamp()) * NANOSECONDS - self._start
            while self._time - time > DAY // 2:  # past midnight
                time += DAY
        elif self._mode == "RELATIVE":  # from line to line
            time += self._time
        elif self._mode != "ABSOLUTE":
            self.refuse(number, "the heading does not say what times mean", "give a log with its heading")
        self._time = time
        return self._start + time


def is_busmaster(path: Path) -> bool:
    """Whether a file says that BUSMASTER wrote it."""
    return head_of(path).startswith(MARK)


BUSMASTER = LogFormat((".log",), "BUSMASTER, text", BusmasterLog, is_text=True, recognises=is_busmaster)
