"""Detects the dialect of a CSV file by its first lines: separator, decimal sign, line of names, units."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple, TextIO

from observer_rt.config.injector_sections import ColumnConfig, RecordingConfig
from observer_rt.files.signals.naming import is_unit, name_and_unit, signals_named
from observer_rt.files.signals.recording import is_needed
from observer_rt.files.signals.table import TIME, Heading, missing_column
from observer_rt.files.signals.time_axis import Calendar, calendar_of
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import encoding_of

_MARKS = "|nan|-nan|na|n/a|<na>|#n/a|#na|null|none|-|--|---|1.#ind|-1.#ind|1.#qnan|-1.#qnan"
MISSING = frozenset(_MARKS.split("|"))
"""Marks of a missing value, in small letters."""
COMMENT = "#"  # what follows it in a line is passed over
_LIKE_A_NUMBER = re.compile(  # separators of thousands match, too: the reader refuses them by name
    r"\s*[+-]?(?:\d[\d.,'\u2019\u00a0\u202f]*|[.,]\d+)(?:[eE][+-]?\d+)?\s*"
)
_WORDS = {";": "';'", "\t": "tabulators", ",": "','", "|": "'|'", " ": "blanks"}
_HEAD = 1 << 16  # bytes by which the encoding is detected
_LOOKED_AT = 200  # lines: names and numbers must begin within them
LONGEST_LINE = 1 << 18  # characters: some 20,000 columns
_FEWEST = 3  # columns of numbers that a recording has
_REMEDY = (
    "write the names of its columns in a line above the numbers, which may begin with #; or state in a bench file, "
    "given by --bench, which is which by their numbers: [recording.rail_pressure] column = 2, and so on"
)
_BEFORE_NAMES = re.compile(rf"^\ufeff? *(?:{COMMENT}[{COMMENT}\s]*)?")
_UNIT_APART = re.compile(r"(?<=\w)\s+(?=[\[(])")
NAME_WITH_UNIT = re.compile(r"[^\s\[\]()][^\[\]()]*(?:\[[^\[\]]*\]|\([^()]*\))")
_ROW_BRACKETS = "(); \t"


class Dialect(NamedTuple):
    """Dialect of one file; names, units: of all columns; places: of mapped columns by signal; rows: the first ones.

    heading: number of the line of names, 0 without one; first_row: lines before the first row.
    """

    encoding: str
    separator: str
    decimal: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    places: Mapping[str, int]
    heading: int
    first_row: int
    rows: tuple[Sequence[str], ...]

    def as_text(self) -> str:
        """Description of the dialect in a few words."""
        separator = _WORDS.get(self.separator, f"'{self.separator}'")
        named = f"CSV, names in line {self.heading}" if self.heading else "CSV without names"
        return f"{named}, separated by {separator}, decimal '{self.decimal}', {self.encoding}"

    def calendar(self, location: int, config: RecordingConfig | None = None) -> Calendar | None:
        """Calendar of the stamps in a column; None: they are numbers."""
        cells = [row[location] for row in self.rows if location < len(row)]
        return calendar_of(None if config is None else config.time, cells)

    @property
    def headings(self) -> list[Heading]:
        """Headings of all columns."""
        return [
            Heading(name, unit, None, self.calendar(place) is not None)
            for place, (name, unit) in enumerate(zip(self.names, self.units, strict=True))
        ]


class _Trial(NamedTuple):
    """The first lines cut at one separator. heading: line of the wanted names; fitting: lines of numbers below."""

    separator: str
    cells: Sequence[Sequence[str]]
    above: Sequence[Sequence[str]]
    heading: int
    name_count: int
    fitting: Sequence[int]

    @property
    def score(self) -> tuple[int, int, int]:
        """Number of names found, and of numbers below them: the higher, the likelier the separator."""
        numbers = sum(_number_count(self.cells[number]) for number in self.fitting)
        return self.name_count, numbers, len(self.above[self.heading]) if not numbers else 0


def dialect_of(
    path: Path, config: RecordingConfig | None, is_own: bool = False, fewest: int = _FEWEST, remedy: str = _REMEDY
) -> Dialect:
    """Dialect of a file that has the columns of a mapping; None: any `fewest` columns of numbers.

    is_own: our own layout; remedy: for a file without names. Raises `UserError` if names or numbers are missing.
    """
    with path.open("rb") as binary:
        encoding = encoding_of(binary.read(_HEAD))
    with path.open(encoding=encoding, errors="replace") as file:
        lines = list(islice(whole_lines(file), _LOOKED_AT))
    refuse_long(path, lines, 0)
    lines = [line.rstrip("\r\n") for line in lines]
    if not any(line.strip() for line in lines):
        raise UserError(str(path), "is empty", remedy)
    wanted: dict[str, ColumnConfig] = {}
    stated = decimal = None
    if config is not None:
        wanted |= dict(config.signals) | ({} if config.time is None else {TIME: config.time})
        stated, decimal = config.separator, config.decimal
    trials = [_trial(lines, separator, wanted, fewest) for separator in ([stated] if stated else _WORDS)]
    best = max(trials, key=lambda trial: trial.score)
    first = best.fitting[0] if best.fitting else len(lines)
    rows = tuple(best.cells[number] for number in best.fitting)
    heading = best.heading
    if heading < 0:
        heading = _likely_heading(best.above[:first], width := len(rows[0]) if rows else 0)
        if wanted and len(best.above[heading]) != width:  # a title that speaks of a signal
            heading = -1
    if best.heading < 0 and (not rows or (heading < 0 and not wanted)):
        missing = "names above its numbers" if rows else f"{len(wanted) or fewest} numbers in a line"
        raise UserError(str(path), f"has no {missing} in its first {len(lines)} lines", remedy)
    cells = best.above[heading] if heading >= 0 else [f"#{number}" for number in range(1, len(rows[0]) + 1)]
    bare, behind = zip(*map(name_and_unit, cells), strict=True)
    counts = Counter(bare)
    names = [name if counts[name] == 1 else cell for name, cell in zip(bare, cells, strict=True)]
    places: dict[str, int] = {}
    has_energizing = "energizing" in wanted and wanted["energizing"].column in names
    for signal, column in wanted.items():
        if (at := _column_number(column, cells, f"{path}, line {max(heading, 0) + 1}")) is not None:
            places[signal] = at
        elif not is_own or is_needed(signal, has_energizing):
            raise missing_column(f"{path}, line {max(heading, 0) + 1}", column, cells)
    return Dialect(
        encoding,
        best.separator,
        decimal or _decimal(rows),
        tuple(names),
        tuple(_units(behind, best.above[heading + 1 : first])),
        places,
        heading + 1,
        heading + 1 if is_own else first,  # nothing stands between in our own layout
        rows,
    )


def whole_lines(file: TextIO) -> Iterator[str]:
    """Lines of a text, without the zeros behind the last one of a file whose size was set before."""
    while line := file.readline(LONGEST_LINE + 1):
        if not line.endswith("\0"):
            yield line


def refuse_long(path: Path, lines: Sequence[str], before: int) -> None:
    """Raise `UserError` for a line that is no row of a table; before: lines before these."""
    for number, line in enumerate(lines, before + 1):
        if len(line) > LONGEST_LINE:
            problem = f"has more than {LONGEST_LINE} characters: no measurement has a row so long"
            raise UserError(f"{path}, line {number}", problem, "export it anew, one row a line, only what is needed")


def split_line(line: str, separator: str) -> list[str]:
    """Cells of a line without its end."""
    if separator == " ":  # rows may be in brackets, as OpenFOAM writes them
        return (line.strip(_ROW_BRACKETS) if line.lstrip().startswith(("(", ")")) else line).split()
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def _trial(lines: Sequence[str], separator: str, wanted: Mapping[str, ColumnConfig], fewest: int) -> _Trial:
    cells = [split_line(line.split(COMMENT)[0], separator) for line in lines]
    titles = [_BEFORE_NAMES.sub("", line) for line in lines]
    above = [[cell.strip() for cell in split_line(title, separator)] for title in titles]
    if separator == " ":  # a unit in brackets ends the name before it, which may have several words
        width = len(max(cells, key=_number_count))
        named = [(split_line(_UNIT_APART.sub("", title), " "), NAME_WITH_UNIT.findall(title)) for title in titles]
        above = [units if len(words) != width == len(units) else words for words, units in named]
    counts = [sum(_column_number(column, row) is not None for column in wanted.values()) for row in above]
    name_count = max(counts)
    is_named = any(column.number is None for column in wanted.values())
    heading = counts.index(name_count) if is_named else -1
    widest = max(above, key=len) if heading < 0 else above[heading]
    places = [place for place in [_column_number(column, widest) for column in wanted.values()] if place is not None]
    fewest = 1 if is_named else len(wanted) or fewest
    fitting = []
    for number, row in enumerate(cells[heading + 1 :], heading + 1):
        mapped = [row[place] for place in places if place < len(row)] if places else row
        # between tabs the blank of a date and a time of day separates nothing
        is_apart = separator != " " or not is_named or len(row) == len(above[heading])
        # a cell that is no number is named when the line is read
        if is_apart and _number_count(mapped) >= fewest and (wanted or 2 * _number_count(row) > len(row)):
            fitting.append(number)
    return _Trial(separator, cells, above, heading, name_count, fitting)


def _column_number(column: ColumnConfig, names: Sequence[str], where: str = "") -> int | None:
    """Place of a column, by its number, or its name with or without a unit; where: location of names in messages."""
    if column.number is not None:
        return column.number - 1 if 0 < column.number <= len(names) else None
    for cells in (list(names), [name_and_unit(name)[0] for name in names]):
        if where and cells.count(column.column) > 1:
            raise UserError(where, f"column '{column.column}' appears {cells.count(column.column)} times", "keep one")
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


def _decimal(rows: Iterable[Sequence[str]]) -> str:
    """A comma where more numbers have one than have a point; of both signs in a number the last one counts."""
    cells = (cell for row in rows for cell in row if _LIKE_A_NUMBER.fullmatch(cell))
    signs = Counter(max(".,", key=cell.rfind) for cell in cells if "," in cell or "." in cell)
    return "," if signs[","] > signs["."] else "."


def _number_count(row: Sequence[str]) -> int:
    return sum(_LIKE_A_NUMBER.fullmatch(cell) is not None for cell in row)
