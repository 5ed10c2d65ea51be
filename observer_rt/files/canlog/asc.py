"""Logs of Vector's tools as text, `.asc`: read in any of their dates and time bases, written absolute."""

import re
from collections.abc import Iterator
from datetime import datetime
from itertools import takewhile
from pathlib import Path

from observer_rt.bus.can_frame import CLASSIC_LENGTH, FD_LENGTHS, length_code, length_of
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import (
    CLASSIC,
    NANOSECONDS,
    LogFormat,
    LogFrame,
    LogWriter,
    log_frames,
    seconds_text,
    text_nanoseconds,
)
from observer_rt.files.canlog.text_log import Rising, TextLogReader
from observer_rt.foundation.errors import UserError

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
MONTHS_ELSEWHERE = {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
_DATE = re.compile(
    r"(?:\S+\s+)?(?P<month>[^\W\d]+)\.?\s+(?P<day>\d{1,2})\s+"
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d):(?P<second>\d\d)(?:[.,](?P<fraction>\d{1,9}))?"
    r"(?:\s+(?P<half>[ap]m))?\s+(?P<year>\d{4})",
    re.IGNORECASE,
)

FLAG_REMOTE, FLAG_FD, FLAG_BIT_RATE_SWITCH, FLAG_ERROR_STATE = 0x10, 0x1000, 0x2000, 0x4000
_TIME = re.compile(r"\d+(?:[.,]\d+)?")
_BASE = re.compile(r"base\s+(?P<base>hex|dec)\b", re.IGNORECASE)
_TIMES = re.compile(r"(?:base\s+\w+\s+)?timestamps\s+(?P<times>absolute|relative)", re.IGNORECASE)
_IDENTIFIER = {16: re.compile(r"[0-9A-Fa-f]+[xX]?"), 10: re.compile(r"[0-9]+[xX]?")}
_BYTE = {16: re.compile(r"[0-9A-Fa-f]{1,2}"), 10: re.compile(r"[0-9]{1,3}")}
_USUAL = re.compile(  # of data frames of classic CAN
    r"^ *(\d+)\.(\d{1,9}) +(\d+) +([0-9A-Fa-f]+x?) +(Rx|Tx) +d ([0-8])((?: [0-9A-Fa-f ]*)?)"
    r"(?:Length = \d+ BitCount = \d+ ID = \d+x?)? *$",
    re.MULTILINE,
)
_DIRECTIONS = {"rx": False, "tx": True}
HEADING = ("internal events", "no internal events")
_AFTER_DATA = 4  # words of a CAN FD line from its data to its flags, which comes third

DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")


def nanoseconds_of(text: str) -> int | None:
    """A date as Vector's tools write it, as local time, in ns since 1970; None in an unknown language."""
    match = _DATE.fullmatch(text)
    if match is None:
        return None
    known = {month.lower(): number for number, month in enumerate(MONTHS, start=1)} | MONTHS_ELSEWHERE
    month = known.get(match["month"].lower())
    hour = int(match["hour"])
    if match["half"]:
        hour = hour % 12 + 12 * (match["half"].lower() == "pm")
    try:
        moment = datetime(
            int(match["year"]),
            month or 0,
            int(match["day"]),
            hour,
            int(match["minute"]),
            int(match["second"]),
        )
        return int(moment.timestamp()) * NANOSECONDS + text_nanoseconds(f"0.{match['fraction'] or 0}")
    except (ValueError, OverflowError):
        return None


