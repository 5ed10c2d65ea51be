"""CSV in any dialect, which is found out, a block of lines at a time, by NumPy's reader or line by line."""

import re
import warnings
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np

from observer_rt.config.injector import ColumnConfig, RecordingConfig
from observer_rt.files.signals.column import NANOSECONDS, Column
from observer_rt.files.signals.csv_preview import preview_csv
from observer_rt.files.signals.header import (
    Calendar,
    bare_unit,
    calendar_of,
    header_by_place,
    named_header,
    split_line,
)
from observer_rt.files.signals.number_text import (
    MISSING,
    decimal_of,
    is_missing,
    is_number,
    number_of,
    thousands_of,
    ungrouped,
)
from observer_rt.files.signals.recording import TRUTH_SUFFIX
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table import OPTIONAL, TIME, FileTable, TablePart, Values
from observer_rt.files.signals.text_file import encoding_of, opened_text, tail_of
from observer_rt.files.signals.thousands import first_thousands, may_be_thousandths
from observer_rt.foundation.errors import UserError, hint

DESCRIBED = "a file of another layout is described in [recording] of a bench file, given by --bench"
LOOKED_AT = 200  # lines, among which the names and the first numbers must be
OWN_MISSING = frozenset(("", "nan", "-nan"))
_NAMES = {";": "';'", "\t": "tabulators", ",": "','", "|": "'|'", " ": "blanks"}

