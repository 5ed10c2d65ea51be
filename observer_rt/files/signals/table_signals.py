"""The signals of a table in SI units, on whatever grid; those of even files read in parts."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from observer_rt.config.injector_sections import ColumnConfig
from observer_rt.files.signals.recording import EQUIDISTANT, OPTIONAL, Chunk, TimeGrid, UnevenTime, refuse_impossible
from observer_rt.files.signals.stream import SignalStream, Stretch
from observer_rt.files.signals.table import NO_ROWS, TIME, Table, TablePart
from observer_rt.foundation import units
from observer_rt.foundation.errors import UserError

MASS_RATE_UNITS = {"mg/ms": 1e-3, "g/s": 1e-3, "kg/s": 1.0, "mg/s": units.MILLIGRAM}
RATE_UNITS = {
    "m3/s": 1.0,
    "mm3/ms": units.MM3_PER_MS,
    "mm3/s": units.CUBIC_MILLIMETRE,
    "cm3/s": 1e-6,
    "l/min": 1e-3 / 60.0,
    **MASS_RATE_UNITS,  # over the fuel's density
}
UNITS = {
    TIME: units.TIME_UNITS,
    "rail_pressure": units.PRESSURE_UNITS,
    "needle_lift": units.LENGTH_UNITS,
    "line_pressure": units.PRESSURE_UNITS,
    "injection_rate": RATE_UNITS,
    "chamber_pressure": units.PRESSURE_UNITS,
    "fuel_temperature": dict.fromkeys(units.TEMPERATURE_ORIGINS, 1.0),
}
STEPS_PER_UNIT = 1e9  # of decimal text: a value on this grid becomes the double nearest to it in SI, too


class _Scale(NamedTuple):
    """Conversion of a column to SI. is_decimal: to the double nearest to the printed value."""

    factor: float
    offset: float
    is_decimal: bool

    def to_si(self, values: units.Floats) -> units.Floats:
        with np.errstate(over="ignore"):  # what becomes infinite is refused
            if self.is_decimal:
                return np.rint(values * STEPS_PER_UNIT) / float(round(STEPS_PER_UNIT / self.factor))
            return values * self.factor + self.offset if self.offset else values * self.factor


class TableSignals(SignalStream):
    """A table's columns as signals. Raises `UserError` for a unit that is missing, unknown, or needs a density."""

    def __init__(self, table: Table) -> None:
        super().__init__(table.path)
        self._table = table
        self._mapped = {
            name: column for name, column in table.mapped.items() if name != TIME or not table.brings_time
        }
        self._scales = {name: self._scale(name, column) for name, column in self._mapped.items()}
        self.optional = tuple(name for name in OPTIONAL if name in self._mapped)
        self.has_lift = "needle_lift" in self._mapped
        self.notes = tuple(table.notes)
        self.origin = table.origin
        self.edges = np.empty(0)
        """Times [s] at which energizing begins and ends in turn, by a table of shots."""

    def _parts(self, raster: int) -> Iterator[TablePart]:
        time_scale = self._scales.get(TIME, _Scale(1.0, 0.0, False))
        for part in self._table.parts(raster):
            if part.time.size:
                signals = {name: self._scales[name].to_si(values) for name, values in part.signals.items()}
                yield TablePart(time_scale.to_si(part.time), signals)

    def _chunk(self, time: units.Floats, signals: Mapping[str, units.Floats], stretch: int, first: int) -> Chunk:
        if not self.has_lift:
            signals = {"needle_lift": np.full(time.size, np.nan), **signals}
        if self.edges.size:  # each goes to the nearest sample
            edges_before = np.searchsorted(self.edges, time + 0.5 / self.sample_rate, side="right")
            signals = {**signals, "energizing": edges_before % np.float64(2.0)}
        of = {"path": self.path, "sample_rate": self.sample_rate, "stretch": stretch, "first": first}
        return Chunk(time, **signals, **of)  # type: ignore[arg-type]

    def refuse_unknown_needle(self) -> None:
        """Raise `UserError` where neither lift nor energizing is known."""
        if not self.has_lift and "energizing" not in self.optional:
            problem = "has neither needle_lift nor energizing"
            raise UserError(str(self.path), problem, "map one of them, or write x.shots.csv beside x.csv")

    def _survey_part(self, part: TablePart, row: int, raster: int) -> None:
        refuse_impossible(part.signals, lambda inside: self._table.location(row + inside, raster))
        self.survey.take_together(part.signals)

    def _unit(self, name: str, column: ColumnConfig) -> tuple[str, str]:
        """Unit of a column, and its source in words. Raises `UserError` for none and for an unknown one."""
        stated = (self._table.units.get(name, ""), "as the file says")
        unit, source = stated if column.unit is None else (column.unit, self._table.mapped_by)
        if name not in UNITS:  # a level
            return unit, source
        spelling = units.spelled(unit, UNITS[name])
        if not spelling:
            raise UserError(
                f"{self.path}, {self._table.label(name)}",
                f"unit '{unit}' is not known" if unit else "has no unit",
                f'state it in the bench file, [recording.{name}] unit = "...": one of {", ".join(UNITS[name])}; a '
                "factor makes one of any other",
            )
        return spelling, source

    def _scale(self, name: str, column: ColumnConfig) -> _Scale:
        spelling = self._unit(name, column)[0]
        unit = UNITS.get(name, {}).get(spelling, 1.0)
        if spelling in MASS_RATE_UNITS and name in UNITS:
            if self._table.density is None:
                raise UserError(
                    f"{self.path}, {self._table.label(name)}",
                    f"is a rate of mass, in {spelling}, and the fuel's density is not known",
                    "name the injector file (--model, or that of --bench), or state a unit of volume, and a factor",
                )
            unit /= self._table.density
        origin = units.TEMPERATURE_ORIGINS[spelling] if name == "fuel_temperature" else 0.0
        is_decimal = self._table.is_text and name != TIME and not origin
        return _Scale(column.factor * unit, column.offset * unit + origin, is_decimal)


class EvenSignals(TableSignals):
    """A table of one time axis, in one stretch. Raises `UserError` for an uneven time or an infinite value."""

    def __init__(self, table: Table) -> None:
        super().__init__(table)
        grid, start = TimeGrid(), 0.0
        for part in self._filled_parts():
            if not grid.samples:
                start = float(part.time[0])
                self._refuse_short(part.time.size)
            row = grid.samples
            self._refuse(grid.take(part.time))
            self._survey_part(part, row, 0)
        self._refuse_short(grid.samples)
        self._refuse(grid.end())
        self.sample_rate = grid.sample_rate
        self.stretches = (Stretch(start, grid.samples),)

    def chunks(self) -> Iterator[Chunk]:
        first = 0
        for part in self._filled_parts():
            yield self._chunk(part.time, part.signals, 0, first)
            first += part.time.size

    def _filled_parts(self) -> Iterator[TablePart]:
        """Iterate over all parts, joined so that each but the last has two samples or more, and so a rate."""
        waiting = NO_ROWS
        for part in self._parts(0):
            waiting = waiting.followed_by(part)
            if waiting.time.size > 1:
                yield waiting
                waiting = NO_ROWS
        if waiting.time.size:
            yield waiting

    def _refuse_short(self, samples: int) -> None:
        if samples < 2:
            problem = "holds one sample only" if samples else "holds no sample"
            raise UserError(self._table.location(0, 0), problem, "record, or select, at least two samples")

    def _refuse(self, uneven: UnevenTime | None) -> None:
        if uneven is not None:
            raise UserError(self._table.location(uneven.row, 0), uneven.problem, EQUIDISTANT)
