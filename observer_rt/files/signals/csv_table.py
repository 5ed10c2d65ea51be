"""CSV in any dialect, read by pandas a block of lines at a time; also shots, by an ECU, beside a recording."""

import re
import warnings
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.injector_sections import RecordingConfig, TimeConfig
from observer_rt.files.signals.csv_dialect import COMMENT, MISSING, dialect_of, refuse_long, split_line, whole_lines
from observer_rt.files.signals.naming import unit_of
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table import TIME, FileTable, Heading, TablePart
from observer_rt.files.signals.table_signals import TableSignals
from observer_rt.files.signals.time_axis import NO_MOMENT, seconds_since
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.units import MILLISECOND, TIME_UNITS, Floats

ENOUGH = 60  # cells with three digits behind the sign, none of which ends so by chance
_SPELLED = sorted({form(mark) for mark in MISSING for form in (str, str.upper, str.title)} | {"NaN", "-NaN"})
_LONGEST_HEADER = 1 << 20  # characters
_TAIL = 1 << 14  # bytes, in which the last line is
_UNSEEN = "\0\x0b\x0c"  # control characters that pandas passes over
_NUMBER = re.compile(r"[+-]?(?:(?:\d+[.]?\d*|[.]\d+)(?:[eE][+-]?\d+)?|inf(?:inity)?)", re.IGNORECASE)
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:([.,'\u2019\u00a0\u202f ])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")
_UNGROUP = "write the file again without separators of thousands"
_START, _LENGTH = ("start", "beginn", "début", "debut"), ("length", "duration", "dauer", "länge", "durée", "duree")
_HEADED = "write names and units of both above the numbers: start_s,length_us"


class CsvTable(FileTable):
    """Columns by their names, in one line of names; the lines from the first number on."""

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False, may_be_cut: bool = True) -> None:
        """may_be_cut: a last line without a line end is left out."""
        super().__init__(path, config, is_own)
        wanted = self._wanted()
        self.is_text = is_own
        self._dialect = dialect = dialect_of(path, config, is_own)
        self.mapped = {
            name: wanted[name].model_copy(update={"column": dialect.names[place]} if wanted[name].number else None)
            for name, place in dialect.places.items()
        }
        self.layout = dialect.as_text()
        self.columns = dict(zip(dialect.names, dialect.units, strict=True))
        units = {name: dialect.units[place] for name, place in dialect.places.items() if place < len(dialect.units)}
        self.units = {name: unit for name, unit in units.items() if unit}
        self.rasters = (tuple(name for name in self.mapped if name != TIME),)
        has_zeros, ends_too_soon = self._end()
        self._is_cut = may_be_cut and ends_too_soon
        self._calendar = dialect.calendar(dialect.places[TIME], config) if TIME in dialect.places else None
        if self._calendar is not None:
            rows = (cells for _, lines in self._blocks() for cells in self._cells(lines).values())
            stamps = (row[dialect.places[TIME]] for row in rows if len(row) > dialect.places[TIME])
            first = next((stamp for stamp in stamps if stamp.strip().lower() not in MISSING), "")
            self._origin = max(int(self._calendar.nanoseconds([first])[0]), 0)
            self.origin = self._origin / 1e9 if self._calendar.has_date else 0.0
            self.units[TIME] = "s"
            self.layout += f"; {self._calendar.as_text(self._origin)}"
        if self._is_cut:
            self.notes.append(f"{path}: its last line has no line end and is left out: it may be cut short")
        if has_zeros:
            self.notes.append(f"{path}: zeros behind its last row are left out: its size was set before its content")

    @classmethod
    def names(cls, path: Path) -> Collection[str]:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            return [name.strip() for name in file.readline(_LONGEST_HEADER).split(",")]

    @staticmethod
    def headings(path: Path) -> Sequence[Heading]:
        return dialect_of(path, None).headings

    def parts(self, raster: int) -> Iterator[TablePart]:
        row = 0
        for before, lines in self._blocks():
            part = self._part(self._columns(before, lines), row)
            yield part
            row += part.time.size

    def location(self, row: int, raster: int) -> str:
        numbers = (before + number for before, lines in self._blocks() for number in self._cells(lines))
        number = next(islice(numbers, row, None), None)
        return str(self.path) if number is None else f"{self.path}, line {number}"

    def _blocks(self) -> Iterator[tuple[int, list[str]]]:
        before = self._dialect.first_row
        with self.path.open(encoding=self._dialect.encoding, errors="replace") as file:
            deque(islice(file, before), 0)
            rows = whole_lines(file)
            while lines := list(islice(rows, SAMPLES_AT_ONCE)):
                refuse_long(self.path, lines, before)
                if self._is_cut and not lines[-1].endswith("\n"):
                    lines.pop()
                yield before, lines
                before += SAMPLES_AT_ONCE

    def _columns(self, before: int, lines: list[str]) -> dict[str, Floats]:
        table = self._at_once(lines)
        if table is None:
            table = self._one_by_one(before, lines)
        columns = {name: np.asarray(table[place]) for name, place in self._dialect.places.items()}
        if self._calendar is not None:
            columns[TIME] = self._seconds(before, lines, columns[TIME])
        if not self.is_own:
            self._refuse_thousands(before, lines, columns)
        return columns

    def _at_once(self, lines: list[str]) -> Mapping[int, Any] | None:
        """Columns by their places, by pandas; None where a line is not as the others."""
        import pandas  # slow to import

        dialect, text = self._dialect, "".join(lines)
        columns = len(dialect.names)
        counts = {line.count(dialect.separator) for line in lines}
        if counts != {columns - 1} and (self.is_own or dialect.separator != " "):
            behind = f"{dialect.separator} \t\r\n"
            if self.is_own or any(line.rstrip(behind).count(dialect.separator) >= columns for line in lines):
                return None
        if dialect.separator == " " and any(len(line.split()) != columns for line in lines):
            return None
        if any(sign in text for sign in (*_UNSEEN, COMMENT)) or dialect.separator == dialect.decimal:
            return None
        of_time: Any = np.float64 if self._calendar is None else str
        kinds = {place: of_time if name == TIME else np.float64 for name, place in dialect.places.items()}
        try:
            with warnings.catch_warnings(action="ignore"):  # from 3.1 on this is the only precision
                table = pandas.read_csv(
                    StringIO(text),
                    sep=r"\s+" if dialect.separator == " " else dialect.separator,
                    decimal=dialect.decimal,
                    header=None,
                    names=range(columns),
                    usecols=sorted(kinds),
                    index_col=False,
                    dtype=kinds,
                    na_values=_SPELLED,
                    keep_default_na=False,
                    skipinitialspace=True,
                    skip_blank_lines=False,
                    float_precision="round_trip",
                )
        except (ValueError, OverflowError):  # of a cell, or a line
            return None
        return table if len(table) == len(lines) else None

    def _cells(self, lines: Sequence[str]) -> dict[int, list[str]]:
        """Those that hold no row are left out; numbers count from 1."""
        texts = (line.split(COMMENT)[0].strip("\r\n") for line in lines)
        split = {n: split_line(text, self._dialect.separator) for n, text in enumerate(texts, 1) if text.strip()}
        return {number: cells for number, cells in split.items() if cells}

    def _one_by_one(self, before: int, lines: list[str]) -> Mapping[int, Any]:
        """Columns by their places. Raises `UserError` for a line that is no row of numbers."""
        dialect, columns = self._dialect, len(self._dialect.names)
        cells_of: dict[int, list[Any]] = {location: [] for location in dialect.places.values()}
        for number, cells in self._cells(lines).items():
            location = f"{self.path}, line {before + number}"
            if any(cell.strip() for cell in cells[columns:]) or (self.is_own and len(cells) < columns):
                problem = f"{len(cells)} cells, but there are {columns} columns"
                remedy = "mend the line, or delete it if the file was cut while being written"
                raise UserError(location, problem, remedy)
            for at, name in {at: name for name, at in dialect.places.items()}.items():
                cell = cells[at] if at < len(cells) else ""
                if name == TIME and self._calendar is not None:
                    cells_of[at].append(cell)
                else:
                    cells_of[at].append(self._number(cell, f"{location}: {self.label(name)}"))
        return cells_of

    def _number(self, cell: str, location: str) -> float:
        bare, decimal = cell.strip(" \t"), self._dialect.decimal
        if bare.lower() in MISSING:
            return np.nan
        text = bare.translate(str.maketrans(f"{decimal}.", f".{decimal}"))  # so that a point makes no number
        if _NUMBER.fullmatch(text) is None:
            grouped = _GROUPED.fullmatch(bare)
            remedy = _UNGROUP if grouped else "write numbers; leave the cell empty where a value is not available"
            raise UserError(location, f"'{cell}' is not a number with decimal '{decimal}'", remedy)
        return float(text)

    def _seconds(self, before: int, lines: list[str], stamps: Any) -> Floats:
        assert self._calendar is not None
        moments = self._calendar.nanoseconds(stamps)
        for row in np.flatnonzero(moments == NO_MOMENT):
            number, cells = list(self._cells(lines).items())[row]
            cell = cells[self._dialect.places[TIME]] if len(cells) > self._dialect.places[TIME] else ""
            if cell.strip().lower() not in MISSING:
                problem = f"{self.label(TIME)}: '{cell}' is no stamp of the calendar as {self._calendar.form}"
                remedy = "mend the line, or say how stamps are written: [recording.time] format in the bench file"
                raise UserError(f"{self.path}, line {before + number}", problem, remedy)
        return seconds_since(self._origin, moments, not self._calendar.has_date)

    def _refuse_thousands(self, before: int, lines: list[str], columns: Mapping[str, Floats]) -> None:
        """Raise `UserError` for whole numbers with a separator of thousands, which reads as a decimal sign.

        `999` and `1.002` in one column are 999 and 1002, or 999 and 1.002. A writer of decimals leaves out zeros at
        their end in one cell of ten, or writes all three everywhere; and it begins numbers below one with a zero.
        """
        decimal = re.escape(self._dialect.decimal)
        pattern = re.compile(rf"([+-]?[1-9]\d{{0,2}}{decimal}\d{{3}})|[+-]?\d{{1,3}}")
        for name, values in columns.items():
            finite = values[np.isfinite(values)]
            is_whole = finite == np.rint(finite)
            if not is_whole.any() or np.count_nonzero(~is_whole) < ENOUGH or np.abs(finite).max() >= 1e3:
                continue
            rows, at = self._cells(lines), self._dialect.places[name]
            cells = {number: row[at].strip() for number, row in rows.items() if at < len(row)}
            matches = {n: pattern.fullmatch(cell) for n, cell in cells.items() if cell.lower() not in MISSING}
            grouped = [number for number, match in matches.items() if match is not None and match[1]]
            if all(matches.values()) and len(grouped) < len(matches):
                number = grouped[0]
                raise UserError(
                    f"{self.path}, line {before + number}",
                    f"{self.label(name)}: '{cells[number]}' is a whole number with a separator of thousands: every "
                    f"cell with '{self._dialect.decimal}' has three digits behind it, others have none",
                    f"{_UNGROUP}, or with other than three decimals where they are some",
                )

    def _end(self) -> tuple[bool, bool]:
        """Whether zeros follow the last line, and whether it has no line end, so that a number in it may be cut."""
        with self.path.open("rb") as file:
            file.seek(max(0, self.path.stat().st_size - _TAIL))
            tail = file.read()
        has_zeros = tail.endswith(b"\0\0")  # more than of a character of UTF-16
        tail = tail.replace(b"\0", b"").rstrip(b" \t\x1a")  # without those of UTF-16, and Windows' own end
        last = tail.decode("ascii", "replace").rpartition("\n")[2]
        return has_zeros, not last.endswith("\r") and bool(self._cells([last]))


def take_shots(path: Path, stream: TableSignals) -> None:
    """Tell the signals of a recording, by the table beside it, when the injector was energized.

    Raises `UserError` for a recording it cannot serve, unclear headings, and a row that is not the next shot.
    """
    bounds = np.ravel([(part.start, part.start + part.samples / stream.sample_rate) for part in stream.stretches])
    if "energizing" in stream.optional or np.any(np.diff(bounds) < 0.0):
        problem = "is beside a recording that has a column 'energizing', or whose time begins anew"
        raise UserError(str(path), problem, "rename or delete this table or the column; or split the file there")
    with file_errors(path):
        dialect = dialect_of(path, None, fewest=2, remedy=_HEADED)
        timed = {heading: unit for heading in dialect.headings if (unit := unit_of(TIME, heading))}
        named = [[column for column in timed if column.name.lower().startswith(words)] for words in (_START, _LENGTH)]
        if [len(found) for found in named] != [1, 1]:
            problem = f"no start and length with units of time: {', '.join(head.name for head in dialect.headings)}"
            raise UserError(f"{path}, line {dialect.heading}", problem, _HEADED)
        columns = [TimeConfig(column=heading.name) for (heading,) in named]
        layout = dict.fromkeys(("rail_pressure", "line_pressure")) | {TIME: columns[0], "energizing": columns[1]}
        # as in our own layouts every line below the names is a row
        table = CsvTable(path, RecordingConfig.model_construct(None, **layout), is_own=True, may_be_cut=False)
        parts = [(part.time, part.signals["energizing"]) for part in table.parts(0)]
    start, length = np.concatenate(parts, axis=1) * [[TIME_UNITS[timed[heading]]] for (heading,) in named]
    end = start + length
    before = np.concatenate((bounds[:1], end[:-1]))
    is_shot = (start >= before) & (length * stream.sample_rate >= 1.0) & (end <= bounds[-1])
    for row in np.flatnonzero(~is_shot)[:1].tolist():
        problem = f"{start[row]:.6g} to {end[row]:.6g} s is no shot between {before[row]:.6g} and {bounds[-1]:.6g} s"
        remedy = "give start and length, of a sample at least, one after the other, by the time of the recording"
        raise UserError(table.location(row, 0), problem, remedy)
    note = f"{path}: {end.size} shots of {length.min() / MILLISECOND:.4g} to {length.max() / MILLISECOND:.4g} ms"
    stream.edges, stream.optional = np.ravel((start, end), order="F"), (*stream.optional, "energizing")
    stream.notes += (note,)
    stream.details = (*(stream.details or (f"{stream.path}: our own layout",)), note)