LONGEST_HEADER = 1 << 20  # characters
_TAIL = 1 << 14  # bytes, in which the last line is
_NOT_AT_ONCE = '"\x1c\x1d\x1e\x1f'  # quotes, and the control characters that numpy takes for blanks
NUMBERS = "write numbers; leave the cell empty where a value is not available"
_STATED = 'state the separator of thousands in the bench file: [recording] thousands = "{}"'
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:([.,' \u00a0\u202f])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")


@dataclass(frozen=True)
class Dialect:
    """Dialect in which one file is written.

    names, units: of all columns, units as far as the file states them; mapped: places of columns by signal;
    first_row: lines before the first numbers; header_line, unit_line: 1-based, 0: none; calendar: of the time, None:
    it is a number; missing: cells without a value, in lower case; comment: what begins one; thousands: what separates
    them; both empty: nothing does.
    """

    encoding: str
    separator: str
    decimal: str
    comment: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    mapped: Mapping[str, int]
    header_line: int
    unit_line: int
    first_row: int
    calendar: Calendar | None
    missing: frozenset[str] = MISSING
    thousands: str = ""

    def as_text(self) -> str:
        """Description of the dialect in a few words."""
        named = f"names in line {self.header_line}" if self.header_line else "without names"
        units = f", units in line {self.unit_line}" if self.unit_line else ""
        separator = _NAMES.get(self.separator, f"'{self.separator}'")
        thousands = f", thousands '{self.thousands}'" if self.thousands else ""
        signs = f"separated by {separator}, decimal '{self.decimal}'{thousands}"
        return f"CSV, {named}{units}, {signs}, {self.encoding}"

    def cells(self, line: str) -> list[str]:
        """Cells of a line; none of a blank one or a comment."""
        text = (line.split(self.comment)[0] if self.comment else line).strip("\r\n")
        return split_line(text, self.separator) if text.strip() else []

    @property
    def numbers(self) -> dict[str, int]:
        """Places of the mapped columns that hold numbers, not stamps."""
        return {name: place for name, place in self.mapped.items() if name != TIME or self.calendar is None}


def own_dialect(path: Path, config: RecordingConfig, wanted: Mapping[str, ColumnConfig]) -> Dialect:
    """Our own layout: the columns wanted and no others, in any order. Raises `UserError` for another header."""
    if path.name.endswith(TRUTH_SUFFIX):
        raise UserError(
            str(path),
            "is the truth behind a simulated recording, which is not for the observer",
            "leave it out",
        )
    with opened_text(path, "utf-8-sig") as file:
        header = file.readline().strip()
    if not header:
        raise UserError(
            str(path), "is empty, or begins with an empty line", "begin it with the names of the columns"
        )
    known = {column.name: name for name, column in wanted.items()}
    place = f"{path}, line 1"
    expected = f"the header is {','.join(known)} in any order, the last column optional; {DESCRIBED}"
    if ";" in header:
        raise UserError(place, "the columns are separated by ';'", DESCRIBED)
    names = [name.strip() for name in header.split(",")]
    for name in names:
        if name not in known:
            raise UserError(place, f"unknown column '{name}'{hint(name, known)}", expected)
        if names.count(name) > 1:
            raise UserError(place, f"column '{name}' appears {names.count(name)} times", expected)
    for column, name in known.items():
        if column not in names and name != OPTIONAL:
            raise UserError(place, f"column '{column}' is missing", expected)
    mapped = {known[name]: at for at, name in enumerate(names)}
    no_units = ("",) * len(names)
    return Dialect("utf-8-sig", ",", ".", "", tuple(names), no_units, mapped, 1, 0, 1, None, OWN_MISSING)


def find_dialect(path: Path, config: RecordingConfig, wanted: Mapping[str, ColumnConfig]) -> Dialect:
    """Dialect of a file with the columns `wanted`, by signal. Raises `UserError` if it lacks one."""
    encoding = encoding_of(path)
    with opened_text(path, encoding) as file:
        lines = [line.rstrip("\r\n") for line in islice(file, LOOKED_AT)]
    if not any(line.strip() for line in lines):
        raise UserError(
            str(path), "is empty", "give a file with the names of its columns and numbers below them"
        )
    by_place = config.by_place
    header = (
        header_by_place(path, lines, config)
        if by_place
        else named_header(path, lines, config, {name: column.name for name, column in wanted.items()})
    )
    below = [
        (number, split_line(text, header.separator))
        for number, line in enumerate(lines[header.begin :], header.begin)
        if (text := line.split(config.comment)[0]).strip()
    ]
    calendar = None
    if config.time is not None:
        times = [row[header.mapped[TIME]] for _, row in below if len(row) > header.mapped[TIME]]
        calendar = calendar_of(config.time, times)
    numbers = {name: place for name, place in header.mapped.items() if name != TIME or calendar is None}
    rows = [row for _, row in below]
    decimal = config.decimal or _beside(config.thousands) or decimal_of(rows, list(numbers.values()))
    shown = (row[place] for row in rows for place in numbers.values() if place < len(row))
    thousands = config.thousands or thousands_of(shown, decimal)
    units, unit_line, first = header.units, 0, header.begin
    for number, row in below:
        mine = [row[place] for place in numbers.values() if place < len(row)]
        if mine and all(is_number(cell, decimal, thousands) for cell in mine):
            first = number
            break
        if not unit_line and not any(is_number(cell, decimal, thousands) and cell.strip() for cell in mine):
            unit_line = number + 1
            units = tuple(
                bare_unit(row[i]) if i < len(row) and row[i].strip() else unit for i, unit in enumerate(units)
            )
        elif any(is_number(cell, decimal, thousands) and cell.strip() for cell in mine):
            first = number  # a row of numbers with something wrong in it, which its reader names
            break
    else:
        first = min(len(lines), below[-1][0] + 1) if below else header.begin
    return Dialect(
        encoding,
        header.separator,
        decimal,
        config.comment,
        header.names,
        units,
        header.mapped,
        0 if by_place else header.begin,
        unit_line,
        first,
        calendar,
        thousands=thousands,
    )


def _beside(thousands: str | None) -> str | None:
    """Decimal sign beside a stated sign of thousands, where that leaves one."""
    return {".": ",", ",": "."}.get(thousands or "")


class CsvTable(FileTable):
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
            self.origin = self._origin / NANOSECONDS
            self.units[TIME] = "s"
            self.layout += f"; {dialect.calendar.as_text(self._origin)}"
        self._is_cut = self._ends_too_soon()
        if self._is_cut:
            self.notes.append(f"{path}: its last line has no line end and is left out: it may be cut short")

    @staticmethod
    def names(path: Path) -> Collection[str]:
        """Names of the columns, of a file in our own layout all."""
        with opened_text(path, "utf-8-sig") as file:
            return [name.strip() for name in file.readline(LONGEST_HEADER).split(",")]

    @staticmethod
    def preview(path: Path, most: int) -> Sequence[Column]:
        """Columns of the first lines."""
        return preview_csv(path, most)

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Blocks of rows."""
        calendar, before, row = self._dialect.calendar, self._dialect.first_row, 0
        with self._opened() as file:
            while lines := list(islice(file, SAMPLES_AT_ONCE)):
                if self._is_cut and not lines[-1].endswith("\n"):
                    lines.pop()
                columns = self._numbers(lines, before)
                if calendar is not None:
                    columns[TIME] = self._stamps(lines, before, calendar)
                part = self._part(columns, row)
                yield part
                before, row = before + SAMPLES_AT_ONCE, row + part.time.size

    def place(self, row: int, raster: int) -> str:
        """Place of a row in the file: its line."""
        with self._opened() as file:
            for number, _ in islice(self._rows(file, self._dialect.first_row), row, None):
                return f"{self.path}, line {number}"
        return str(self.path)

    def _numbers(self, lines: list[str], before: int) -> dict[str, Values]:
        """The columns of numbers in some lines, `before` lines down."""
        places = self._dialect.numbers
        decimal, thousands, text = self._dialect.decimal, self._dialect.thousands, "".join(lines).rstrip("\n")
        if thousands != self._dialect.separator:
            text = ungrouped(text, thousands)
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
            found = {name: np.ascontiguousarray(table[:, used.index(at)]) for name, at in places.items()}
        else:
            rows = [self._row(number, cells) for number, cells in self._rows(lines, before)]
            columns = np.array(rows, dtype=np.float64).reshape(len(rows), len(places)).T
            found = dict(zip(places, np.ascontiguousarray(columns), strict=True))
        if not self.is_own:
            self._refuse_thousands(found, lines, before)
        return found

    def _refuse_thousands(self, found: Mapping[str, Values], lines: list[str], before: int) -> None:
        """Raise `UserError` for whole numbers with a separator of thousands, which reads as a decimal sign."""
        rows: list[tuple[int, list[str]]] = []
        for name, values in found.items():
            if not may_be_thousandths(values):
                continue
            rows = rows or list(self._rows(lines, before))
            at = self._dialect.numbers[name]
            cells = [row[at].strip() if at < len(row) else "" for _, row in rows]
            grouped = first_thousands(cells, self._dialect.decimal)
            if grouped is not None:
                raise UserError(
                    f"{self.path}, line {rows[grouped][0]}",
                    f"{self.label(name)}: '{cells[grouped]}' is a whole number with a separator of thousands: "
                    f"every cell with '{self._dialect.decimal}' has three digits behind it, others have none",
                    f"where they are decimals, round them otherwise; else {_STATED.format(self._dialect.decimal)}",
                )

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
                continue
            try:
                found.append(number_of(cell, decimal, self._dialect.thousands or (None, "")[self.is_own]))
            except ValueError:
                grouped = _GROUPED.fullmatch(cell.strip())
                raise UserError(
                    place,
                    f"{self.label(name)}: '{cell}' is not a number with decimal '{decimal}'",
                    _STATED.format(grouped[1]) if grouped and not self.is_own else NUMBERS,
                ) from None
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
        """Time of the first stamp in ns since 1970."""
        at = self._dialect.mapped[TIME]
        with self._opened() as file:
            cells = (row[at] for _, row in self._rows(file, self._dialect.first_row) if at < len(row))
            return next((int(calendar.nanoseconds([cell])[0]) for cell in cells if not is_missing(cell)), 0)

    def _ends_too_soon(self) -> bool:
        """Whether the last line has no line end: its writer was stopped, and a number in it may be cut."""
        # without those of UTF-16, and what Windows ends a file with
        tail = tail_of(self.path, _TAIL).replace(b"\0", b"").rstrip(b" \t\x1a")
        last = tail.decode("ascii", "replace").rpartition("\n")[2]
        return not last.endswith("\r") and bool(self._dialect.cells(last))

    @contextmanager
    def _opened(self) -> Iterator[TextIO]:
        """The file behind the lines that hold no numbers."""
        with opened_text(self.path, self._dialect.encoding) as file:
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
