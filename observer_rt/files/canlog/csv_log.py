"""Logs of other programs as `.csv`, known by their first line: of SavvyCAN, of CSS Electronics and of python-can."""

import base64
import re
from collections.abc import Iterator
from pathlib import Path

from observer_rt.bus.can_frame import CLASSIC_LENGTH
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFormat, LogFrame, text_nanoseconds
from observer_rt.files.canlog.text_log import EARLIEST_DATE, TextLogReader, head_of

_ROLES = {  # by what the programs call their columns; `D1` begins those of single bytes
    "Time Stamp": "microseconds",
    **dict.fromkeys(("TimestampEpoch", "timestamp"), "seconds"),
    **dict.fromkeys(("ID", "arbitration_id"), "id"),
    **dict.fromkeys(("Extended", "IDE", "extended"), "is_extended"),
    **dict.fromkeys(("Bus", "BusChannel"), "channel"),
    **dict.fromkeys(("LEN", "DataLength", "dlc"), "length"),
    **dict.fromkeys(("RTR", "remote"), "is_remote"),
    **{"Dir": "is_sent", "EDL": "is_fd", "BRS": "bit_rate_switch", "ESI": "error_state", "error": "is_error"},
    **{"D1": "bytes", "DataBytes": "hexadecimal", "data": "base64"},
}
_OTHER = re.compile(r"D\d+|DLC|")  # columns that are not needed
_NEEDED = (  # one of each
    ("seconds", "microseconds"),
    ("id",),
    ("is_extended",),
    ("length",),
    ("bytes", "hexadecimal", "base64"),
)
_FLAGS = {"0": False, "1": True, "false": False, "true": True, "rx": False, "tx": True}
MICROSECOND_DIGITS = 3  # ns in one, as a power of ten


class CsvLog(TextLogReader):
    """Reader; channels are named by their number."""

    kind = "a CSV log"
    remedy = "logs of SavvyCAN, CSS Electronics and python-can are known by the names in their first line"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._at: dict[str, int] = {}
        self._separator = ","
        self._is_dated = True
        return super()._entries()

    def _entry(self, text: str, number: int) -> LogFrame | None:
        if not self._at:
            self._separator, self._at = columns_of(text)
            if not self._at:
                raise ValueError
            unknown = [
                name
                for name in _names(text, self._separator)
                if name not in _ROLES and not _OTHER.fullmatch(name)
            ]
            if unknown:
                self.remarks.append(f"its columns {', '.join(unknown)} are not known and left out")
            return None
        if "_" in text:  # which Python takes between digits
            raise ValueError
        cells = [cell.strip() for cell in text.split(self._separator)]
        if self._flag(cells, "is_error"):
            self.error_frames += 1
            return None
        if self._flag(cells, "is_remote"):
            self.remote_frames += 1
            return None
        length, payload = int(cells[self._at["length"]]), self._payload(cells)
        if len(payload) != length:
            self.refuse(number, f"{len(payload)} bytes follow the length {length}")
        frame = Frame(
            int(cells[self._at["id"]], 16),
            payload,
            self._stamp(cells),
            self._flag(cells, "is_extended"),
            self._flag(cells, "is_fd") or length > CLASSIC_LENGTH,
            self._flag(cells, "bit_rate_switch"),
            self._flag(cells, "error_state"),
        )
        channel = str(int(cells[self._at["channel"]])) if "channel" in self._at else "1"
        return LogFrame(frame, channel, self._flag(cells, "is_sent"))

    def _flag(self, cells: list[str], name: str) -> bool:
        if name not in self._at:
            return False
        flag = _FLAGS.get(cells[self._at[name]].lower())
        if flag is None:
            raise ValueError
        return flag

    def _stamp(self, cells: list[str]) -> int:
        if "microseconds" in self._at:
            stamp = text_nanoseconds(cells[self._at["microseconds"]], MICROSECOND_DIGITS)
        else:
            text = cells[self._at["seconds"]]
            stamp = text_nanoseconds(
                f"{float(text):.9f}" if "e" in text else text
            )  # python-can's small numbers
        if stamp < EARLIEST_DATE and self._is_dated:
            self._is_dated = False
            self.remarks.append("its times are taken to count from its start")
        return stamp

    def _payload(self, cells: list[str]) -> bytes:
        if "bytes" in self._at:  # filled up with zeros
            first = self._at["bytes"]
            words = cells[first : first + int(cells[self._at["length"]])]
            if "" in words:
                raise ValueError
            return bytes.fromhex("".join(word.zfill(2) for word in words))
        if "base64" in self._at:
            return base64.b64decode(cells[self._at["base64"]], validate=True)
        return bytes.fromhex(cells[self._at["hexadecimal"]])


def columns_of(heading: str) -> tuple[str, dict[str, int]]:
    """Separator and places of the columns that a first line names, by role; empty unless it is one of such a log."""
    separator = ";" if ";" in heading else ","
    names = enumerate(_names(heading, separator))
    found = {_ROLES[name]: place for place, name in names if name in _ROLES}
    is_whole = all(not found.keys().isdisjoint(roles) for roles in _NEEDED)
    return separator, found if is_whole else {}


def _names(heading: str, separator: str) -> list[str]:
    return [name.strip() for name in heading.split(separator)]


def is_csv_log(path: Path) -> bool:
    """Whether a file begins with the names of the columns of such a log."""
    lines = head_of(path).decode("utf-8", "replace").splitlines() if path.is_file() else []
    return bool(lines and columns_of(lines[0])[1])


CSV_LOG = LogFormat(
    (".csv",),
    "of SavvyCAN, CSS Electronics or python-can, text",
    CsvLog,
    is_text=True,
    recognises=is_csv_log,
)
