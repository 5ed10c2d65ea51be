"""The beginning of a CSV file whose columns nobody has named: separator, line of names, units, numbers."""

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.files.signals.column import Column, Values, name_and_unit
from observer_rt.files.signals.header import SEPARATORS, bare_unit, split_line
from observer_rt.files.signals.number_text import (
    cells_as_numbers,
    decimal_of,
    is_missing,
    is_number,
    thousands_of,
)
from observer_rt.files.signals.text_file import encoding_of, opened_text
from observer_rt.foundation.errors import UserError

_LOOKED_AT = 200  # lines, among which names and numbers must begin
_FEWEST = 3  # columns
_COMMENT = "#"


def preview_csv(path: Path, most: int) -> tuple[Column, ...]:
    """Columns of up to `most` lines. Raises `UserError` where no line holds numbers."""
    with opened_text(path, encoding_of(path)) as file:
        lines = [line.rstrip("\r\n") for line in islice(file, most)]
    if not any(line.strip() for line in lines):
        raise UserError(
            str(path), "is empty", "give a file with the names of its columns and numbers below them"
        )
    separator, first = _begin(path, lines[:_LOOKED_AT])
    shown = [cells for line in lines[first:][:_LOOKED_AT] if len(cells := _cells(line, separator)) > 1]
    width = max(map(len, shown))
    names, units = _names(lines[:first], separator, width)
    numeric = [place for place, cell in enumerate(shown[0]) if _is_numeric(cell)]
    decimal = decimal_of([row for row in shown if len(row) == width], numeric)
    table = _at_once(lines[first:], separator, decimal)
    found = _one_by_one(lines[first:], separator, decimal, width) if table is None else list(table.T)
    return tuple(Column(*each) for each in zip(names, found, units, strict=False))


def _at_once(lines: Sequence[str], separator: str, decimal: str) -> Values | None:
    """Numbers (rows, columns) where there is nothing else."""
    try:
        return np.loadtxt(
            (line.replace(decimal, ".") for line in lines),
            delimiter=None if separator == " " else separator,
            comments=_COMMENT,
            ndmin=2,
        )
    except ValueError:
        return None


def _one_by_one(lines: Sequence[str], separator: str, decimal: str, width: int) -> Iterator[NDArray[Any]]:
    """Columns of numbers, and of cells where there are others."""
    rows = [cells for line in lines if len(cells := _cells(line, separator)) > 1]
    some = [*rows[:_LOOKED_AT], *rows[:: 1 + len(rows) // _LOOKED_AT]]
    thousands = thousands_of((cell for row in some for cell in row), decimal)
    for place in range(width):
        cells = [row[place] if place < len(row) else "" for row in rows]
        try:
            yield cells_as_numbers(cells, decimal, thousands)
        except ValueError:
            yield np.array(cells, object)


def _begin(path: Path, lines: Sequence[str]) -> tuple[str, int]:
    """Separator of the lines that hold most numbers, and the first of these."""
    best: tuple[int, str, int] = (0, "", 0)
    for separator in SEPARATORS:
        counts = [_numbers_in(_cells(line, separator)) for line in lines]
        fitting = [number for number, count in enumerate(counts) if count >= _FEWEST]
        total = sum(counts[number] for number in fitting)
        if total > best[0]:
            best = total, separator, fitting[0]
    if not best[0]:
        raise UserError(
            str(path),
            f"none of its first {len(lines)} lines holds {_FEWEST} numbers",
            "give a file with a column for each signal, or say in [recording] of a bench file how it is written",
        )
    return best[1], best[2]


def _cells(line: str, separator: str) -> list[str]:
    return split_line(line.split(_COMMENT)[0].rstrip(), separator)


def _numbers_in(cells: Sequence[str]) -> int:
    """Number of cells with numbers; 0 where other cells are more."""
    count = sum(map(_is_numeric, cells))
    return count if 2 * count > len(cells) else 0


def _is_numeric(cell: str) -> bool:
    return not is_missing(cell) and (is_number(cell, ".") or is_number(cell, ","))


def _names(above: Sequence[str], separator: str, width: int) -> tuple[list[str], list[str]]:
    """Names and units of the columns, as the lines above the numbers have them; names empty where none has."""
    rows = [split_line(line.lstrip("\ufeff").lstrip(_COMMENT + " "), separator) for line in above]
    full = [[cell.strip() for cell in row] for row in rows if len(row) == width]
    if not full:
        return [""] * width, [""] * width
    under = full[-1] if len(full) > 1 and full[-2] != full[-1] else None
    if under is None or not all(full[-2]):
        under, heading = None, full[-1]
    else:
        heading = full[-2]
    split = [name_and_unit(cell) for cell in heading]
    bare = [name for name, _ in split]
    names = [name if bare.count(name) == 1 else cell for name, cell in zip(bare, heading, strict=True)]
    units = [unit for _, unit in split] if under is None else [bare_unit(cell) for cell in under]
    return names, units
