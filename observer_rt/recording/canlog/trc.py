"""Logs of PEAK's tools: `.trc` in versions 1.0 to 1.3, 2.0 and 2.1; written in 2.1, classic frames only."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

from observer_rt.bus.can_frame import CLASSIC_LENGTH, length_of
from observer_rt.foundation.errors import UserError
from observer_rt.recording.canlog.can_log import (
    NANOSECONDS,
    ChannelNumbers,
    LogFormat,
    LogFrame,
    LogWriter,
    text_nanoseconds,
)
from observer_rt.recording.canlog.text_log import TextLogReader

DAY_ZERO = datetime(1899, 12, 30, tzinfo=UTC)
DAY = 86_400 * NANOSECONDS
STAMP_STEP = 1000  # ns to which stamps are written
MILLISECOND_DIGITS = 6  # ns in a ms, as a power of ten
STANDARD_DIGITS = 4  # of an identifier; an extended one has more
FD_TYPES = {"FD": (False, False), "FB": (True, False), "FE": (True, True), "BI": (False, True)}
OLD_DIRECTIONS = {"Rx": False, "Tx": True}


class _Row(NamedTuple):
    """Words of one line, by what they are; `length` in bytes."""

    time: str
    channel: str
    kind: str
    identifier: str
    is_sent: bool
    length: int
    data: list[str]


class TrcLog(TextLogReader):
    """Reader; channels are named by their number. The start time is taken as UTC."""

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._version = ""
        self._start = 0
        self._at: dict[str, int] = {}  # place of a column
        row_of: Callable[[list[str]], _Row] | None = None
        for number, line in self._lines():
            text = line.strip()
            if text.startswith(";"):
                self._header(text, number)
            elif text:
                row_of = row_of or self._row_reader(number)
                try:
                    entry = self._entry(row_of(text.split()), number)
                except (ValueError, IndexError):
                    self.refuse(number, f"not a line of a TRC log: '{text[:60]}'")
                if entry is not None:
                    yield number, entry

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

    def _row_reader(self, number: int) -> Callable[[list[str]], _Row]:
        if self._version == "1.0":
            self.remarks.append("its stamps are whole milliseconds")
            return _row_1_0
        readers = {"1.1": _row_1_1, "1.2": _row_1_2, "1.3": _row_1_3}
        if self._version in readers:
            return readers[self._version]
        if self._version not in ("2.0", "2.1"):
            problem = f"version '{self._version}' is not known" if self._version else "no TRC log: no version"
            self.refuse_content(number, problem, "export it from PEAK's tools as version 2.1")
        if not set("OTId") <= set(self._at) or not {"l", "L"} & set(self._at):
            self.refuse(number, f"columns {','.join(self._at)} do not suffice", "export N,O,T,B,I,d,l,D")
        return self._row_2

    def _row_2(self, words: list[str]) -> _Row:
        at = self._at
        time, kind = words[at["O"]], words[at["T"]]
        if kind not in FD_TYPES and kind != "DT":
            return _Row(time, "", kind, "", False, 0, [])
        if "l" in at:
            length = int(words[at["l"]])
        else:
            code = int(words[at["L"]])
            length = length_of(code) if kind in FD_TYPES else min(code, CLASSIC_LENGTH)
        channel = words[at["B"]] if "B" in at else "1"
        data = words[at["D"] :] if "D" in at else []
        return _Row(time, channel, kind, words[at["I"]], words[at["d"]] == "Tx", length, data)

    def _entry(self, row: _Row, number: int) -> LogFrame | None:
        if row.kind in ("ER", "Error") or row.data[:1] == ["ERROR"]:
            self.error_frames += 1
            return None
        if row.kind == "RR" or row.data[:1] == ["RTR"]:
            self.remote_frames += 1
            return None
        is_fd = row.kind in FD_TYPES
        is_transport = row.length > CLASSIC_LENGTH and len(row.data) >= row.length  # of J1939: no frame
        if not is_fd and (row.kind != "DT" or is_transport):
            self.other_entries += 1
            return None
        data = bytes.fromhex(" ".join(row.data))
        if len(data) != row.length:
            raise ValueError
        switch, state = FD_TYPES.get(row.kind, (False, False))
        return self.frame(
            number,
            self._start + text_nanoseconds(row.time, MILLISECOND_DIGITS),
            int(row.identifier, 16),
            len(row.identifier) > STANDARD_DIGITS,
            data,
            is_fd,
            row.channel,
            switch,
            state,
            row.is_sent,
        )


def _row_1_0(words: list[str]) -> _Row:
    kind = "ST" if words[2] == "FFFFFFFF" else "DT"
    return _Row(words[1], "1", kind, words[2], False, int(words[3]), words[4:])


def _row_1_1(words: list[str]) -> _Row:
    kind = "DT" if words[2] in OLD_DIRECTIONS else words[2]
    return _Row(words[1], "1", kind, words[3], OLD_DIRECTIONS.get(words[2], False), int(words[4]), words[5:])


def _row_1_2(words: list[str]) -> _Row:
    kind = "DT" if words[3] in OLD_DIRECTIONS else words[3]
    return _Row(
        words[1], words[2], kind, words[4], OLD_DIRECTIONS.get(words[3], False), int(words[5]), words[6:]
    )


def _row_1_3(words: list[str]) -> _Row:
    kind = "DT" if words[3] in OLD_DIRECTIONS else words[3]
    return _Row(
        words[1], words[2], kind, words[4], OLD_DIRECTIONS.get(words[3], False), int(words[6]), words[7:]
    )


class TrcWriter(LogWriter):
    """Writer; stamps are rounded to whole microseconds, channels are numbered from 1."""

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._start = start_ns // STAMP_STEP * STAMP_STEP
        self._count = 0
        self._numbers = ChannelNumbers()
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
        time = (frame.stamp_ns + STAMP_STEP // 2) // STAMP_STEP - self._start // STAMP_STEP
        if time < 0:
            raise UserError(str(self.path), "a frame is older than the first ones", "split the log there")
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
