"""Logs of PEAK's tools, `.trc`: frames by python-can, versions and starts read here."""

from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from pathlib import Path

import can

from observer_rt.bus.can_frame import CLASSIC_LENGTH, length_of
from observer_rt.files.canlog.can_log import NANOSECONDS, LogFormat, LogFrame
from observer_rt.files.canlog.python_can import (
    MICROSECOND,
    MILLISECOND,
    PythonCanLog,
    PythonCanWriter,
    log_frame,
)
from observer_rt.foundation.errors import UserError

DAY_ZERO = datetime(1899, 12, 30, tzinfo=UTC)
DAY = 86_400 * NANOSECONDS
_EXPORT = "export it from PEAK's tools as version 2.1"
_PLACES: dict[str, tuple[int | None, int]] = {  # of the kind and of the data, in a line
    "1.0": (None, 4),
    "1.1": (2, 5),
    "1.3": (3, 7),
    "2.0": (None, 0),
    "2.1": (None, 0),
}
_FRAMES = ("DT", "FD", "FB", "FE", "BI", "RR", "Rx", "Tx")


class TrcLog(PythonCanLog):
    """Reader of PEAK's text. The start time is taken as UTC."""

    kind = "a TRC log"
    reader = can.TRCReader

    def _reset(self) -> None:
        super()._reset()
        self._version, self._start = "", 0
        self._kind_place: int | None = None
        self._data_place = 0

    def _prepared(self, text: str) -> tuple[list[str], str]:
        if not text.startswith(";"):
            if not self._version:
                self.refuse_content(self._number, "no TRC log: no version", _EXPORT)
            if "ERROR" in text.split():
                self.error_frames += 1
                return [], ""
            return [], text
        key, _, value = text.partition("=")
        if key == ";$STARTTIME":
            self._take_start(value)
            return [], ""
        if key == ";$FILEVERSION" or (self._number == 1 and "#" in key):
            self._version = value.strip() or "1.0"  # which has a rule in place of its version
            if self._version not in _PLACES:
                self.refuse(self._number, f"version '{self._version}' is not read", _EXPORT)
            self._kind_place, self._data_place = _PLACES[self._version]
            if self._version == "1.0":
                self.remarks.append("its stamps are whole milliseconds")
        elif key == ";$COLUMNS":
            columns = value.split(",")
            if not set("OTIdD") <= set(columns):
                self.refuse(self._number, f"columns {value} do not suffice", "export N,O,T,B,I,d,l,D")
            self._kind_place, self._data_place = columns.index("T"), len(columns) - 1
        return [text], ""

    def _take_start(self, value: str) -> None:
        try:
            days = Decimal(value.strip(" ;"))  # PCAN-Explorer 5 ends it with a semicolon
            since_1970 = days - (datetime.fromtimestamp(0, UTC) - DAY_ZERO).days
            self._start = round(since_1970 * DAY / MICROSECOND) * MICROSECOND if days else 0
        except (InvalidOperation, ValueError, OverflowError):
            problem = f"'{value}' is no start time"
            self.refuse(self._number, problem, "correct it, in days since 30.12.1899")
        if not days:
            self.remarks.append("its times are taken to count from its start")

    def _pass_over(self, words: list[str]) -> None:
        kind = "ST" if self._kind_place is None else words[self._kind_place]
        if kind in _FRAMES or (self._kind_place is None and words[2] != "FFFFFFFF"):
            raise ValueError
        self.error_frames += kind in ("ER", "Error")
        self.other_entries += kind not in ("ER", "Error")

    def _frame(self, message: can.Message) -> LogFrame | None:
        payload, words = bytes(message.data), self._text.split()
        size = len(payload)
        if size != (length_of(message.dlc) if message.is_fd else min(message.dlc, CLASSIC_LENGTH)):
            if message.is_fd or size != message.dlc:
                raise ValueError
            self.other_entries += 1  # of a transport protocol
            return None
        if len(words) != self._data_place + size:
            raise ValueError
        stamp = self._start + round(message.timestamp * NANOSECONDS)
        return log_frame(message, stamp, message.is_fd, message.channel)


class TrcWriter(PythonCanWriter):
    """Writer of PEAK's text."""

    start_step = MILLISECOND

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._writer = can.TRCWriter(path)
        self._writer.first_timestamp = self._start / NANOSECONDS
        self._writer.write_header(self._start / NANOSECONDS)

    def write(self, entry: LogFrame) -> None:
        if entry.frame.is_fd:
            raise UserError(
                str(self.path),
                f"a .trc file written here holds classic frames only; {entry.frame.frame_id:X} is a CAN FD frame",
                "write a format that keeps CAN FD; `observer-rt convert --help` names them",
            )
        super().write(entry)


TRC = LogFormat(
    ".trc",
    TrcLog,
    TrcWriter,
    keeps_fd=False,
    stamp_step=MICROSECOND,
)
