"""Logs of PEAK's tools: `.trc` in versions 1.0 to 1.3, 2.0 and 2.1; written in 2.1, classic frames only."""

import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from itertools import repeat
from pathlib import Path

from observer_rt.bus.can_frame import CLASSIC_LENGTH, length_of
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import (
    CLASSIC,
    NANOSECONDS,
    LogFormat,
    LogFrame,
    LogWriter,
    log_frames,
    text_nanoseconds,
)
from observer_rt.files.canlog.text_log import TextLogReader
from observer_rt.foundation.errors import UserError

DAY_ZERO = datetime(1899, 12, 30, tzinfo=UTC)
DAY = 86_400 * NANOSECONDS
STAMP_STEP = 1000  # ns to which stamps are written
MILLISECOND_DIGITS = 6  # ns in a ms, as a power of ten
STANDARD_DIGITS = 4  # of an identifier; an extended one has more
FD_TYPES = {"FD": (False, False), "FB": (True, False), "FE": (True, True), "BI": (False, True)}
DIRECTIONS = {"Rx": False, "Tx": True}
OLD_COLUMNS = {  # places of what later versions name themselves; the type of a data frame is its direction
    "1.0": {"O": 1, "I": 2, "l": 3, "D": 4},
    "1.1": {"O": 1, "T": 2, "I": 3, "l": 4, "D": 5},
    "1.2": {"O": 1, "B": 2, "T": 3, "I": 4, "l": 5, "D": 6},
    "1.3": {"O": 1, "B": 2, "T": 3, "I": 4, "l": 6, "D": 7},
}
_USUAL_COLUMNS = (tuple("NOTBIdRLD"), tuple("NOTBIdRlD"))
_USUAL = re.compile(  # of data frames of classic CAN, to the us
    r"^ *+\d++ ++(\d++\.\d{3}) ++DT ++(\d++) ++([0-9A-F]++) (Rx|Tx) - ++([0-8])(| .*)$", re.MULTILINE
)
NO_IDENTIFIER = "FFFFFFFF"  # of a row of version 1.0 that is no frame


