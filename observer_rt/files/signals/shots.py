"""The table of shots beside a recording, as an ECU exports it: when the injector was energized, a row a shot."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.injector import RecordingConfig, TimeConfig
from observer_rt.files.signals.csv_dialect import dialect_of
from observer_rt.files.signals.csv_table import CsvTable
from observer_rt.files.signals.recording import SHOTS_SUFFIX
from observer_rt.files.signals.table import TIME, Heading, Values
from observer_rt.files.signals.table_signals import TableSignals
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MILLISECOND, TIME_UNITS, spelled

_START, _LENGTH = "start", "length"


@dataclass(frozen=True, eq=False)
class Shots:
    """Shots of one recording, (k,), in order. start, end [s]: by its time."""

    table: CsvTable
    start: Values
    end: Values

    @classmethod
    def read(cls, recording: Path) -> Self | None:
        """Table of a recording, `run.shots.csv` beside `run.csv`; None without one.

        Raises `UserError` for headings without names or units, and a row that is no shot after the one above it.
        """
        path = recording.with_suffix(SHOTS_SUFFIX)
        if not path.is_file():
            return None
        with file_errors(path):
            dialect = dialect_of(path, None, fewest=2)
            location, headings = f"{path}, line {dialect.heading}", dialect.headings
            columns = {TIME: _column(_START, headings, location), "energizing": _column(_LENGTH, headings, location)}
            others = dict.fromkeys(("rail_pressure", "line_pressure"))
            table = CsvTable(path, RecordingConfig.model_construct(None, **others, **columns))
            parts = [(part.time, part.signals["energizing"]) for part in table.parts(0)]
        units = [[TIME_UNITS[column.unit or ""]] for column in columns.values()]
        start, length = np.concatenate(parts, axis=1) * units
        shots = cls(table, start, start + length)
        shots._refuse(~np.isfinite(shots.end), "has no start, or no length", "complete the row, or delete it")
        shots._refuse(~(length > 0.0), "has a length that is not above 0", "state how long it was energized")
        unsorted = np.diff(start, prepend=-np.inf) < 0.0
        shots._refuse(unsorted, "starts before the one above it", "sort the rows by their start")
        overlapping = start < np.concatenate(([-np.inf], shots.end[:-1]))
        shots._refuse(overlapping, "starts before the one above it has ended", "correct start or length")
        return shots

    def tell(self, stream: TableSignals) -> None:
        """Tell the stream of its recording when that was energized.

        Raises `UserError` for shots outside the recording, and where a column tells it, too, or the time is not one.
        """
        problem, ends = "", [each.start + each.samples / stream.rate for each in stream.stretches]
        if "energizing" in stream.optional:
            problem = "is beside a recording with a column 'energizing': rename or delete one of them"
        elif any(after.start < end for end, after in zip(ends, stream.stretches[1:], strict=False)):
            problem = "has starts by a time that begins anew: split its recording there"
        if problem:
            raise UserError(str(self.table.path), *problem.split(": "))
        begin, end = stream.stretches[0].start, ends[-1]
        span = f"is not within its recording, {begin:.6g} to {end:.6g} s"
        is_outside = (self.start < begin) | (self.end > end)
        self._refuse(is_outside, span, "count the start by the recording's time; delete shots that it does not have")
        lengths = (self.end - self.start) / MILLISECOND
        said = f"{self.table.path}: {lengths.size} shots of {lengths.min():.4g} to {lengths.max():.4g} ms"
        stream.energized, stream.optional = self._level, (*stream.optional, "energizing")
        stream.notes += (said,)
        stream.details = (*(stream.details or (f"{stream.path}: our own layout",)), said)

    def _level(self, time: Values, interval: float) -> Values:
        """1 at those of the samples (n,) [s] at which the injector is energized, else 0; edges go to the nearest."""
        middle = time + 0.5 * interval
        last = np.searchsorted(self.start, middle, side="right") - 1
        return np.asarray((last >= 0) & (middle < self.end[last]), np.float64)

    def _refuse(self, rows: NDArray[np.bool_], problem: str, remedy: str) -> None:
        """Raise `UserError` for the first of the rows (k,) that are so."""
        for row in np.flatnonzero(rows)[:1].tolist():
            raise UserError(self.table.location(row, 0), f"the shot of {self.start[row]:.6g} s {problem}", remedy)


def _column(word: str, headings: Sequence[Heading], location: str) -> TimeConfig:
    """Column of this name. Raises `UserError` where no heading names it with a unit."""
    for heading in headings:
        name, _, end = heading.name.lower().partition("_")
        unit = spelled(heading.unit or end, TIME_UNITS)
        if name.strip() == word and unit:
            return TimeConfig(column=heading.name, unit=unit)
    shown = ", ".join(heading.name for heading in headings)
    problem = f"no column is named {word} with a unit of time: it has {shown}"
    raise UserError(location, problem, f"write names and units above the numbers: {_START}_s,{_LENGTH}_us")
