"""Columns in memory as a table that is mapped: of files that are read whole, DataFrames and arrays."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from observer_rt.config.injector import ColumnConfig, RecordingConfig
from observer_rt.files.signals.column import Column, moments_as_seconds
from observer_rt.files.signals.header import Calendar, calendar_of
from observer_rt.files.signals.number_text import cells_as_numbers, is_missing
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table import LARGEST, TIME, Table, TablePart, Values
from observer_rt.foundation.errors import UserError, hint


class HeldTable(Table):
    """Columns in memory as a table, mapped by name or place; each on its own stamps, or all on those of a column."""

    def __init__(self, path: Path, config: RecordingConfig, columns: Sequence[Column], layout: str) -> None:
        super().__init__(path, config)
        self.brings_time = config.time is None and any(column.time is not None for column in columns)
        wanted = dict(config.signals) if self.brings_time else self._wanted()
        self._columns = {name: self._found(columns, each) for name, each in wanted.items()}
        self.mapped = wanted
        self.columns = {column.name: column.unit for column in columns}
        self.units = {
            name: "s" if name == TIME and column.is_calendar else column.unit
            for name, column in self._columns.items()
            if column.unit or column.is_calendar
        }
        self._values = {name: self._numbers(name, column) for name, column in self._columns.items()}
        signals = [name for name in wanted if name != TIME]
        if self.brings_time:
            times = {name: self._stamps(name) for name in signals}
            axes: list[list[str]] = []
            for name in signals:
                same = (axis for axis in axes if np.array_equal(times[axis[0]], times[name]))
                if (axis := next(same, None)) is None:
                    axes.append(axis := [])
                axis.append(name)
            self.rasters, self._times = tuple(map(tuple, axes)), [times[axis[0]] for axis in axes]
        else:
            self._refuse_other_lengths()
            self.rasters, self._times = (tuple(signals),), []
        self.layout = f"{layout}, {len(columns)} columns"

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Slices of the columns."""
        names = self.rasters[raster]
        size = len(self._values[names[0]])
        for first in range(0, size, SAMPLES_AT_ONCE):
            rows = slice(first, first + SAMPLES_AT_ONCE)
            columns = {name: self._values[name][rows] for name in names}
            if self.brings_time:
                columns[TIME] = self._times[raster][rows]
            elif TIME in self._values:
                columns[TIME] = self._values[TIME][rows]
            yield self._part(columns, first)

    def place(self, row: int, raster: int) -> str:
        """Place of a row: its number, from 1."""
        return f"{self.path}, row {row + 1} of numbers"

    def _found(self, columns: Sequence[Column], wanted: ColumnConfig) -> Column:
        """The column that a mapping names."""
        if isinstance(wanted.column, int):
            if wanted.column <= len(columns):
                return columns[wanted.column - 1]
            raise UserError(str(self.path), f"has {len(columns)} columns", "correct `column` in [recording]")
        name = wanted.column
        there = [
            column
            for column in columns
            if name in (column.name, column.name.rpartition("/")[2]) and wanted.group in (None, column.group)
        ]
        exact = [column for column in there if column.name == name]
        if len(exact or there) == 1:
            return (exact or there)[0]
        names = [column.name for column in columns]
        known = ", ".join(names[:40])
        if there:
            raise UserError(
                f"{self.path}, column {name}",
                f"is there {len(there)} times",
                f"name one in full, or its group, in [recording]: {', '.join(each.name for each in there[:40])}",
            )
        raise UserError(
            str(self.path),
            f"column '{name}' is missing{hint(name, names)}",
            f"name the columns in [recording] of the bench file as the file does: it has {known}",
        )

    def _numbers(self, name: str, column: Column) -> Values:
        """Values as numbers; moments as seconds from the first, text as CSV would be read."""
        values, place = column.values, f"{self.path}, {self.label(name)}"
        stated = self.config.time if name == TIME and column.is_text else None
        if stated is not None and (calendar := calendar_of(stated, column.cells)) is not None:
            self.units[TIME] = "s"
            return _seconds(calendar, column.cells)
        if column.is_calendar:
            return moments_as_seconds(values)
        if column.is_text:
            try:
                return cells_as_numbers(column.cells, self.config.decimal, self.config.thousands)
            except ValueError as error:
                row, cell = error.args
                raise UserError(
                    place,
                    f"value {row + 1}, '{cell[:40]}', is no number",
                    "map a column of numbers; a separator of thousands is stated as [recording] thousands",
                ) from None
        if values.dtype.kind not in "biuf":
            raise UserError(place, f"holds {values.dtype}, no numbers", "map a column of numbers")
        numbers: Values = values.astype(np.float64)
        beyond = np.flatnonzero(np.isfinite(numbers) & (np.abs(numbers) > LARGEST))
        if beyond.size:
            raise UserError(
                place,
                f"value {beyond[0] + 1} is {numbers[beyond[0]]:g}",
                "record it again: the file is damaged",
            )
        return numbers

    def _stamps(self, name: str) -> Values:
        column = self._columns[name]
        if column.time is None:
            raise UserError(
                f"{self.path}, {self.label(name)}",
                "has no time of its own, as other channels have",
                'name a column of the time: [recording.time] column = "..."',
            )
        return column.time

    def _refuse_other_lengths(self) -> None:
        name = TIME if TIME in self._values else "rail_pressure"
        rows = len(self._values[name])
        for other, values in self._values.items():
            if len(values) != rows:
                raise UserError(
                    f"{self.path}, {self.label(other)}",
                    f"has {len(values)} values, {self.mapped[name].name} has {rows}",
                    "map columns of one length",
                )


def _seconds(calendar: Calendar, cells: Sequence[str]) -> Values:
    first = next((cell for cell in cells if not is_missing(cell)), None)
    return calendar.seconds(cells, 0 if first is None else int(calendar.nanoseconds([first])[0]))
