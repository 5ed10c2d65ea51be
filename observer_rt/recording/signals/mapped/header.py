"""Where the columns of a CSV file are: by the line that names them, or by their places."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint
from observer_rt.recording.signals.mapped.calendar import calendar_of
from observer_rt.recording.signals.mapped.cells import is_missing, is_number, split_line
from observer_rt.recording.signals.mapped.table import TIME

SEPARATORS = (";", "\t", ",", "|", " ")
_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))$")


@dataclass(frozen=True)
class Header:
    """Names and units of all columns, places of the mapped ones by signal.

    begin: lines before the first that may hold a unit or numbers; the line of names is the one before, if any.
    """

    separator: str
    begin: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    mapped: Mapping[str, int]


def named_header(
    path: Path, lines: Sequence[str], config: RecordingConfig, wanted: Mapping[str, str]
) -> Header:
    """Columns by their names, `wanted` by signal. Raises `UserError` where one is missing."""
    separator, line = _line_of_names(path, lines, config, list(wanted.values()))
    cells = _named(lines[line], separator, config.comment)
    names, units = zip(*map(_name_and_unit, cells), strict=True)
    place = f"{path}, line {line + 1}"
    mapped = {signal: _place(name, cells, names, place) for signal, name in wanted.items()}
    return Header(separator, line + 1, tuple(names), tuple(units), mapped)


def header_by_place(path: Path, lines: Sequence[str], config: RecordingConfig) -> Header:
    """Columns by the places that the mapping gives. Raises `UserError` where no line has numbers there."""
    mapped = {name: int(column.column) - 1 for name, column in config.signals}
    if config.time is not None:
        mapped[TIME] = int(config.time.column) - 1
    best: tuple[int, str, int, int] = (0, "", 0, 0)
    for separator in [config.separator] if config.separator else SEPARATORS:
        rows = [split_line(line.split(config.comment)[0], separator) for line in lines]
        fitting = [number for number, row in enumerate(rows) if _holds_numbers(row, mapped, config)]
        if len(fitting) > best[0]:
            best = len(fitting), separator, fitting[0], max(len(rows[number]) for number in fitting)
    found, separator, first, width = best
    if not found:
        places = ", ".join(str(place + 1) for place in sorted(mapped.values()))
        raise UserError(
            str(path),
            f"none of its first {len(lines)} lines has numbers in columns {places}",
            "correct the places in [recording] of the bench file, the first column is 1; name separator and decimal, "
            "and [recording.time] format where the time is that of a calendar",
        )
    return Header(separator, first, tuple(f"column {n + 1}" for n in range(width)), ("",) * width, mapped)


def bare_unit(unit: str) -> str:
    """A unit as it is said in a row of units."""
    return unit.strip().strip("[]()").strip()


def _holds_numbers(row: Sequence[str], mapped: Mapping[str, int], config: RecordingConfig) -> bool:
    """Whether a line has a time, as a number or by the calendar, and numbers or nothing in the other columns."""
    if len(row) <= max(mapped.values()) or is_missing(row[mapped[TIME]]):
        return False
    time = row[mapped[TIME]]
    calendar = calendar_of(config.time, [time]) if config.time else None
    cells = [row[place] for name, place in mapped.items() if name != TIME or calendar is None]
    decimals = [config.decimal] if config.decimal else [".", ","]
    if not all(any(is_number(cell, decimal) for decimal in decimals) for cell in cells):
        return False
    return calendar is None or calendar.is_stamp(time)


def _line_of_names(
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
    unnamed = (
        ". A file without names: give places, column = 1, 2, ..."
        if all(is_number(cell, ".") or is_number(cell, ",") for cell in cells)
        else ""
    )
    raise UserError(
        f"{path}, line {number + 1}",
        f"column '{missing}' is missing{hint(missing, cells)}",
        "name the columns in [recording] of the bench file as the file does: it has "
        f"{', '.join(cells[:40])}{unnamed}",
    )


def _named(line: str, separator: str, comment: str) -> list[str]:
    """Cells of a line of names, which may stand in a comment."""
    text = line.strip("\r\n").lstrip("\ufeff").lstrip(comment + " ")
    return [cell.strip() for cell in split_line(text, separator)]


def _name_and_unit(cell: str) -> tuple[str, str]:
    """`p_Rail [bar]` as both."""
    found = _UNIT.match(cell)
    if found is None or not found["name"]:
        return cell, ""
    return found["name"], (found["square"] if found["square"] is not None else found["round"]).strip()


def _place(name: str, cells: Sequence[str], names: Sequence[str], place: str) -> int:
    among = cells if name in cells else names
    if list(among).count(name) > 1:
        raise UserError(
            place, f"column '{name}' appears {list(among).count(name)} times", "keep one of this name"
        )
    return list(among).index(name)
