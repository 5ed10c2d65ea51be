"""Logs of text that python-can reads, one line at a time: lines that it would pass over are counted, or refused."""

import logging
import re
from abc import abstractmethod
from collections.abc import Iterator
from pathlib import Path
from time import localtime
from typing import ClassVar

import can
from can.io.generic import TextIOMessageReader

from observer_rt.bus.can_frame import CLASSIC_LENGTH, length_of
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFormat, LogFrame, text_nanoseconds
from observer_rt.files.canlog.text_log import EARLIEST_DATE, FROM_START, TextLogReader, other_kind
from observer_rt.foundation.units import NANOSECONDS, NANOSECONDS_PER_US

logging.getLogger("can.io").addHandler(logging.NullHandler())  # what it warns of is refused in words, with the line
_CSV_HEADING = "timestamp,arbitration_id,extended,remote,error,dlc,data"
_TRC_PLACES: dict[str, tuple[int | None, int]] = {  # of the kind and of the data, in a line
    "1.0": (None, 4),
    "1.1": (2, 5),
    "1.3": (3, 7),
    "2.0": (None, 0),
    "2.1": (None, 0),
}
_TRC_FRAMES = ("DT", "FD", "FB", "FE", "BI", "RR", "Rx", "Tx")
_TRC_EXPORT = "export it from PEAK's tools as version 2.1"
_ASC_TIME = re.compile(r"-?\d+(?:[.,]\d+)?")
_FIRST_AFTER_DATE = 3600 * NANOSECONDS  # within which the first frame of a log with times of the day comes
_ASC_FD = 0x1000  # among the flags of a CAN FD line, third behind its data
_NUMBER = re.compile(r"[0-9A-Fa-f]+[xX]?")
_BYTE = re.compile(r"[0-9A-Fa-f]{1,2}|\d{3}")


class PythonCanLog(TextLogReader):
    """Reader by one of python-can's; channels are named by their number."""

    reader: ClassVar[type[TextIOMessageReader]]

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._number, self._text, self._is_open = 0, "", False
        messages = iter(self.reader(self._handed()))  # type: ignore[arg-type]  # it iterates and closes it
        while True:
            entry = None
            try:
                message = next(messages, None)
                if message is None:
                    break
                self._is_open = False
                if message.is_error_frame:
                    self.error_frames += 1
                elif message.is_remote_frame:
                    self.remote_frames += 1
                else:
                    entry = self._frame(message)
            except (ValueError, LookupError, ArithmeticError):
                self.refuse_line(self._number, self._text)
            if entry is not None:
                yield self._number, entry

    def _handed(self) -> Iterator[str]:
        """Lines for python-can, each after the fate of the line before is known."""
        for number, text in self._lines():
            self._number, self._text = number, text
            heading, line = self._prepared(text)
            yield from heading
            if line:
                self._is_open = True
                yield line
                if self._is_open:
                    self._pass_over(text.split())

    @abstractmethod
    def _prepared(self, text: str) -> tuple[list[str], str]:
        """What python-can is to read of a line: of the heading, and what may hold a frame. Raises `ValueError`."""

    def _pass_over(self, words: list[str]) -> None:
        raise ValueError

    @abstractmethod
    def _frame(self, message: can.Message) -> LogFrame | None:
        """The data frame of the last line; None: none that was on a bus. Raises `ValueError` where malformed."""


def _log_frame(message: can.Message, stamp: int, is_fd: bool, channel: object) -> LogFrame:
    flags = message.is_extended_id, is_fd, message.bitrate_switch, message.error_state_indicator
    frame = Frame(message.arbitration_id, bytes(message.data), stamp, *flags)
    return LogFrame(frame, str(channel), not message.is_rx)


def _nanoseconds(seconds: float) -> int:
    """Nanoseconds since 1970, to the microsecond: a float of seconds knows no more."""
    return round(seconds * 1e6) * NANOSECONDS_PER_US


