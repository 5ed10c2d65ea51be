"""Excel (`.xlsx`): the first sheet with a table: names above numbers, units in brackets or in a row between."""

from collections.abc import Iterator, Sequence
from datetime import date, datetime
from pathlib import Path
from typing import Any

import numpy as np
from openpyxl import load_workbook

from observer_rt.files.signals.column import Column, name_and_unit
from observer_rt.files.signals.header import bare_unit

_FEWEST = 3  # columns of numbers
_LOOKED_AT = 200  # rows, among which the numbers must begin


def columns(path: Path) -> Iterator[Column]:
    """Columns of the first sheet that has some."""
    book = load_workbook(path, read_only=True, data_only=True, keep_links=False)
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # which a writer may have stated wrongly
        rows = [list(row) for row in sheet.iter_rows(values_only=True)]
        first = next((at for at, row in enumerate(rows[:_LOOKED_AT]) if _numbers_in(row) >= _FEWEST), None)
        if first is not None:
            yield from _table(rows[:first], rows[first:])
            return


def _table(above: Sequence[Sequence[Any]], rows: Sequence[Sequence[Any]]) -> Iterator[Column]:
    width = max(map(len, rows))
    headings = [row for row in above if sum(isinstance(cell, str) for cell in row) >= _FEWEST]
    names = [*headings[-1], *[None] * width] if headings else [None] * width
    units: Sequence[Any] = [None] * width
    if len(headings) > 1 and above[-1] is headings[-1] and above[-2] is headings[-2]:
        names, units = [*headings[-2], *[None] * width], [*headings[-1], *[None] * width]
    for place in range(width):
        cells = [row[place] if place < len(row) else None for row in rows]
        if all(cell is None for cell in cells):
            continue
        name, unit = name_and_unit(str(names[place]).strip() if names[place] is not None else "")
        yield Column(name, _values(cells), bare_unit(str(units[place])) if units[place] is not None else unit)


def _numbers_in(row: Sequence[Any]) -> int:
    return sum(isinstance(cell, int | float | date) and not isinstance(cell, bool) for cell in row)


def _values(cells: Sequence[Any]) -> np.ndarray:
    """Numbers or moments where all cells are some; else text."""
    there = [cell for cell in cells if cell is not None]
    if all(isinstance(cell, int | float) for cell in there):
        return np.array([np.nan if cell is None else cell for cell in cells], np.float64)
    if all(isinstance(cell, datetime) for cell in there):
        return np.array(cells, "datetime64[ns]")
    return np.array(["" if cell is None else str(cell) for cell in cells], object)
