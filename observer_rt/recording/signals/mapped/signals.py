"""A foreign file as a recording: columns mapped and scaled, one even grid, short gaps bridged, split at long ones."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND
from observer_rt.recording.signals.mapped.axis import AxisSurvey, Cursor, RowRun
from observer_rt.recording.signals.mapped.table import TIME, Table, TablePart, Values
from observer_rt.recording.signals.mapped.table_signals import TableSignals
from observer_rt.recording.signals.recording import Chunk
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE, Stretch

MOST_STRETCHES = 10_000
SLOWEST, FASTEST = 10.0, 100.0  # how much slower and faster than the grid a file may be
SAME_RATE = 0.01  # relative, of a file and the grid
_SHOWN = 5  # places where a file is split


@dataclass
class _Rows:
    """Rows of an axis that were read and are still needed. first: number of the first one."""

    parts: Iterator[TablePart]
    first: int = 0
    time: Values = field(default_factory=lambda: np.empty(0))
    signals: dict[str, Values] = field(default_factory=dict)

    def read(self) -> bool:
        """Append a part; False at the end of the file."""
        part = next(self.parts, None)
        if part is None:
            return False
        self.signals = {
            name: np.concatenate((self.signals.get(name, np.empty(0)), values))
            for name, values in part.signals.items()
        }
        self.time = np.concatenate((self.time, part.time))
        return True

    def drop(self, rows: int) -> None:
        """Forget the first rows."""
        self.first += rows
        self.time = self.time[rows:]
        self.signals = {name: values[rows:] for name, values in self.signals.items()}


class MappedSignals(TableSignals):
    """A table by its `[recording]` section, on a grid of `rate` [Hz].

    Stamps that are the grid's but for their jitter are taken for it, others are resampled by straight lines. Raises
    `UserError` naming file, column or line for what cannot be read as a recording.
    """

    def __init__(self, table: Table, rate: float) -> None:
        super().__init__(table)
        self.rate = rate
        self._axes = [self._axis(raster) for raster in range(len(table.rasters))]
        self._main = min(range(len(self._axes)), key=lambda raster: self._axes[raster].period)
        self._runs = self._usable_runs()
        self.stretches = tuple(Stretch(run.begin, self._samples(run)) for run in self._runs)
        self.notes = (*self.notes, *self._notes())
        self.names = {name: column.name for name, column in self._mapped.items() if name != TIME}
        self.details = self._details()

    def _details(self) -> tuple[str, ...]:
        table, config = self._table, self._mapped
        others = [name for name in table.columns if name not in {column.name for column in config.values()}]
        lines = [f"{self.path}: {table.layout}"]
        for name, column in config.items():
            raster = next((i for i, names in enumerate(table.rasters) if name in names), self._main)
            every = f", every {self._axes[raster].period / MILLISECOND:.6g} ms" if name != TIME else ""
            unit, said = self._unit(name, column)
            lines.append(f"{name} is '{column.name}' in {unit} ({said}){every}")
        if others:
            more = f" and {len(others) - 40} more" if len(others) > 40 else ""
            lines.append(f"not used: {', '.join(others[:40])}{more}")
        return tuple(lines)

    def chunks(self) -> Iterator[Chunk]:
        """Read anew, every axis beside the others."""
        rows = [_Rows(self._parts(raster)) for raster in range(len(self._axes))]
        cursors = [Cursor(self.rate, axis.reach, axis.is_on_grid) for axis in self._axes]
        for number, (run, stretch) in enumerate(zip(self._runs, self.stretches, strict=True)):
            main = rows[self._main]
            while main.first + main.time.size <= run.first and main.read():
                main.drop(min(main.time.size, run.first - main.first))
            main.drop(run.first - main.first)
            for first in range(0, stretch.samples, SAMPLES_AT_ONCE):
                grid = np.arange(first, min(first + SAMPLES_AT_ONCE, stretch.samples), dtype=np.float64)
                signals: dict[str, Values] = {}
                for raster, cursor in enumerate(cursors):
                    last = run.last if raster == self._main else None
                    signals |= self._on_grid(rows[raster], cursor, run.begin, last, grid)
                yield self._chunk(run.begin + grid / self.rate, signals, number, first)

    def _on_grid(
        self, rows: _Rows, cursor: Cursor, begin: float, last: int | None, grid: Values
    ) -> dict[str, Values]:
        """The signals of an axis at places of a grid that begins at a time [s]; last: row of the main axis."""
        until = begin + (grid[-1] + 1.0) / self.rate
        while (
            (not rows.time.size or rows.time[-1] <= until)
            and (last is None or rows.first + rows.time.size <= last)
            and rows.read()
        ):
            pass
        count = rows.time.size if last is None else min(rows.time.size, last + 1 - rows.first)
        place, rises = cursor.knots(rows.time[:count], begin)
        signals = {
            name: cursor.at(grid, place[rises], values[:count][rises])
            for name, values in rows.signals.items()
        }
        passed = int(np.searchsorted(np.maximum.accumulate(place), grid[-1] - 1.0)) if count else 0
        kept = math.ceil(self._longest_reach * self.rate) + 2  # rows that a bridge may begin with
        rows.drop(max(0, min(passed - kept, count - 1)))
        return signals

    @property
    def _longest_reach(self) -> float:
        return max(axis.reach for axis in self._axes)

    def _axis(self, raster: int) -> AxisSurvey:
        axis = AxisSurvey(self.rate, self._table.config.bridge_ms * MILLISECOND)
        rows = 0
        for part in self._parts(raster):
            bad = np.flatnonzero(~np.isfinite(part.time))
            if bad.size:
                raise UserError(
                    self._table.place(rows + int(bad[0]), raster),
                    "the time is not a finite number",
                    "mend the line",
                )
            self._look_at(part, rows, raster)
            axis.take(part.time)
            rows += part.time.size
            if len(axis.runs) > MOST_STRETCHES:
                raise UserError(
                    str(self.path),
                    f"falls apart: {len(axis.runs)} gaps or steps back of the time in its first {rows} rows",
                    "mind column and unit of the time, or raise recording.bridge_ms",
                )
        if not axis.period:
            name = ", ".join(self._table.rasters[raster])
            problem = "the time does not rise" if rows > 1 else f"holds {rows} sample(s)"
            raise UserError(
                f"{self.path}, {name}", problem, "mind the column of the time; two samples are the least"
            )
        return axis

    def _usable_runs(self) -> list[RowRun]:
        axis = self._axes[self._main]
        found = 1.0 / axis.period
        if not self.rate / SLOWEST <= found <= self.rate * FASTEST:
            raise UserError(
                str(self.path),
                f"is sampled at {found:.6g} Hz, to be put on {self.rate:g} Hz of sampling.rate_hz",
                "mind column and unit of the time, and rate_hz",
            )
        if len(self._axes) > 1 and any(run.is_restart for each in self._axes for run in each.runs):
            raise UserError(
                str(self.path),
                "the time of a channel steps back, and its channels have several times",
                "split it there",
            )
        runs = [run for run in axis.runs if self._samples(run) >= 2]
        if not runs:
            raise UserError(
                str(self.path),
                f"holds no two samples within {axis.reach / MILLISECOND:g} ms",
                "mind column and unit of the time, or raise recording.bridge_ms",
            )
        return runs

    @property
    def is_resampled(self) -> bool:
        """Whether samples are not those of the file, but lie between them."""
        axis = self._axes[self._main]
        return not axis.is_on_grid or abs(1.0 / axis.period / self.rate - 1.0) > SAME_RATE

    def _samples(self, run: RowRun) -> int:
        """Of the grid within a run."""
        span = (run.end - run.begin) * self.rate
        is_on_grid = self._axes[self._main].is_on_grid
        return int(round(span) if is_on_grid else math.floor(span + 1e-6)) + 1

    def _notes(self) -> Iterator[str]:
        axis = self._axes[self._main]
        found = 1.0 / axis.period
        if abs(found / self.rate - 1.0) > SAME_RATE:
            yield f"{self.path}: recorded at {found:.6g} Hz, resampled to {self.rate:g} Hz of sampling.rate_hz"
        elif not axis.is_on_grid:
            yield f"{self.path}: its stamps are not on a grid of {self.rate:g} Hz: resampled by straight lines"
        elif axis.off_grid > 1e-3:
            yield f"{self.path}: stamps up to {axis.off_grid:.2g} samples off the grid are taken for it"
        if axis.bridged:
            yield (
                f"{self.path}: {axis.bridged} gaps are bridged by straight lines, the longest of "
                f"{axis.longest_bridge / MILLISECOND:.4g} ms"
            )
        if axis.disordered:
            yield f"{self.path}: {axis.disordered} rows with a time that repeats or steps back a little are left out"
        if dropped := len(axis.runs) - len(self._runs):
            yield f"{self.path}: {dropped} single samples between gaps are left out"
        if len(self._runs) > 1:
            yield f"{self.path}: split into {len(self._runs)} stretches: {self._splits()}"

    def _splits(self) -> str:
        places = []
        for before, after in pairwise(self._runs):
            what = (
                "the time begins anew"
                if after.is_restart
                else f"{after.begin - before.end:.4g} s are missing"
            )
            places.append(f"after {before.end:.6g} s {what}")
        more = f" and {len(places) - _SHOWN} more" if len(places) > _SHOWN else ""
        return "; ".join(places[:_SHOWN]) + more