class AscLog(PythonCanLog):
    """Reader of the text of Vector's tools, by its own times: python-can heeds neither a sign nor `relative`.

    Dates are local time, else times count from the log's start (`notes`); empty CAN FD frames count as remote ones.
    """

    kind = "an ASC log"
    reader = can.ASCReader

    def _reset(self) -> None:
        super()._reset()
        self._base = "hex"
        self._is_relative = self._is_dated = self._has_end = self._is_begun = self._has_kind = False
        self._time = self._start = self._of_day = 0

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        yield from super()._entries()
        if not self._has_end:
            self.remarks.append("it has no End TriggerBlock: it may have been cut")

    def _prepared(self, text: str) -> tuple[list[str], str]:
        words = text.split()
        if self._number == 1 and words[0].lower() not in ("date", "base", "//"):
            raise ValueError
        if _ASC_TIME.fullmatch(words[0]) is None:
            self._take_heading(text, text.lower().split())
            return [], ""
        time = text_nanoseconds(words[0])
        self._time = self._time + time if self._is_relative else time
        if words[3:4] == ["TxRq"]:  # asked for, and not yet on the bus
            self.other_entries += 1
            return [], ""
        if self._base == "dec" and words[1].upper() == "CANFD":
            problem = "its CAN FD frames are hexadecimal, the others decimal"
            self.refuse(self._number, problem, "export it with base hex")
        is_stated = self._is_begun or self._has_kind
        if not is_stated and 0 <= time - self._of_day < _FIRST_AFTER_DATE <= self._of_day:
            self._start -= self._of_day
            self.remarks.append("its times are taken for those of the day: the first follows that of its date")
        # python-can swallows the line after the heading
        heading = [] if self._is_begun else [f"base {self._base}", "no internal events logged"]
        self._is_begun = True
        return heading, " ".join(("0.0", *words[1:]))

    def _take_heading(self, text: str, words: list[str]) -> None:
        if text.startswith(("//", ";")):
            return
        if not {"rx", "tx"}.isdisjoint(words) or not text[0].isalpha():
            raise ValueError  # what is left of a frame
        if words[0] in ("base", "timestamps"):
            self._is_relative = "relative" in words
            self._has_kind |= "timestamps" in words
            self._base = words[1] if words[0] == "base" else self._base
        elif words[0] == "date" or (words[0] == "begin" and words[2:] and not self._is_dated):
            self._take_date(text.split()[1 + (words[0] == "begin") :])
        elif words[0] == "end":
            self._has_end = True
        elif words[0] != "begin":
            self.other_entries += "internal" not in words[:2]
        self._is_dated |= words[0] == "begin"  # of two dates the one of the first block belongs to time 0

    def _take_date(self, words: list[str]) -> None:
        try:
            self._start = _nanoseconds(can.ASCReader._datetime_to_timestamp(" ".join(words[1:])))
            date = localtime(self._start // NANOSECONDS)
            self._of_day = ((date.tm_hour * 60 + date.tm_min) * 60 + date.tm_sec) * NANOSECONDS
        except (ValueError, OverflowError):
            if not self._start:
                problem = f"date '{' '.join(words)}' not understood, times count from 0"
                self.remarks.append(f"line {self._number}: {problem}")

    def _pass_over(self, words: list[str]) -> None:
        if words[1].upper() == "CANFD" or (words[1].isdigit() and len(words) < 5 and _NUMBER.fullmatch(words[2])):
            raise ValueError  # what is left of a frame
        self.other_entries += " ".join(words[1:]).lower() != "start of measurement"

    def _frame(self, message: can.Message) -> LogFrame | None:
        words, size, is_fd = self._text.split(), len(message.data), False
        if message.is_fd:
            switch = 5 if words[5] in ("0", "1") else 6  # a name may stand after the identifier
            first = switch + 4
            flags = words[first + size + 2 : first + size + 3]  # there may be classic frames, too
            is_fd = not flags or bool(int(flags[0], 16) & _ASC_FD) or size > CLASSIC_LENGTH
            length, code = int(words[switch + 3]), int(words[switch + 2], 16)
            is_whole = size == length and (not is_fd or size == length_of(code))
        else:
            first = 6
            more = _BYTE.fullmatch("".join(words[first + size : first + size + 1]))
            is_whole = words[4].lower() == "d" and size == min(message.dlc, CLASSIC_LENGTH) and not more
        after = " ".join(words[first + size :]).lower().partition("//")[0]
        if not is_whole or not {"rx", "tx"}.isdisjoint(after.split()):  # the end of a line, and more, is missing
            raise ValueError
        if self._base == "hex" and any(len(word) != 2 for word in words[first : first + size]):
            raise ValueError
        return _log_frame(message, self._start + self._time, is_fd, words[1 + message.is_fd])


class TrcLog(PythonCanLog):
    """Reader of PEAK's text. The start time is taken as UTC."""

    kind = "a TRC log"
    reader = can.TRCReader

    def _reset(self) -> None:
        super()._reset()
        self._version = ""
        self._kind_place: int | None = None
        self._data_place = 0

    def _prepared(self, text: str) -> tuple[list[str], str]:
        key, _, value = text.partition("=")
        if not text.startswith(";"):
            if not self._version:
                self.refuse_line(self._number, "no version")
            if "ERROR" in text.split():
                self.error_frames += 1
                return [], ""
            return [], text
        if key == ";$STARTTIME":
            value = value.strip(" ;")  # PCAN-Explorer 5 ends it with a semicolon
            if not float(value):
                self.remark(FROM_START)
                return [], ""
            text = f"{key}={value}"
        elif key == ";$FILEVERSION" or (self._number == 1 and "#" in key):
            self._version = value.strip() or "1.0"  # which has a rule in place of its version
            if self._version not in _TRC_PLACES:
                self.refuse(self._number, f"version '{self._version}' is not read", _TRC_EXPORT)
            self._kind_place, self._data_place = _TRC_PLACES[self._version]
        elif key == ";$COLUMNS":
            columns = value.split(",")
            if not set("OTIdD") <= set(columns):
                self.refuse(self._number, f"columns {value} do not suffice", _TRC_EXPORT)
            self._kind_place, self._data_place = columns.index("T"), len(columns) - 1
        return [text], ""

    def _pass_over(self, words: list[str]) -> None:
        kind = "ST" if self._kind_place is None else words[self._kind_place]
        if kind in _TRC_FRAMES or (self._kind_place is None and words[2] != "FFFFFFFF"):
            raise ValueError
        self.error_frames += kind in ("ER", "Error")
        self.other_entries += kind not in ("ER", "Error")

    def _frame(self, message: can.Message) -> LogFrame | None:
        size = len(message.data)
        if size != (length_of(message.dlc) if message.is_fd else min(message.dlc, CLASSIC_LENGTH)):
            if message.is_fd or size != message.dlc:
                raise ValueError
            self.other_entries += 1  # of a transport protocol
            return None
        if len(self._text.split()) != self._data_place + size:
            raise ValueError
        return _log_frame(message, _nanoseconds(message.timestamp), message.is_fd, message.channel)


class CsvLog(PythonCanLog):
    """Reader of python-can's own text, which has no channels."""

    kind = "a CSV log of python-can"
    reader = can.CSVReader

    def _prepared(self, text: str) -> tuple[list[str], str]:
        if self._number > 1:
            return [], text
        if text != _CSV_HEADING:
            raise ValueError
        return [text], ""

    def _frame(self, message: can.Message) -> LogFrame | None:
        if len(message.data) != message.dlc:
            raise ValueError
        stamp = _nanoseconds(message.timestamp)
        if stamp < EARLIEST_DATE:
            self.remark(FROM_START)
        return _log_frame(message, stamp, message.dlc > CLASSIC_LENGTH, 1)


def is_csv_log(path: Path) -> bool:
    """Whether a file is python-can's, or another log of frames, which its reader refuses by name."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_CSV_HEADING)) == _CSV_HEADING.encode() or bool(other_kind(path))


ASC = LogFormat(".asc", AscLog)
TRC = LogFormat(".trc", TrcLog)
CSV_LOG = LogFormat(".csv", CsvLog, recognises=is_csv_log)
