"""CSV in any dialect, a block of lines at a time: by NumPy's reader, line by line where that finds no numbers."""

import re
import warnings
from collections import deque
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np

from observer_rt.config.recording import RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.mapped.dialect import find_dialect, own_dialect
from observer_rt.recording.signals.mapped.header import Calendar, is_missing, is_number
from observer_rt.recording.signals.mapped.table import TIME, Table, TablePart, Values
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE

LONGEST_HEADER = 1 << 20  # characters
_TAIL = 1 << 14  # bytes, in which the last line is
_NOT_AT_ONCE = '"\x1c\x1d\x1e\x1f'  # quotes, and the control characters that numpy takes for blanks
NUMBERS = "write numbers; leave the cell empty where a value is not available"
UNGROUPED = "write numbers without separators of thousands: 1000.153 or 1000,153"
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:([.,' \u00a0\u202f])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")


class CsvTable(Table):
    """Columns by their names, in one line of names; the lines from the first number on."""

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        super().__init__(path, config, is_own)
        wanted = self._wanted()
        self.is_text = is_own
        self._dialect = dialect = (own_dialect if is_own else find_dialect)(path, config, wanted)
        self.mapped = {name: wanted[name] for name in wanted if name in dialect.mapped}
        self.layout = dialect.as_text()
        self.columns = dict(zip(dialect.names, dialect.units, strict=True))
        self.units = {name: unit for name, place in dialect.mapped.items() if (unit := dialect.units[place])}
        self.rasters = (tuple(name for name in self.mapped if name != TIME),)
        self._no_value = _no_value(dialect.separator, dialect.missing)
        self._origin = 0  # ns, of a calendar: its first stamp
        if dialect.calendar is not None:
            self._origin = self._first_stamp(dialect.calendar)
            self.units[TIME] = "s"
            self.layout += f"; {dialect.calendar.as_text(self._origin)}"
        self._is_cut = self._ends_too_soon()
        if self._is_cut:
            self.notes.append(f"{path}: its last line has no line end and is left out: it may be cut short")

    @staticmethod
    def names(path: Path) -> Collection[str]:
        """Of the columns, of a file in our own layout all."""
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            return [name.strip() for name in file.readline(LONGEST_HEADER).split(",")]

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Blocks of rows."""
        calendar, before = self._dialect.calendar, self._dialect.first_row
        with self._opened() as file:
            while lines := list(islice(file, SAMPLES_AT_ONCE)):
                if self._is_cut and not lines[-1].endswith("\n"):
                    lines.pop()
                signals = self._numbers(lines, before)
                time = signals.pop(TIME) if calendar is None else self._stamps(lines, before, calendar)
                yield TablePart(time, signals)
                before += SAMPLES_AT_ONCE

    def place(self, row: int, raster: int) -> str:
        """By its line."""
        with self._opened() as file:
            for number, _ in islice(self._rows(file, self._dialect.first_row), row, None):
                return f"{self.path}, line {number}"
        return str(self.path)

    def _numbers(self, lines: list[str], before: int) -> dict[str, Values]:
        """The columns of numbers in some lines, `before` lines down."""
        places = self._dialect.numbers
        decimal, text = self._dialect.decimal, "".join(lines).rstrip("\n")
        if decimal != ".":
            text = text.translate(
                str.maketrans(f"{decimal}.", f".{decimal}")
            )  # so that a point makes no number
        has_surplus = not self.is_own and self._has_surplus(lines)
        table = None if has_surplus else self._at_once(text)
        if table is None and not has_surplus and self._dialect.separator != " ":
            table = self._at_once(self._no_value.sub(r"\1nan", f"\n{text}\n").strip("\n"))
        if table is not None:
            used = sorted(set(places.values()))
            return {name: np.ascontiguousarray(table[:, used.index(at)]) for name, at in places.items()}
        rows = [self._row(number, cells) for number, cells in self._rows(lines, before)]
        columns = np.array(rows, dtype=np.float64).reshape(len(rows), len(places)).T
        return dict(zip(places, np.ascontiguousarray(columns), strict=True))

    def _has_surplus(self, lines: Iterable[str]) -> bool:
        """Whether a line may have more cells than columns: a separator too many moves all values behind it."""
        separator, columns = self._dialect.separator, len(self._dialect.names)
        if separator == " ":
            return any(len(line.split()) > columns for line in lines)
        return any(line.rstrip(f"{separator} \t\r\n").count(separator) >= columns for line in lines)

    def _at_once(self, text: str) -> Values | None:
        """Numbers (rows, columns) in order of their places; None unless every line is as the others."""
        dialect = self._dialect
        if dialect.separator == dialect.decimal or any(sign in text for sign in _NOT_AT_ONCE):
            return None
        try:
            with warnings.catch_warnings(action="ignore"):  # "no data"
                table = np.loadtxt(
                    text.split("\n"),
                    delimiter=None if dialect.separator == " " else dialect.separator,
                    comments=dialect.comment or None,
                    usecols=None if self.is_own else sorted(set(dialect.numbers.values())),
                    ndmin=2,
                )
        except (ValueError, TypeError):  # of a separator that it will not have
            return None
        return table if table.size and (not self.is_own or table.shape[1] == len(dialect.names)) else None

    def _row(self, number: int, cells: list[str]) -> list[float]:
        """The numbers of a line."""
        place, columns = f"{self.path}, line {number}", len(self._dialect.names)
        if self.is_own and len(cells) != columns:
            raise UserError(
                place,
                f"{len(cells)} cells, but the header has {columns} columns",
                "complete the line, or delete it if the file was cut while being written",
            )
        if any(cell.strip() for cell in cells[columns:]):
            raise UserError(
                place, f"{len(cells)} cells, but there are {columns} columns", "mend the line, or delete it"
            )
        found = []
        for name, at in self._dialect.numbers.items():
            cell, decimal = cells[at] if at < len(cells) else "", self._dialect.decimal
            if cell.strip().lower() in self._dialect.missing:
                found.append(np.nan)
            elif is_missing(cell) or not is_number(cell, decimal):
                raise UserError(
                    place,
                    f"{self.label(name)}: '{cell}' is not a number with decimal '{decimal}'",
                    UNGROUPED if _GROUPED.fullmatch(cell.strip()) else NUMBERS,
                )
            else:
                found.append(float(cell.replace(decimal, ".")))
        return found

    def _stamps(self, lines: list[str], before: int, calendar: Calendar) -> Values:
        """The time [s] by the calendar."""
        at = self._dialect.mapped[TIME]
        rows = [(number, cells[at] if at < len(cells) else "") for number, cells in self._rows(lines, before)]
        time = calendar.seconds([cell for _, cell in rows], self._origin)
        for number, cell in (
            rows[row] for row in np.flatnonzero(np.isnan(time)) if not is_missing(rows[row][1])
        ):
            raise UserError(
                f"{self.path}, line {number}",
                f"{self.label(TIME)}: '{cell}' is no stamp of the calendar as {calendar.form}",
                "mend the line, or say how stamps are written: [recording.time] format in the bench file",
            )
        return time

    def _first_stamp(self, calendar: Calendar) -> int:
        """In ns since 1970."""
        at = self._dialect.mapped[TIME]
        with self._opened() as file:
            cells = (row[at] for _, row in self._rows(file, self._dialect.first_row) if at < len(row))
            return next((int(calendar.nanoseconds([cell])[0]) for cell in cells if not is_missing(cell)), 0)

    def _ends_too_soon(self) -> bool:
        """Whether the last line has no line end: its writer was stopped, and a number in it may be cut."""
        with self.path.open("rb") as file:
            file.seek(max(0, self.path.stat().st_size - _TAIL))
            tail = (
                file.read().replace(b"\0", b"").rstrip(b" \t\x1a")
            )  # of UTF-16, and what Windows ends a file with
        last = tail.decode("ascii", "replace").rpartition("\n")[2]
        return not last.endswith("\r") and bool(self._dialect.cells(last))

    @contextmanager
    def _opened(self) -> Iterator[TextIO]:
        """The file behind the lines that hold no numbers."""
        with self.path.open(encoding=self._dialect.encoding, errors="replace") as file:
            deque(islice(file, self._dialect.first_row), 0)
            yield file

    def _rows(self, lines: Iterable[str], before: int) -> Iterator[tuple[int, list[str]]]:
        """Lines, `before` lines down, by their numbers as cells, without those that hold no row."""
        for number, line in enumerate(lines, before + 1):
            if cells := self._dialect.cells(line):
                yield number, cells


def _no_value(separator: str, missing: Collection[str]) -> re.Pattern[str]:
    """A cell without a value between two separators, or ends of lines."""
    end = rf"[{re.escape(separator)}\n]"
    return re.compile(rf"({end}) *(?:{'|'.join(map(re.escape, missing))}) *(?={end})", re.IGNORECASE)
