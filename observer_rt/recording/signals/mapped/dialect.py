"""How a CSV file is written: encoding, separator, decimal sign, where names, units and numbers stand."""

import codecs
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint

LOOKED_AT = 200  # lines, among which the names and the first numbers must be
SEPARATORS = (";", "\t", ",", "|", " ")
MISSING = frozenset(("", "nan", "-nan", "na", "n/a", "null", "none", "-", "--", "---"))  # in lower case
_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))$")
_NAMES = {";": "';'", "\t": "tabulators", ",": "','", "|": "'|'", " ": "blanks"}


@dataclass(frozen=True)
class Dialect:
    """How one file is written.

    names, units: of all columns, units as far as the file says them; mapped: places of columns by signal;
    first_row: lines before the first numbers; unit_line: 1-based, 0: none.
    """

    encoding: str
    separator: str
    decimal: str
    comment: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    mapped: dict[str, int]
    header_line: int
    unit_line: int
    first_row: int

    def as_text(self) -> str:
        """In a few words."""
        units = f", units in line {self.unit_line}" if self.unit_line else ""
        separator = _NAMES.get(self.separator, f"'{self.separator}'")
        return (
            f"CSV, names in line {self.header_line}{units}, separated by {separator}, "
            f"decimal '{self.decimal}', {self.encoding}"
        )

    def cells(self, line: str) -> list[str]:
        """Of a line; none of a blank one or a comment."""
        text = line.split(self.comment)[0].strip("\r\n")
        return _split(text, self.separator) if text.strip() else []

    def is_number(self, cell: str) -> bool:
        """Whether a cell is a number, or empty."""
        return is_number(cell, self.decimal)


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with this decimal sign, or one of the ways to say that there is none."""
    text = cell.strip()
    if text.lower() in MISSING:
        return True
    if decimal != "." and "." in text:
        return False
    try:
        float(text.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in text


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


def find_dialect(path: Path, config: RecordingConfig, wanted: dict[str, str]) -> Dialect:
    """How a file with the columns `wanted`, names by signal, is written. Raises `UserError` if it lacks one."""
    encoding = encoding_of(path)
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        lines = [line.rstrip("\r\n") for line in islice(file, LOOKED_AT)]
    if not any(line.strip() for line in lines):
        raise UserError(
            str(path), "is empty", "give a file with the names of its columns and numbers below them"
        )
    separator, header = _header(path, lines, config, list(wanted.values()))
    cells = _named(lines[header], separator, config.comment)
    names, units = zip(*map(_name_and_unit, cells), strict=True)
    mapped = {
        signal: _place(name, cells, names, f"{path}, line {header + 1}") for signal, name in wanted.items()
    }
    below = [
        (number, _split(line.split(config.comment)[0], separator))
        for number, line in enumerate(lines[header + 1 :], header + 1)
        if line.split(config.comment)[0].strip()
    ]
    decimal = config.decimal or _decimal([row for _, row in below], list(mapped.values()))
    unit_line = first = 0
    for number, row in below:
        mine = [row[place] for place in mapped.values() if place < len(row)]
        if mine and all(is_number(cell, decimal) for cell in mine):
            first = number
            break
        if not unit_line and not any(is_number(cell, decimal) and cell.strip() for cell in mine):
            unit_line = number + 1
            units = tuple(
                _bare(row[i]) if i < len(row) and row[i].strip() else unit for i, unit in enumerate(units)
            )
        elif any(is_number(cell, decimal) and cell.strip() for cell in mine):
            first = number  # a row of numbers with something wrong in it, which its reader names
            break
    else:
        first = min(len(lines), below[-1][0] + 1) if below else header + 1
    return Dialect(
        encoding,
        separator,
        decimal,
        config.comment,
        tuple(names),
        tuple(units),
        mapped,
        header + 1,
        unit_line,
        first,
    )


def _header(
    path: Path, lines: Sequence[str], config: RecordingConfig, wanted: Sequence[str]
) -> tuple[str, int]:
    """Separator and number of the line that has all names, or an error of the one that has most."""
    best: tuple[int, int, list[str]] = (-1, 0, [])
    for separator in [config.separator] if config.separator else SEPARATORS:
        for number, line in enumerate(lines):
            cells = _named(line, separator, config.comment)
            there = {*cells, *(_name_and_unit(cell)[0] for cell in cells)}
            found = sum(name in there for name in wanted)
            if found == len(wanted):
                return separator, number
            if (found, len(cells) > 1) > (best[0], len(best[2]) > 1):
                best = found, number, cells
    _, number, cells = best
    known = [*cells, *(_name_and_unit(cell)[0] for cell in cells)]
    missing = next(name for name in wanted if name not in known)
    raise UserError(
        f"{path}, line {number + 1}",
        f"column '{missing}' is missing{hint(missing, cells)}",
        f"name the columns in [recording] of the bench file as the file does: it has {', '.join(cells[:40])}",
    )


def _named(line: str, separator: str, comment: str) -> list[str]:
    """Cells of a line of names, which may stand in a comment."""
    return [
        cell.strip() for cell in _split(line.strip("\r\n").lstrip("\ufeff").lstrip(comment + " "), separator)
    ]


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def _name_and_unit(cell: str) -> tuple[str, str]:
    """`p_Rail [bar]` as both."""
    found = _UNIT.match(cell)
    if found is None or not found["name"]:
        return cell, ""
    return found["name"], (found["square"] if found["square"] is not None else found["round"]).strip()


def _bare(unit: str) -> str:
    """A unit as it is said in a row of units."""
    return unit.strip().strip("[]()").strip()


def _place(name: str, cells: Sequence[str], names: Sequence[str], place: str) -> int:
    among = cells if name in cells else names
    if list(among).count(name) > 1:
        raise UserError(
            place, f"column '{name}' appears {list(among).count(name)} times", "keep one of this name"
        )
    return list(among).index(name)


def _decimal(rows: Sequence[Sequence[str]], places: Sequence[int]) -> str:
    """A comma where more numbers have commas than points."""
    cells = [row[place] for row in rows for place in places if place < len(row)]
    with_comma = sum("," in cell and is_number(cell, ",") for cell in cells)
    with_point = sum("." in cell and is_number(cell, ".") for cell in cells)
    return "," if with_comma > with_point else "."