class AscLog(TextLogReader):
    """Reader; channels are numbered from 1 and named by their number.

    Dates are taken as local time; where one is in a language not known, times count from the start of the log,
    and `notes` reports it.
    """

    kind = "an ASC log"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._radix = 16
        self._relative = False
        self._time = 0
        self._rising = Rising()
        self._start: int | None = None
        self._dated = False
        self._ended = False
        self._long_frames = 0
        self._is_empty = True
        yield from super()._entries()
        if self._is_empty:
            raise UserError(str(self.path), "is empty: it has not even a heading", "record it again")
        if self._long_frames:
            self.remarks.append(
                f"{self._long_frames} frames of more than 8 bytes in lines of classic CAN are read as CAN FD"
            )
        if not self._ended:
            self.remarks.append("it has no End TriggerBlock: it may have been cut")

    def _frames(self, text: str, lines: int) -> Iterator[LogFrame] | None:
        found = (
            _USUAL.findall(text) if self._radix == 16 and not self._relative and not self._is_empty else []
        )
        if len(found) != lines:
            return None
        seconds, fractions, channels, identifiers, directions, lengths, data = zip(*found, strict=True)
        sizes = list(map(int, lengths))
        try:
            payloads = list(map(bytes.fromhex, data))
        except ValueError:
            return None
        # pairs of digits only, each behind a blank
        if list(map(len, payloads)) != sizes or [len(each.rstrip()) for each in data] != [
            3 * n for n in sizes
        ]:
            return None
        start = self._start or 0
        return log_frames(
            [int(each.rstrip("x"), 16) for each in identifiers],
            payloads,
            [
                start + int(second) * NANOSECONDS + int(fraction.ljust(9, "0"))
                for second, fraction in zip(seconds, fractions, strict=True)
            ],
            [each.endswith("x") for each in identifiers],
            *CLASSIC,
            map(str, map(int, channels)),
            map("Tx".__eq__, directions),
        )

    def _entry(self, text: str, number: int) -> LogFrame | None:
        self._is_empty = False
        words = text.split()
        if number == 1 and words[0].lower() not in ("date", "base", "//"):
            self.refuse_content(number, "no ASC log: neither date nor base", "give a log of Vector's tools")
        if _TIME.fullmatch(words[0]) is None:
            self._header(text, number)
            return None
        return self._event(words, number)

    def _header(self, text: str, number: int) -> None:
        lower = text.lower()
        base, times = _BASE.match(text), _TIMES.match(text)  # on one line or on two
        if base is not None:
            self._radix = 16 if base["base"].lower() == "hex" else 10
        if times is not None:
            self._relative = times["times"].lower() == "relative"
        if base is not None or times is not None:
            return
        if not text.startswith(("//", ";")) and not _DIRECTIONS.keys().isdisjoint(lower.split()):
            raise ValueError  # what is left of a frame
        if lower.startswith("date "):
            self._take_date(text[len("date ") :], number)
        elif lower.startswith("begin trigger"):
            # of two dates this one belongs to time 0; later blocks go on in the same time
            date = text.split(None, 2)[2:]
            if date and not self._dated:
                self._take_date(date[0], number)
            self._dated = True
        elif lower.startswith("end trigger"):
            self._ended = True
        elif text.startswith(("//", ";")):
            return
        elif not text[0].isalpha():
            raise ValueError
        else:
            self.other_entries += not lower.startswith(HEADING)

    def _take_date(self, text: str, number: int) -> None:
        start = nanoseconds_of(text.strip())
        if start is not None:
            self._start = start
        elif self._start is None:
            self.remarks.append(f"line {number}: date '{text.strip()}' not understood, times count from 0")

    def _event(self, words: list[str], number: int) -> LogFrame | None:
        time = text_nanoseconds(words[0])
        if self._relative:
            self._rising.add(time)
            if self._rising.is_from_start:  # no distances from line to line, whatever the heading says
                self.refuse(
                    number,
                    "times rise from line to line, but the heading calls them relative (to the line before)",
                    "write 'absolute' for 'relative' in the heading if they count from the start",
                )
            self._time += time
        else:
            self._time = time
        stamp = (self._start or 0) + self._time
        if words[1].upper() == "CANFD":
            return self._fd(words, stamp)
        if words[1].isdigit():
            return self._classic(words, number, stamp)
        self.other_entries += " ".join(words[1:]).lower() != "start of measurement"
        return None

    def _classic(self, words: list[str], number: int, stamp: int) -> LogFrame | None:
        if words[2].lower().startswith("errorframe"):
            self.error_frames += 1
            return None
        direction = words[3].lower() if len(words) > 3 else ""
        is_identifier = _IDENTIFIER[self._radix].fullmatch(words[2]) is not None
        if direction not in _DIRECTIONS:
            if is_identifier and direction != "txrq" and len(words) < 5:
                raise ValueError
            self.other_entries += 1  # statistics, transport protocols, requests to send
            return None
        if not is_identifier:
            self.refuse(number, f"identifier '{words[2]}' is a name", "export the log with numbers")
        kind = words[4].lower()
        if kind == "r":
            self.remote_frames += 1
            return None
        if kind != "d":
            raise ValueError
        length = self._length(words[5], words[6:], number)
        _refuse_second_frame(words[6 + length :])
        self._long_frames += length > CLASSIC_LENGTH
        identifier, is_extended = _identifier(words[2], self._radix)
        data = _data(words[6 : 6 + length], length, self._radix)
        frame = Frame(identifier, data, stamp, is_extended, length > CLASSIC_LENGTH)
        return LogFrame(frame, str(int(words[1])), _DIRECTIONS[direction])

    def _length(self, code: str, words: list[str], number: int) -> int:
        """Bytes of a frame by its length code, before `words` that begin with them.

        Some converters write CAN FD frames like classic ones, with a code that is decimal whatever the base.
        """
        length = min(int(code, self._radix), CLASSIC_LENGTH)
        there = sum(1 for _ in takewhile(_BYTE[self._radix].fullmatch, words))
        if there <= length:
            return length
        if not (code.isdigit() and CLASSIC_LENGTH < there == length_of(int(code))):
            self.refuse(number, f"{there} bytes follow a length code {code}, which stands for {length}")
        return there

    def _fd(self, words: list[str], stamp: int) -> LogFrame | None:
        """A line of a CAN FD channel: hexadecimal, whatever the base of the others."""
        direction = words[3].lower()
        if direction not in _DIRECTIONS:
            if direction != "txrq":
                raise ValueError
            self.other_entries += 1
            return None
        if words[4].lower().startswith("errorframe"):
            self.error_frames += 1
            return None
        at = 5 if words[5].isdigit() and len(words[5]) == 1 else 6  # a name may stand after the identifier
        switch, state, dlc, length = words[at], words[at + 1], words[at + 2], int(words[at + 3])
        if switch not in "01" or state not in "01" or length not in FD_LENGTHS:
            raise ValueError
        first = at + 4
        after = words[first + length :]
        _refuse_second_frame(after)
        flags = int(after[2], 16) if len(after) >= _AFTER_DATA else FLAG_FD
        if not flags & FLAG_FD and flags & FLAG_REMOTE:
            self.remote_frames += 1
            return None
        is_fd = bool(flags & FLAG_FD) or length > CLASSIC_LENGTH  # some converters leave the flags at 0
        if is_fd and length_of(int(dlc, 16)) != length:
            raise ValueError
        identifier, is_extended = _identifier(words[4], 16)
        data = _data(words[first : first + length], length, 16)
        frame = Frame(identifier, data, stamp, is_extended, is_fd, switch == "1", state == "1")
        return LogFrame(frame, str(int(words[2])), _DIRECTIONS[direction])


