"""Columns of a CSV file, by the line that names them or by their places: numbers, and times by the calendar."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.injector import RecordingConfig, TimeConfig
from observer_rt.files.signals.column import NANOSECONDS, name_and_unit
from observer_rt.files.signals.number_text import is_missing, is_number
from observer_rt.files.signals.table import TIME
from observer_rt.foundation.errors import UserError, hint

_ISO = re.compile(r"\s*\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
ISO_8601 = "ISO8601"  # as pandas calls it
_NONE = np.iinfo(np.int64).min  # as NumPy and pandas have it

SEPARATORS = (";", "\t", ",", "|", " ")


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


@dataclass(frozen=True)
class Calendar:
    """Format of the stamps, as of strptime, or `ISO_8601`. Without a zone they count as UTC."""

    form: str

    def nanoseconds(self, cells: Any) -> NDArray[np.int64]:
        """Nanoseconds since 1970 of stamps (n,); those that are none are below all others."""
        import pandas  # slow to import

        try:
            stamps = pandas.to_datetime(pandas.Series(cells), format=self.form, errors="coerce", utc=True)
        except ValueError as error:
            raise UserError(
                f"[recording.time] format = '{self.form}'",
                str(error),
                "write it as '%d.%m.%Y %H:%M:%S.%f', with the letters of strptime",
            ) from None
        found: NDArray[np.int64] = stamps.dt.tz_localize(None).to_numpy("datetime64[ns]").astype(np.int64)
        return found

    def seconds(self, cells: Any, origin: int) -> NDArray[np.float64]:
        """Seconds of stamps (n,) since `origin` [ns], exact as those since 1970 are not. NaN of no stamps."""
        found = self.nanoseconds(cells)
        return np.where(found == _NONE, np.nan, (found - origin) / NANOSECONDS)

    def as_text(self, origin: int) -> str:
        """Description of how the stamps are read."""
        form = "ISO 8601" if self.form == ISO_8601 else f"'{self.form}'"
        return f"calendar stamps as {form}, counted from {np.datetime64(origin, 'ns')}"


def calendar_of(time: TimeConfig, cells: Iterable[str]) -> Calendar | None:
    """Calendar of a column: as stated, or ISO 8601 where a cell looks so and no unit is stated. None: numbers."""
    if time.format is not None:
        return Calendar(time.format)
    if time.unit is None and any(_ISO.match(cell) for cell in cells):
        return Calendar(ISO_8601)
    return None


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
    names, units = zip(*map(name_and_unit, cells), strict=True)
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
    """A unit as it stands in a row of units."""
    return unit.strip().strip("[]()").strip()


def _holds_numbers(row: Sequence[str], mapped: Mapping[str, int], config: RecordingConfig) -> bool:
    """Whether a line has a time, as a number or by the calendar, and numbers or nothing in the other columns."""
    if len(row) <= max(mapped.values()):
        return False
    calendar, time = None, "" if config.time is None else row[mapped[TIME]]
    if config.time is not None:
        if is_missing(time):
            return False
        calendar = calendar_of(config.time, [time])
    cells = [row[place] for name, place in mapped.items() if name != TIME or calendar is None]
    decimals = [config.decimal] if config.decimal else [".", ","]
    if not all(any(is_number(cell, decimal, config.thousands) for decimal in decimals) for cell in cells):
        return False
    return calendar is None or bool(calendar.nanoseconds([time])[0] != _NONE)


def _line_of_names(
    path: Path, lines: Sequence[str], config: RecordingConfig, wanted: Sequence[str]
) -> tuple[str, int]:
    """Separator and number of the line that has all names, or an error of the one that has most."""
    best: tuple[int, int, list[str]] = (-1, 0, [])
    for separator in [config.separator] if config.separator else SEPARATORS:
        for number, line in enumerate(lines):
            cells = _named(line, separator, config.comment)
            there = {*cells, *(name_and_unit(cell)[0] for cell in cells)}
            found = sum(name in there for name in wanted)
            if found == len(wanted):
                return separator, number
            if (found, len(cells) > 1) > (best[0], len(best[2]) > 1):
                best = found, number, cells
    _, number, cells = best
    known = [*cells, *(name_and_unit(cell)[0] for cell in cells)]
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


def _place(name: str, cells: Sequence[str], names: Sequence[str], place: str) -> int:
    among = cells if name in cells else names
    if list(among).count(name) > 1:
        raise UserError(
            place, f"column '{name}' appears {list(among).count(name)} times", "keep one of this name"
        )
    return list(among).index(name)
