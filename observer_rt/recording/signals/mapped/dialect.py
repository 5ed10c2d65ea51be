"""How a CSV file is written: encoding, separator, decimal sign, calendar, where names, units and numbers stand."""

import codecs
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from observer_rt.config.recording import ColumnConfig, RecordingConfig
from observer_rt.foundation.errors import UserError, hint
from observer_rt.recording.signals.mapped.header import (
    MISSING,
    Calendar,
    bare_unit,
    calendar_of,
    decimal_of,
    header_by_place,
    is_number,
    named_header,
    split_line,
)
from observer_rt.recording.signals.mapped.table import OPTIONAL, TIME
from observer_rt.recording.signals.recording import TRUTH_SUFFIX

DESCRIBED = "a file of another layout is described in [recording] of a bench file, given by --bench"
LOOKED_AT = 200  # lines, among which the names and the first numbers must be
OWN_MISSING = frozenset(("", "nan", "-nan"))
_NAMES = {";": "';'", "\t": "tabulators", ",": "','", "|": "'|'", " ": "blanks"}


@dataclass(frozen=True)
class Dialect:
    """How one file is written.

    names, units: of all columns, units as far as the file says them; mapped: places of columns by signal;
    first_row: lines before the first numbers; header_line, unit_line: 1-based, 0: none; calendar: of the time, None:
    it is a number; missing: cells without a value, in lower case; comment: what begins one, empty: nothing does.
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

    def as_text(self) -> str:
        """In a few words."""
        named = f"names in line {self.header_line}" if self.header_line else "without names"
        units = f", units in line {self.unit_line}" if self.unit_line else ""
        separator = _NAMES.get(self.separator, f"'{self.separator}'")
        return f"CSV, {named}{units}, separated by {separator}, decimal '{self.decimal}', {self.encoding}"

    def cells(self, line: str) -> list[str]:
        """Of a line; none of a blank one or a comment."""
        text = (line.split(self.comment)[0] if self.comment else line).strip("\r\n")
        return split_line(text, self.separator) if text.strip() else []

    @property
    def numbers(self) -> dict[str, int]:
        """Places of the mapped columns that hold numbers, not stamps."""
        return {name: place for name, place in self.mapped.items() if name != TIME or self.calendar is None}


def encoding_of(path: Path) -> str:
    """By its byte order mark, else UTF-8 unless it is none."""
    with path.open("rb") as file:
        begin = file.read(1 << 16)
    if begin.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8-sig")().decode(begin)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def own_dialect(path: Path, config: RecordingConfig, wanted: Mapping[str, ColumnConfig]) -> Dialect:
    """Our own layout: the columns wanted and no others, in any order. Raises `UserError` for another header."""
    if path.name.endswith(TRUTH_SUFFIX):
        raise UserError(
            str(path),
            "is the truth behind a simulated recording, which is not for the observer",
            "leave it out",
        )
    with path.open(encoding="utf-8-sig", errors="replace") as file:
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
    """How a file with the columns `wanted`, by signal, is written. Raises `UserError` if it lacks one."""
    encoding = encoding_of(path)
    with path.open(encoding=encoding, errors="replace", newline="") as file:
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
    times = [row[header.mapped[TIME]] for _, row in below if len(row) > header.mapped[TIME]]
    calendar = calendar_of(config.time, times) if config.time is not None else None
    numbers = {name: place for name, place in header.mapped.items() if name != TIME or calendar is None}
    decimal = config.decimal or decimal_of([row for _, row in below], list(numbers.values()))
    units, unit_line, first = header.units, 0, header.begin
    for number, row in below:
        mine = [row[place] for place in numbers.values() if place < len(row)]
        if mine and all(is_number(cell, decimal) for cell in mine):
            first = number
            break
        if not unit_line and not any(is_number(cell, decimal) and cell.strip() for cell in mine):
            unit_line = number + 1
            units = tuple(
                bare_unit(row[i]) if i < len(row) and row[i].strip() else unit for i, unit in enumerate(units)
            )
        elif any(is_number(cell, decimal) and cell.strip() for cell in mine):
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
    )
