"""The signals of a table in SI units, whatever grid they then come on."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from observer_rt.config.recording import ColumnConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import (
    CUBIC_MILLIMETRE,
    LENGTH_UNITS,
    MM3_PER_MS,
    PRESSURE_UNITS,
    TIME_UNITS,
)
from observer_rt.recording.signals.mapped.table import TIME, Table, TablePart, Values
from observer_rt.recording.signals.recording import Chunk, refuse_infinite
from observer_rt.recording.signals.stream import SignalStream

RATE_UNITS = {
    "m3/s": 1.0,
    "mm3/ms": MM3_PER_MS,
    "mm3/s": CUBIC_MILLIMETRE,
    "m³/s": 1.0,
    "mm³/ms": MM3_PER_MS,
    "mm³/s": CUBIC_MILLIMETRE,
}
UNITS = {
    TIME: TIME_UNITS,
    "rail_pressure": PRESSURE_UNITS,
    "needle_lift": LENGTH_UNITS,
    "line_pressure": PRESSURE_UNITS,
    "injection_rate": RATE_UNITS,
}
STEPS_PER_UNIT = 1e9  # of decimal text: a value on this grid becomes the double nearest to it in SI, too


class _Scale(NamedTuple):
    """From a column to SI. is_decimal: `100.005 * 1e6` alone need not be the double nearest to 100005000."""

    factor: float
    offset: float
    is_decimal: bool

    def to_si(self, values: Values) -> Values:
        if self.is_decimal:
            return np.rint(values * STEPS_PER_UNIT) / float(round(STEPS_PER_UNIT / self.factor))
        return values * self.factor + self.offset if self.offset else values * self.factor


class TableSignals(SignalStream):
    """A table's columns as signals. Raises `UserError` for a unit that is missing or unknown."""

    def __init__(self, table: Table) -> None:
        super().__init__(table.path)
        self._table = table
        self._mapped = {
            name: column for name, column in table.mapped.items() if name != TIME or not table.brings_time
        }
        self._scales = {name: self._scale(name, column) for name, column in self._mapped.items()}
        self.has_rate = "injection_rate" in self._mapped
        self.notes = tuple(table.notes)

    def _parts(self, raster: int) -> Iterator[TablePart]:
        """Rows of a time axis in SI units, none empty, read anew."""
        time_scale = self._scales.get(TIME, _Scale(1.0, 0.0, False))
        for part in self._table.parts(raster):
            if part.time.size:
                signals = {name: self._scales[name].to_si(values) for name, values in part.signals.items()}
                yield TablePart(time_scale.to_si(part.time), signals)

    def _chunk(self, time: Values, signals: Mapping[str, Values], stretch: int, first: int) -> Chunk:
        return Chunk(
            time,
            signals["rail_pressure"],
            signals["needle_lift"],
            signals["line_pressure"],
            signals.get("injection_rate"),
            self.path,
            self.rate,
            stretch,
            first,
        )

    def _look_at(self, part: TablePart, row: int, raster: int) -> None:
        """Note the ranges of a part that begins at a row. Raises `UserError` for an infinite value."""
        refuse_infinite(part.signals, lambda inside: self._table.place(row + inside, raster))
        for name, values in part.signals.items():
            self.survey.take(name, values)

    def _unit(self, name: str, column: ColumnConfig) -> tuple[str, str]:
        """Unit of a column, and who says so. Raises `UserError` for none and for an unknown one."""
        found = (self._table.units.get(name, ""), "as the file says")
        unit, said = found if column.unit is None else (column.unit, "as the bench file says")
        if unit not in UNITS[name]:
            raise UserError(
                f"{self.path}, {self._table.label(name)}",
                f"unit '{unit}' is not known" if unit else "has no unit",
                f'state it in the bench file, [recording.{name}] unit = "...": one of {", ".join(UNITS[name])}; a '
                "factor makes one of any other",
            )
        return unit, said

    def _scale(self, name: str, column: ColumnConfig) -> _Scale:
        unit = UNITS[name][self._unit(name, column)[0]]
        return _Scale(column.factor * unit, column.offset * unit, self._table.is_text and name != TIME)
