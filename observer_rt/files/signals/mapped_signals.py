"""A foreign file as a recording: columns mapped and scaled, one even grid, short gaps bridged, split at long ones."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from observer_rt.config.injector_sections import HIGHEST_RATE, LOWEST_RATE
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE, Stretch
from observer_rt.files.signals.table import NO_ROWS, TIME, Table, TablePart
from observer_rt.files.signals.table_signals import TableSignals
from observer_rt.files.signals.time_axis import AxisSurvey, RowRun, has_limits, rate_of, refuse_wrong_clock
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND, Floats, first_of

MOST_STRETCHES = 10_000
MOST_RESTARTS = 0.01  # of the rows, where the time may begin anew
SLOWEST, FASTEST = 10.0, 100.0  # how much slower and faster than the grid a file may be
SAME_RATE = 0.01  # relative, of a file and the grid
MOST_DISORDERED = 0.1  # of the rows, that may be left out for their stamps
FEWEST_FOR_RATE = 1000  # stamps, whose jitter is then no difference of rates
_CHECK_TIME = "check column and unit of the time, or raise recording.bridge_ms"


@dataclass
class _Rows:
    """Rows of an axis that are still needed. first: number of the first one."""

    parts: Iterator[TablePart]
    first: int = 0
    kept: TablePart = NO_ROWS

    def read(self) -> bool:
        """Append a part; False at the end of the file."""
        part = next(self.parts, None)
        if part is not None:
            self.kept = self.kept.followed_by(part)
        return part is not None

    def drop(self, rows: int) -> None:
        """Forget the first rows."""
        self.first += rows
        signals = {name: values[rows:] for name, values in self.kept.signals.items()}
        self.kept = TablePart(self.kept.time[rows:], signals)


class MappedSignals(TableSignals):
    """A table by its `[recording]` section, on a grid of `rate` [Hz]; stamps off the grid are resampled.

    Raises `UserError` naming file, column or line for what cannot be read as a recording.
    """

    def __init__(self, table: Table, rate: float) -> None:
        """rate: counts where the mapping states none; 0: the rate of the first stamps."""
        super().__init__(table)
        first = next(self._parts(0), NO_ROWS)
        self._has_limits = has_limits(first)
        self.sample_rate = table.config.rate_hz or rate or self._own_rate(self._instants(first))
        self._axes = [self._axis(raster) for raster in range(len(table.rasters))]
        self._main = min(range(len(self._axes)), key=lambda raster: self._axes[raster].period)
        stamps = self._instants(first if self._main == 0 else next(self._parts(self._main)))
        if stamps.size >= FEWEST_FOR_RATE and (own := rate_of(stamps)) is not None:
            refuse_wrong_clock(self.path, own, self.sample_rate, "the bench file")
        self._runs = self._usable_runs()
        self.stretches = tuple(Stretch(run.begin, self._samples(run)) for run in self._runs)
        self.notes = (*self.notes, *self._notes())
        self.names = {name: column.column for name, column in self._mapped.items() if name != TIME}
        self.details = self._details()

    def _instants(self, part: TablePart) -> Floats:
        """Stamps of rows, each once where it has two limits."""
        return part.time[np.diff(part.time, append=np.inf) != 0.0] if self._has_limits else part.time

    def _own_rate(self, stamps: Floats) -> float:
        rate = rate_of(stamps)
        if rate is None:
            self._refuse_disorder(int(np.count_nonzero(np.diff(stamps) < 0.0)), stamps.size)
            problem = "has no even rate"
            raise UserError(f"{self.path}: time", problem, "state it in the bench file: [recording] rate_hz = 100e3")
        if not LOWEST_RATE <= rate <= HIGHEST_RATE:
            problem = f"has {rate:.6g} rows a second, which are too few or too many"
            remedy = "check its unit, or state it in a bench file: [recording.time]"
            raise UserError(f"{self.path}: time", problem, remedy)
        return rate

    def _details(self) -> tuple[str, ...]:
        table, config = self._table, self._mapped
        others = [name for name in table.columns if name not in {column.column for column in config.values()}]
        lines = [f"{self.path}: {table.layout}"]
        for name, column in config.items():
            raster = next((i for i, names in enumerate(table.rasters) if name in names), self._main)
            every = f", every {self._axes[raster].period / MILLISECOND:.6g} ms" if name != TIME else ""
            unit, source = self._unit(name, column)
            lines.append(f"{name} is '{column.column}' in {unit} ({source}){every}")
        if others:
            lines.append(f"not used: {first_of(others, 40)}")
        return tuple(lines)

    def chunks(self) -> Iterator[Chunk]:
        rows = [_Rows(self._parts(raster)) for raster in range(len(self._axes))]
        for number, (run, stretch) in enumerate(zip(self._runs, self.stretches, strict=True)):
            main = rows[self._main]
            while main.first + main.kept.time.size <= run.first and main.read():
                main.drop(min(main.kept.time.size, run.first - main.first))
            main.drop(run.first - main.first)
            for first in range(0, stretch.samples, SAMPLES_AT_ONCE):
                grid = np.arange(first, min(first + SAMPLES_AT_ONCE, stretch.samples), dtype=np.float64)
                signals: dict[str, Floats] = {}
                for raster, axis in enumerate(self._axes):
                    last = run.last if raster == self._main else None
                    signals |= self._on_grid(rows[raster], axis, run.begin, last, grid)
                yield self._chunk(run.begin + grid / self.sample_rate, signals, number, first)

    def _on_grid(
        self, rows: _Rows, axis: AxisSurvey, begin: float, last: int | None, grid: Floats
    ) -> dict[str, Floats]:
        """The signals of an axis at places of a grid that begins at a time [s]; last: row of the main axis."""
        until = begin + (grid[-1] + 1.0) / self.sample_rate
        while (
            (not rows.kept.time.size or rows.kept.time[-1] <= until)
            and (last is None or rows.first + rows.kept.time.size <= last)
            and rows.read()
        ):
            pass
        count = rows.kept.time.size if last is None else min(rows.kept.time.size, last + 1 - rows.first)
        position, rises = axis.knots(rows.kept.time[:count], begin)
        signals = {
            name: axis.at(grid, position[rises], values[:count][rises]) for name, values in rows.kept.signals.items()
        }
        passed = int(np.searchsorted(np.maximum.accumulate(position), grid[-1] - 1.0)) if count else 0
        longest = max(axis.reach for axis in self._axes)
        kept = math.ceil(longest * self.sample_rate) + 2  # rows that a bridge may begin with
        rows.drop(max(0, min(passed - kept, count - 1)))
        return signals

    def _axis(self, raster: int) -> AxisSurvey:
        axis = AxisSurvey(self.sample_rate, self._table.config.bridge_ms * MILLISECOND)
        name = ", ".join(self._table.rasters[raster])
        for part in self._surveyed_parts(raster):
            axis.take(part.time)
            if len(axis.runs) > MOST_STRETCHES:
                gaps = f"{len(axis.runs)} gaps or steps back of the time in its first {axis.rows} rows"
                raise UserError(str(self.path), f"falls apart: {gaps}", _CHECK_TIME)
        self._refuse_disorder(sum(run.is_restart for run in axis.runs), axis.rows)
        if not axis.period:
            problem = "the time does not rise" if axis.rows > 1 else f"holds {axis.rows} sample(s)"
            remedy = "check the column of the time; two samples are the least"
            raise UserError(f"{self.path}, {name}", problem, remedy)
        if axis.disordered > MOST_DISORDERED * axis.rows and not self._has_limits:
            raise UserError(
                f"{self.path}, {name}",
                f"its stamps are rounded: in {axis.disordered} of {axis.rows} rows the time repeats or steps back",
                "leave out [recording.time] and state how many rows are a second, [recording] rate_hz = ...",
            )
        return axis

    def _surveyed_parts(self, raster: int) -> Iterator[TablePart]:
        rows = 0
        for part in self._parts(raster):
            bad = np.flatnonzero(~np.isfinite(part.time))
            if bad.size:
                problem = "the time is not a finite number"
                raise UserError(self._table.location(rows + int(bad[0]), raster), problem, "mend the line")
            self._survey_part(part, rows, raster)
            rows += part.time.size
            yield part

    def _refuse_disorder(self, restarts: int, rows: int) -> None:
        if restarts > max(MOST_RESTARTS * rows, 1.0):
            problem = f"its rows are not in the order of time: it steps back in {restarts} of {rows}"
            raise UserError(str(self.path), problem, "sort the rows by their time")

    def _usable_runs(self) -> list[RowRun]:
        axis = self._axes[self._main]
        rate = 1.0 / axis.period
        if not self.sample_rate / SLOWEST <= rate <= self.sample_rate * FASTEST:
            problem = f"is sampled at {rate:.6g} Hz, to be put on {self.sample_rate:g} Hz of sampling.rate_hz"
            raise UserError(str(self.path), problem, "check column and unit of the time, and rate_hz")
        if len(self._axes) > 1 and any(run.is_restart for other in self._axes for run in other.runs):
            problem = "the time of a channel steps back, and its channels have several times"
            raise UserError(str(self.path), problem, "split it there")
        runs = [run for run in axis.runs if self._samples(run) >= 2]
        if not runs:
            problem = f"holds no two samples within {axis.reach / MILLISECOND:g} ms"
            raise UserError(str(self.path), problem, _CHECK_TIME)
        return runs

    @property
    def is_resampled(self) -> bool:
        """Whether samples lie between those of the file."""
        axis = self._axes[self._main]
        return not axis.is_on_grid or abs(1.0 / axis.period / self.sample_rate - 1.0) > SAME_RATE

    def _samples(self, run: RowRun) -> int:
        span = (run.end - run.begin) * self.sample_rate
        return int(round(span) if self._axes[self._main].is_on_grid else math.floor(span + 1e-6)) + 1

    def _notes(self) -> Iterator[str]:
        axis = self._axes[self._main]
        rate = 1.0 / axis.period
        if not self._table.brings_time and TIME not in self._mapped:
            yield f"{self.path}: no column of the time: rows are placed by the rate stated, {self.sample_rate:g} Hz"
        if abs(rate / self.sample_rate - 1.0) > SAME_RATE:
            yield f"{self.path}: recorded at {rate:.6g} Hz, resampled to {self.sample_rate:g} Hz of sampling.rate_hz"
        elif not axis.is_on_grid:
            yield f"{self.path}: its stamps are not on a grid of {self.sample_rate:g} Hz: resampled by straight lines"
        elif axis.off_grid > 1e-3:
            yield f"{self.path}: stamps up to {axis.off_grid:.2g} samples off the grid are taken for it"
        for other in self._axes:
            if abs(axis.period / other.period - 1.0) > SAME_RATE:
                names = ", ".join(self._table.rasters[self._axes.index(other)])
                yield f"{self.path}: {names} at {1.0 / other.period:.6g} Hz, put between by straight lines"
        if axis.bridged:
            yield (
                f"{self.path}: {axis.bridged} gaps are bridged by straight lines, the longest of "
                f"{axis.longest_bridge / MILLISECOND:.4g} ms"
            )
        if self._has_limits:
            yield f"{self.path}: rows are pairs, left and right limit of an instant: the right one is read"
        elif axis.disordered:
            yield f"{self.path}: {axis.disordered} rows with a time that repeats or steps back a little are left out"
        if dropped := len(axis.runs) - len(self._runs):
            yield f"{self.path}: {dropped} single samples between gaps are left out"
        splits = []
        for before, after in pairwise(self._runs):
            what = f"{after.begin - before.end:.4g} s are missing"
            splits.append(f"after {before.end:.6g} s {'the time begins anew' if after.is_restart else what}")
        if splits:
            yield f"{self.path}: split into {len(self._runs)} stretches: {first_of(splits, between='; ')}"
