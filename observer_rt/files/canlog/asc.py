"""Logs of Vector's tools as text, `.asc`: frames by python-can, times and dates read here."""

import re
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import can

from observer_rt.bus.can_frame import CLASSIC_LENGTH, length_of
from observer_rt.files.canlog.can_log import NANOSECONDS, LogFormat, LogFrame, text_nanoseconds
from observer_rt.files.canlog.python_can import (
    MICROSECOND,
    MILLISECOND,
    PythonCanLog,
    PythonCanWriter,
    log_frame,
)
from observer_rt.files.canlog.text_log import Rising
from observer_rt.foundation.errors import UserError

FLAG_REMOTE, FLAG_FD = 0x10, 0x1000  # of CAN FD lines
_DATES = ("%b %d %H:%M:%S.%f %Y", "%b %d %H:%M:%S %Y", "%b %d %I:%M:%S.%f %p %Y", "%b %d %I:%M:%S %p %Y")
_MONTHS = {"mär": "Mar", "mrz": "Mar", "mai": "May", "okt": "Oct", "dez": "Dec"}
_TIME = re.compile(r"-?\d+(?:[.,]\d+)?")
_IDENTIFIER = re.compile(r"[0-9A-Fa-f]+[xX]?")
_BYTE = re.compile(r"[0-9A-Fa-f]{1,2}|\d{3}")
_AFTER_DATA = 4  # words of a CAN FD line from its data to its flags, which comes third


class AscLog(PythonCanLog):
    """Reader of the text of Vector's tools, by its own times: python-can heeds neither a sign nor `relative`.

    Dates are local time; where one is not understood, times count from the start of the log, and `notes` reports it.
    """

    kind = "an ASC log"
    reader = can.ASCReader

    def _reset(self) -> None:
        super()._reset()
        self._base = "hex"
        self._is_relative = self._is_dated = self._has_end = self._is_begun = False
        self._time = self._start = 0
        self._rising = Rising()

    def _end(self) -> None:
        if not self._number:
            raise UserError(str(self.path), "is empty: it has not even a heading", "record it again")
        if not self._has_end:
            self.remarks.append("it has no End TriggerBlock: it may have been cut")

    def _prepared(self, text: str) -> tuple[list[str], str]:
        words = text.split()
        if self._number == 1 and words[0].lower() not in ("date", "base", "//"):
            self.refuse_content(1, "no ASC log: neither date nor base", "give a log of Vector's tools")
        if _TIME.fullmatch(words[0]) is None:
            self._take_heading(text, text.lower().split())
            return [], ""
        self._take_time(text_nanoseconds(words[0]))
        if words[3:4] == ["TxRq"]:  # asked for, and not yet on the bus
            self.other_entries += 1
            return [], ""
        is_fd = words[1].upper() == "CANFD"
        if is_fd and self._base == "dec":
            problem = "its CAN FD frames are hexadecimal, the others decimal"
            self.refuse(self._number, problem, "export it with base hex")
        # python-can swallows the line after the heading, and expects something behind a length of 0
        heading = [] if self._is_begun else [f"base {self._base}", "no internal events logged"]
        self._is_begun = True
        return heading, " ".join(("0.0", *words[1:], *["-"] * (is_fd and words[-1] == "0")))

    def _take_heading(self, text: str, words: list[str]) -> None:
        if text.startswith(("//", ";")):
            return
        if not {"rx", "tx"}.isdisjoint(words) or not text[0].isalpha():
            raise ValueError  # what is left of a frame
        if words[0] in ("base", "timestamps"):
            self._is_relative = "relative" in words
            self._base = words[1] if words[0] == "base" else self._base
        elif words[0] == "date":
            self._take_date(text.split()[1:])
        elif words[0] == "begin":
            if words[2:] and not self._is_dated:  # of two dates this one belongs to time 0
                self._take_date(text.split()[2:])
            self._is_dated = True
        elif words[0] == "end":
            self._has_end = True
        else:
            self.other_entries += "internal" not in words[:2]

    def _take_date(self, words: list[str]) -> None:
        """Take a date, as local time; its weekday is passed over."""
        month, *others = words[1:] or [""]
        text = " ".join((_MONTHS.get(month.lower(), month), *others))
        for form in _DATES:
            with suppress(ValueError, OverflowError):
                moment = datetime.strptime(text, form)
                self._start = int(moment.timestamp()) * NANOSECONDS + moment.microsecond * MICROSECOND
                return
        if not self._start:
            date = " ".join(words)
            self.remarks.append(f"line {self._number}: date '{date}' not understood, times count from 0")

    def _take_time(self, time: int) -> None:
        self._time = self._time + time if self._is_relative else time
        self._rising.add(time)
        if self._is_relative and self._rising.is_from_start:
            self.refuse(
                self._number,
                "times rise from line to line, but the heading calls them relative (to the line before)",
                "write 'absolute' for 'relative' in the heading if they count from the start",
            )

    def _pass_over(self, words: list[str]) -> None:
        if words[1].upper() == "CANFD" or (
            words[1].isdigit() and len(words) < 5 and _IDENTIFIER.fullmatch(words[2])
        ):
            raise ValueError  # what is left of a frame
        self.other_entries += " ".join(words[1:]).lower() != "start of measurement"

    def _is_remote(self, message: can.Message) -> bool:
        if not message.is_fd:
            return message.is_remote_frame
        flags = self._fd_flags(len(message.data))  # python-can takes an empty frame for a remote one
        return bool(flags & FLAG_REMOTE and not flags & FLAG_FD)

    def _fd_flags(self, length: int) -> int:
        """Flags of a CAN FD line, on which there may be classic frames, too."""
        words = self._text.split()
        after = words[self._fd_place(words) + 4 + length :]
        return int(after[2], 16) if len(after) >= _AFTER_DATA else FLAG_FD

    def _fd_place(self, words: list[str]) -> int:
        """Place of the bit rate switch: a name may stand after the identifier."""
        return 5 if words[5] in ("0", "1") else 6

    def _frame(self, message: can.Message) -> LogFrame | None:
        words, payload, is_fd = self._text.split(), bytes(message.data), False
        size = len(payload)
        if message.is_fd:
            at = self._fd_place(words)
            first = at + 4
            is_fd = bool(self._fd_flags(size) & FLAG_FD) or size > CLASSIC_LENGTH
            if size != int(words[at + 3]) or (is_fd and size != length_of(int(words[at + 2], 16))):
                raise ValueError
        else:
            first = 6
            if words[4].lower() != "d" or size != min(message.dlc, CLASSIC_LENGTH):
                raise ValueError
            if _BYTE.fullmatch("".join(words[first + size : first + size + 1])):
                self.refuse(self._number, f"more than {size} bytes follow the length {words[5]}")
        data, after = words[first : first + size], [word.lower() for word in words[first + size :]]
        comment = next((n for n, word in enumerate(after) if word.startswith("//")), len(after))
        if not {"rx", "tx"}.isdisjoint(after[:comment]):  # a line's end, and more, is missing
            raise ValueError
        if self._base == "hex" and any(len(word) != 2 for word in data):
            raise ValueError
        return log_frame(message, self._start + self._time, is_fd, int(words[1 + message.is_fd]))


class AscWriter(PythonCanWriter):
    """Writer of the text of Vector's tools."""

    start_step = 100 * MILLISECOND  # python-can writes milliseconds without leading zeros

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._writer = can.ASCWriter(path)
        self._writer.log_event("Start of measurement", self._start / NANOSECONDS)


ASC = LogFormat(".asc", AscLog, AscWriter, stamp_step=MICROSECOND)