class TrcLog(TextLogReader):
    """Reader; channels are named by their number. The start time is taken as UTC."""

    kind = "a TRC log"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._version = ""
        self._start = 0
        self._at: dict[str, int] = {}  # place of a column
        self._has_rows = False
        self._usual: re.Pattern[str] | None = None
        return super()._entries()

    def _entry(self, text: str, number: int) -> LogFrame | None:
        if text.startswith(";"):
            self._header(text, number)
            return None
        if not self._has_rows:
            self._begin_rows(number)
        return self._frame(text.split())

    def _frames(self, text: str, lines: int) -> Iterator[LogFrame] | None:
        found = self._usual.findall(text) if self._usual is not None else []
        if len(found) != lines:
            return None
        offsets, buses, identifiers, directions, lengths, data = zip(*found, strict=True)
        try:
            payloads = list(map(bytes.fromhex, data))
        except ValueError:
            return None
        if list(map(len, payloads)) != list(map(int, lengths)):
            return None
        return log_frames(
            map(int, identifiers, repeat(16)),
            payloads,
            [self._start + int(each.replace(".", "")) * STAMP_STEP for each in offsets],
            [len(each) > STANDARD_DIGITS for each in identifiers],
            *CLASSIC,
            buses,
            map("Tx".__eq__, directions),
        )

    def _header(self, text: str, number: int) -> None:
        key, _, value = text.partition("=")
        if key == ";$FILEVERSION":
            self._version = value.strip()
        elif key == ";$STARTTIME":
            try:
                days = Decimal(value.strip(" ;"))  # PCAN-Explorer 5 ends it with a semicolon
            except InvalidOperation:
                self.refuse(number, f"'{value}' is no start time", "correct it, in days since 30.12.1899")
            since_1970 = datetime.fromtimestamp(0, UTC) - DAY_ZERO
            self._start = round((days - since_1970.days) * DAY / STAMP_STEP) * STAMP_STEP
        elif key == ";$COLUMNS":
            self._at = {column.strip(): place for place, column in enumerate(value.split(","))}
        elif key.startswith(";") and not self._version and number == 1 and "#" in key:
            self._version = "1.0"  # which has no version line, but this rule

    def _begin_rows(self, number: int) -> None:
        """Refuse a heading that does not name the columns."""
        self._has_rows = True
        if self._version == "1.0":
            self.remarks.append("its stamps are whole milliseconds")
        if self._version in OLD_COLUMNS:
            self._at = OLD_COLUMNS[self._version]
        elif self._version not in ("2.0", "2.1"):
            problem = f"version '{self._version}' is not known" if self._version else "no TRC log: no version"
            self.refuse_content(number, problem, "export it from PEAK's tools as version 2.1")
        elif not set("OTId") <= set(self._at) or not {"l", "L"} & set(self._at):
            self.refuse(number, f"columns {','.join(self._at)} do not suffice", "export N,O,T,B,I,d,l,D")
        if tuple(self._at) in _USUAL_COLUMNS:
            self._usual = _USUAL

    def _frame(self, words: list[str]) -> LogFrame | None:
        at = self._at
        kind = words[at["T"]] if "T" in at else "ST" if words[at["I"]] == NO_IDENTIFIER else "Rx"
        is_old = self._version in OLD_COLUMNS
        is_fd, is_data = kind in FD_TYPES, kind == "DT" or (is_old and kind in DIRECTIONS)
        data = words[at["D"] :] if "D" in at else []
        if kind in ("ER", "Error") or (is_data and data[:1] == ["ERROR"]):
            self.error_frames += 1
            return None
        if kind == "RR" or (is_data and data[:1] == ["RTR"]):
            self.remote_frames += 1
            return None
        if not is_fd and not is_data:
            self.other_entries += 1
            return None
        code = int(words[at["l"] if "l" in at else at["L"]])
        length = code if "l" in at else length_of(code) if is_fd else min(code, CLASSIC_LENGTH)
        if is_data and length > CLASSIC_LENGTH and len(data) >= length:  # of a transport protocol: no frame
            self.other_entries += 1
            return None
        payload = bytes.fromhex(" ".join(data))
        if len(payload) != length:
            raise ValueError
        identifier = words[at["I"]]
        frame = Frame(
            int(identifier, 16),
            payload,
            self._start + text_nanoseconds(words[at["O"]], MILLISECOND_DIGITS),
            len(identifier) > STANDARD_DIGITS,
            is_fd,
            *FD_TYPES.get(kind, (False, False)),
        )
        is_sent = DIRECTIONS.get(words[at["d"]] if "d" in at else kind, False)
        return LogFrame(frame, words[at["B"]] if "B" in at else "1", is_sent)


class TrcWriter(LogWriter):
    """Writer; stamps are rounded to whole microseconds, channels are numbered from 1."""

    start_step = STAMP_STEP

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._count = 0
        moment = datetime.fromtimestamp(self._start // NANOSECONDS, UTC)
        days = (moment - DAY_ZERO) // timedelta(seconds=1) * NANOSECONDS + self._start % NANOSECONDS
        self._file = path.open("w", encoding="ascii", newline="\r\n")
        self._file.write(
            f";$FILEVERSION=2.1\n;$STARTTIME={Decimal(days) / DAY:.15f}\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
            f";\n;   Start time: {moment:%d.%m.%Y %H:%M:%S} UTC\n;   Generated by observer-rt\n"
            ";   Columns: number, time offset [ms], type, bus, ID [hex], Rx/Tx, reserved, length code, data\n"
        )

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        if frame.is_fd:
            raise UserError(
                str(self.path),
                f"a .trc file written here holds classic frames only; {frame.frame_id:X} is a CAN FD frame",
                "write a format that keeps CAN FD; `observer-rt convert --help` names them",
            )
        time = self._since_start(frame.stamp_ns + STAMP_STEP // 2) // STAMP_STEP
        self._count += 1
        identifier = f"{frame.frame_id:0{8 if frame.is_extended else 4}X}"
        milliseconds = f"{time // 1000}.{time % 1000:03d}"
        self._file.write(
            f"{self._count:>7} {milliseconds:>13} DT {self._numbers.of(entry.channel):>2} {identifier:>8} "
            f"{'Tx' if entry.is_sent else 'Rx'} -  {len(frame.payload):<4} {frame.payload.hex(' ').upper()}\n"
        )

    def close(self) -> None:
        self._file.close()


TRC = LogFormat(
    (".trc",),
    "PEAK, text: read in 1.0 to 1.3, 2.0, 2.1, written in 2.1",
    TrcLog,
    TrcWriter,
    keeps_fd=False,
    stamp_step=STAMP_STEP,
    is_text=True,
)
