"""Recordings as CSV: `time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa[,injection_rate_mm3_per_ms]`.

Text and SI values convert exactly, both ways, for values on a grid of 1e-9 of the printed unit (and at most
12 significant digits): the reader goes through whole numbers, because `100.005 * 1e6` alone need not be the
double nearest to 100005000.
"""

import csv
import warnings
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS
from observer_rt.recording.signals.checked import GridSignals
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE
from observer_rt.recording.signals.table_writers import CsvWriter, WrittenColumn

TRUTH_SUFFIX = ".truth.csv"  # added to the name of a simulated recording: what nobody could measure
STEPS_PER_UNIT = 1e9
DESCRIBED = "a file of another layout is described in [recording] of a bench file, given by --bench"
LONGEST_HEADER = 1 << 20  # characters


class Column(NamedTuple):
    """A column of a CSV file: the signal it holds and its unit."""

    header: str
    signal: str
    factor: float
    """SI value of one printed unit."""


TIME = Column("time_s", "time", 1.0)
RAIL_PRESSURE = Column("rail_pressure_MPa", "rail_pressure", MEGAPASCAL)
NEEDLE_LIFT = Column("needle_lift_mm", "needle_lift", MILLIMETRE)
LINE_PRESSURE = Column("line_pressure_MPa", "line_pressure", MEGAPASCAL)
INJECTION_RATE = Column("injection_rate_mm3_per_ms", "injection_rate", MM3_PER_MS)

REQUIRED = (TIME, RAIL_PRESSURE, NEEDLE_LIFT, LINE_PRESSURE)
COLUMNS = (*REQUIRED, INJECTION_RATE)


class CsvSignals(GridSignals):
    """A recording of this layout; the columns may stand in any order.

    An empty cell, or `nan`, in a signal means "not available". Raises `UserError` naming line and column.
    """

    def __init__(self, path: Path, in_one_go: bool = False) -> None:
        super().__init__(path, in_one_go)
        self._columns = _read_header(path)
        self._look()

    def _place(self, row: int) -> str:
        return f"{self._file}, line {_line_of_row(self._file, row)}"

    def _parts(self) -> Iterator[dict[str, NDArray[np.float64]]]:
        for table in _tables(self._file, self._columns):
            yield {
                column.signal: _to_si(np.ascontiguousarray(table[:, i]), column)
                for i, column in enumerate(self._columns)
            }


def read_csv(path: Path) -> Recording:
    """Read a recording, as `CsvSignals`."""
    return CsvSignals(path).collected()


def write_columns(path: Path, columns: Sequence[tuple[Column, NDArray[np.float64]]]) -> None:
    """Write SI arrays of one length (n,) as CSV columns in their printed units, NaN as an empty cell."""
    with CsvWriter(path, [WrittenColumn(column.header, column.signal) for column, _ in columns]) as writer:
        writer.write([values / column.factor for column, values in columns])


def csv_names(path: Path) -> list[str]:
    """Of the columns, in a file of this layout."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return [name.strip() for name in file.readline(LONGEST_HEADER).split(",")]


def _to_si(printed: NDArray[np.float64], column: Column) -> NDArray[np.float64]:
    if column is TIME:
        return printed
    steps_per_si = float(round(STEPS_PER_UNIT / column.factor))
    return np.rint(printed * STEPS_PER_UNIT) / steps_per_si


def _read_header(path: Path) -> list[Column]:
    if path.name.endswith(TRUTH_SUFFIX):
        raise UserError(
            str(path),
            "is the truth behind a simulated recording, which is not for the observer",
            "leave it out",
        )
    known = {column.header: column for column in COLUMNS}
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        header = file.readline().strip()
    if not header:
        raise UserError(
            str(path), "is empty, or begins with an empty line", "begin it with the names of the columns"
        )
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
    for column in REQUIRED:
        if column.header not in names:
            raise UserError(place, f"column '{column.header}' is missing", expected)
    return [known[name] for name in names]


def _tables(path: Path, columns: list[Column]) -> Iterator[NDArray[np.float64]]:
    """Cells as printed, (n, columns) at a time; blank lines hold none."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        file.readline()
        before = 1
        while lines := list(islice(file, SAMPLES_AT_ONCE)):
            yield _table(lines, before, columns, path)
            before += len(lines)


def _table(lines: list[str], before: int, columns: list[Column], path: Path) -> NDArray[np.float64]:
    """Cells of some lines, `before` lines down; read cell by cell only where there are empty ones or errors."""
    try:
        with warnings.catch_warnings(action="ignore"):  # "no data"
            table = np.loadtxt(lines, delimiter=",", comments=None, ndmin=2)
    except ValueError:
        return _table_slowly(lines, before, columns, path)
    if table.shape[1] != len(columns):
        return _table_slowly(lines, before, columns, path)
    return table


def _table_slowly(lines: list[str], before: int, columns: list[Column], path: Path) -> NDArray[np.float64]:
    rows: list[list[float]] = []
    reader = csv.reader(lines)
    try:
        for cells in reader:
            if not cells:
                continue
            place = f"{path}, line {before + reader.line_num}"
            if len(cells) != len(columns):
                raise UserError(
                    place,
                    f"{len(cells)} cells, but the header has {len(columns)} columns",
                    "complete the line, or delete it if the file was cut while being written",
                )
            rows.append([_number(cell, column, place) for cell, column in zip(cells, columns, strict=True)])
    except csv.Error as error:
        place = f"{path}, line {before + reader.line_num}"
        raise UserError(place, f"is no line of CSV: {error}", "mend it") from None
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(columns))


def _number(cell: str, column: Column, place: str) -> float:
    if not cell.strip():
        return np.nan
    try:
        return float(cell)
    except ValueError:
        raise UserError(
            place,
            f"column {column.header}: '{cell}' is not a number",
            "write numbers with a decimal point; leave the cell empty where a value is not available",
        ) from None


def _line_of_row(path: Path, row: int) -> int:
    """Line number of a zero-based data row: blank lines count as lines but hold no row."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        filled = (number for number, line in enumerate(file, start=1) if line.strip())
        for index, number in enumerate(filled):
            if index == row + 1:
                return number
    return 1