def _refuse_second_frame(words: list[str]) -> None:
    """Raise `ValueError` where another frame follows in the line: a line's end, and more, is missing."""
    comment = next((n for n, word in enumerate(words) if word.startswith("//")), len(words))
    if any(word.lower() in _DIRECTIONS for word in words[:comment]):
        raise ValueError


def _identifier(word: str, radix: int) -> tuple[int, bool]:
    is_extended = word[-1] in "xX"
    return int(word[:-1] if is_extended else word, radix), is_extended


def _data(words: list[str], length: int, radix: int) -> bytes:
    # hexadecimal: pairs of digits only, for of a byte that was cut one digit may be left
    data = bytes.fromhex(" ".join(words)) if radix == 16 else bytes(map(int, words))
    if len(data) != length or len(words) != length:
        raise ValueError
    return data


class AscWriter(LogWriter):
    """Writer; channels are numbered from 1. Stamps have six digits where those are enough, else nine."""

    start_step = NANOSECONDS // 1000

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        moment = datetime.fromtimestamp(self._start // NANOSECONDS)
        date = (
            f"{DAYS[moment.weekday()]} {MONTHS[moment.month - 1]} {moment.day:02d} {moment:%H:%M:%S}."
            f"{self._start % NANOSECONDS // self.start_step:03d} {moment.year}"
        )
        self._file = path.open("w", encoding="ascii", newline="\n")
        self._file.write(
            f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
            f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
        )

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        stamp = seconds_text(self._since_start(frame.stamp_ns), 4)
        channel = self._numbers.of(entry.channel)
        identifier = f"{frame.frame_id:X}{'x' if frame.is_extended else ''}"
        direction = "Tx" if entry.is_sent else "Rx"
        data = frame.payload.hex(" ").upper()
        length = len(frame.payload)
        if frame.is_fd:
            flags = FLAG_FD | FLAG_BIT_RATE_SWITCH * frame.bit_rate_switch
            flags |= FLAG_ERROR_STATE * frame.error_state_indicator
            self._file.write(
                f"{stamp} CANFD {channel:>3} {direction:<4} {identifier:>8}  {'':>32} "
                f"{frame.bit_rate_switch:d} {frame.error_state_indicator:d} {length_code(length):x} "
                f"{length:>2} {data} {0:>8} {0:>4} {flags:>8X} {0:>8} {0:>8} {0:>8} {0:>8} {0:>8}\n"
            )
        else:
            self._file.write(
                f"{stamp} {channel}  {identifier:<15} {direction:<4} d {length:x} {data}".rstrip() + "\n"
            )

    def close(self) -> None:
        if not self._file.closed:
            self._file.write("End TriggerBlock\n")
            self._file.close()


ASC = LogFormat((".asc",), "Vector, text", AscLog, AscWriter, is_text=True)
