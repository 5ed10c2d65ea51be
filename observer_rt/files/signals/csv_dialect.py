"""Detects the dialect of a CSV file by its first lines: separator, decimal sign, line of names, units."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from observer_rt.config.injector import ColumnConfig, RecordingConfig
from observer_rt.files.signals.naming import is_unit, name_and_unit, signals_named
from observer_rt.files.signals.recording import OPTIONAL
from observer_rt.files.signals.table import TIME, Heading
from observer_rt.files.signals.time_axis import Calendar, calendar_of
from observer_rt.foundation.errors import UserError, hint
from observer_rt.foundation.files import encoding_of

_MARKS = "|nan|-nan|na|n/a|<na>|#n/a|#na|null|none|-|--|---|1.#ind|-1.#ind|1.#qnan|-1.#qnan"
MISSING = frozenset(_MARKS.split("|"))
"""Marks of a missing value, in small letters."""
_LIKE_A_NUMBER = re.compile(  # separators of thousands match, too: the reader refuses them by name
    r"\s*[+-]?(?:\d[\d.,'\u2019\u00a0\u202f]*|[.,]\d+)(?:[eE][+-]?\d+)?\s*"
)
_WORDS = {";": "';'", "\t": "tabulators", ",": "','", "|": "'|'", " ": "blanks"}
_HEAD = 1 << 16  # bytes by which the encoding is detected
_LOOKED_AT = 200  # lines: names and numbers must begin within them
_FEWEST = 3  # columns of numbers that a recording has


@dataclass(frozen=True)
class Dialect:
    """Dialect of one file.

    names, units: of all columns, a unit empty where the file states none; places: numbers of the mapped columns by
    signal; heading: number of the line of names, 0: none; first_row: lines before the first row; rows: first rows.
    """

    encoding: str
    separator: str
    decimal: str
    comment: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    places: Mapping[str, int]
    heading: int
    first_row: int
    rows: tuple[Sequence[str], ...]

    def as_text(self) -> str:
        """Description of the dialect in a few words."""
        named = f"names in line {self.heading}" if self.heading else "without names"
        separator = _WORDS.get(self.separator, f"'{self.separator}'")
        return f"CSV, {named}, separated by {separator}, decimal '{self.decimal}', {self.encoding}"

    def calendar(self, location: int, config: RecordingConfig | None = None) -> Calendar | None:
        """Calendar of the stamps in a column; None: they are numbers."""
        cells = [row[location] for row in self.rows if location < len(row)]
        return calendar_of(None if config is None else config.time, cells)

    @property
    def headings(self) -> list[Heading]:
        """Headings of all columns."""
        return [
            Heading(name if self.heading else "", unit, None, self.calendar(place) is not None)
            for place, (name, unit) in enumerate(zip(self.names, self.units, strict=True))
        ]


@dataclass(frozen=True)
class _Trial:
    """The first lines cut at one separator. heading: line of names, -1: none; fitting: lines of numbers."""

    separator: str
    cells: Sequence[Sequence[str]]
    above: Sequence[Sequence[str]]
    heading: int
    name_count: int
    fitting: Sequence[int]

    @property
    def score(self) -> tuple[int, int, int]:
        """Number of names found, and of numbers below them: the higher, the likelier the separator."""
        numbers = sum(_count(self.cells[number]) for number in self.fitting)
        return self.name_count, numbers, len(self.above[self.heading]) if not numbers else 0


def dialect_of(path: Path, config: RecordingConfig | None, is_own: bool = False) -> Dialect:
    """Dialect of a file that has the columns of a mapping; None: any columns of numbers.

    is_own: the mapping is our own layout. Raises `UserError` if no line has the names, or no numbers follow.
    """
    with path.open("rb") as binary:
        encoding = encoding_of(binary.read(_HEAD))
    with path.open(encoding=encoding, errors="replace") as file:
        lines = [line.rstrip("\r\n") for line in islice(file, _LOOKED_AT)]
    if not any(line.strip() for line in lines):
        raise UserError(
            str(path), "is empty", "give a file with the names of its columns and numbers below them"
        )
    wanted = {} if config is None else dict(config.signals)
    if config is not None and config.time is not None:
        wanted[TIME] = config.time
    comment, stated, decimal = "#", None, None
    if config is not None:
        comment, stated, decimal = config.comment, config.separator, config.decimal
    by_name = config is not None and not config.by_place
    trials = [_trial(lines, each, comment, wanted, by_name) for each in ([stated] if stated else _WORDS)]
    best = max(trials, key=lambda trial: trial.score)
    first, heading = best.fitting[0] if best.fitting else len(lines), best.heading
    rows = tuple(best.cells[number] for number in best.fitting)
    if config is None:
        heading = _likely_heading(best.above[:first], len(rows[0]) if rows else 0)
    if not by_name and not rows:
        listed = ", ".join(str(column.column) for column in wanted.values())
        raise UserError(
            str(path),
            f"none of its first {len(lines)} lines has {f'numbers in columns {listed}' if listed else '3 numbers'}",
            "say in [recording] of a bench file how it is written: the columns, the first is 1, separator, decimal, "
            "and [recording.time] format where the time is that of a calendar",
        )
    names = [f"column {place + 1}" for place in range(max(map(len, rows), default=0))]
    units: Sequence[str] = [""] * len(names)
    if heading >= 0:
        cells = best.above[heading]
        bare, behind = zip(*map(name_and_unit, cells), strict=True)
        names = [name if bare.count(name) == 1 else cell for name, cell in zip(bare, cells, strict=True)]
        units = _units(behind, best.above[heading + 1 : first])
    places: dict[str, int] = {}
    for signal, column in wanted.items():
        if (at := _column_number(column, best.above[heading], f"{path}, line {heading + 1}")) is not None:
            places[signal] = at
        elif not (is_own and signal in OPTIONAL):
            raise _missing(f"{path}, line {heading + 1}", column.name, best.above[heading])
    return Dialect(
        encoding,
        best.separator,
        decimal or _decimal(rows),
        comment,
        tuple(names),
        tuple(units),
        places,
        heading + 1,
        first,
        rows,
    )


def split_line(line: str, separator: str) -> list[str]:
    """Cells of a line without its end."""
    if separator == " ":
        return line.split()
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def _trial(
    lines: Sequence[str], separator: str, comment: str, wanted: Mapping[str, ColumnConfig], by_name: bool
) -> _Trial:
    cells = [split_line(line.split(comment)[0], separator) for line in lines]
    names = [split_line(line.lstrip("\ufeff").lstrip(comment + " "), separator) for line in lines]
    above = [[cell.strip() for cell in row] for row in names]
    heading = name_count = -1
    if by_name:
        counts = [sum(_column_number(column, row) is not None for column in wanted.values()) for row in above]
        name_count = max(counts)
        heading = counts.index(name_count)
    found_at = {name: _column_number(column, above[heading]) for name, column in wanted.items()}
    places = [place for name, place in found_at.items() if place is not None and (by_name or name != TIME)]
    fitting = [n for n, row in enumerate(cells) if n > heading and _fits(row, places, by_name)]
    if separator == " " and by_name:  # between tabs the blank of a date and a time of day separates nothing
        fitting = [n for n in fitting if len(cells[n]) == len(above[heading])]
    return _Trial(separator, cells, above, heading, name_count, fitting)


def _fits(row: Sequence[str], places: Sequence[int], by_name: bool) -> bool:
    """Whether a line has numbers in the right columns; a cell that is no number is named when the line is read."""
    cells = [row[place] for place in places if place < len(row)] if places else row
    if by_name:
        return _count(cells) > 0
    if places:
        values = [cell for cell in cells if cell.strip().lower() not in MISSING]
        return len(cells) == len(places) and 0 < _count(values) == len(values)
    return _count(cells) > max(len(cells) / 2, _FEWEST - 1)


def _column_number(column: ColumnConfig, names: Sequence[str], where: str = "") -> int | None:
    """Number of a column, by its name with or without a unit; where: location of the names in error messages."""
    if isinstance(column.column, int):
        return column.column - 1
    for cells in (list(names), [name_and_unit(name)[0] for name in names]):
        if where and cells.count(column.column) > 1:
            raise UserError(
                where, f"column '{column.column}' appears {cells.count(column.column)} times", "keep one"
            )
        if column.column in cells:
            return cells.index(column.column)
    return None


def _likely_heading(above: Sequence[Sequence[str]], width: int) -> int:
    """The line above the numbers that names most signals, else the last with as many cells as these."""
    counts = [sum(bool(signals_named(cell)) for cell in row) for row in above]
    if max(counts, default=0) > 1:
        return counts.index(max(counts))
    return max((n for n, row in enumerate(above) if len(row) == width and all(row)), default=-1)


def _units(behind: Sequence[str], below: Sequence[Sequence[str]]) -> list[str]:
    """Units behind the names, or of that line between names and numbers that has most of them."""
    bare = [[cell.strip("[]() ") for cell in row] for row in below]
    best = max(bare, key=lambda row: sum(map(is_unit, row)), default=[])
    stated = best if any(map(is_unit, best)) else []
    return [(stated[place] if place < len(stated) else "") or unit for place, unit in enumerate(behind)]


def _missing(location: str, name: str, names: Sequence[str]) -> UserError:
    unnamed = ". A file without names: give places, column = 1, 2, ..." if _count(names) == len(names) else ""
    return UserError(
        location,
        f"column '{name}' is missing{hint(name, names)}",
        f"name the columns in [recording] of the bench file as the file: it has {', '.join(names[:40])}{unnamed}",
    )


def _decimal(rows: Iterable[Sequence[str]]) -> str:
    """A comma where more numbers have one than have a point; of both signs in a number the last one counts."""
    numbers = (
        cell
        for row in rows
        for cell in row
        if ("," in cell or "." in cell) and _LIKE_A_NUMBER.fullmatch(cell)
    )
    signs = Counter(max(".,", key=cell.rfind) for cell in numbers)
    return "," if signs[","] > signs["."] else "."


def _count(row: Sequence[str]) -> int:
    """Number of cells that look like numbers."""
    return sum(_LIKE_A_NUMBER.fullmatch(cell) is not None for cell in row)
