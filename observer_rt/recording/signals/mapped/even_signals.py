"""Files that must be on an even grid as they are: looked through, then read in parts, or both in one go."""

from collections import deque
from collections.abc import Iterator
from itertools import chain, islice, zip_longest

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.mapped.table import Table, TablePart
from observer_rt.recording.signals.mapped.table_signals import TableSignals
from observer_rt.recording.signals.recording import EQUIDISTANT, Chunk
from observer_rt.recording.signals.stream import Stretch
from observer_rt.recording.signals.time_grid import GridCheck, UnevenTime


class OtherRateError(Exception):
    """A file that was read in one go has another sample rate than its first part told."""


class EvenSignals(TableSignals):
    """A table in one stretch, its stamps as they are. Raises `UserError` for an uneven time or an infinite value."""

    def __init__(self, table: Table, in_one_go: bool = False) -> None:
        """in_one_go: look at the first part only, and at all others when they are read, which is once.

        Stretches and the ranges of all signals are known then. What is wrong with the file is raised there, too, and
        `OtherRateError`.
        """
        super().__init__(table)
        self._in_one_go = in_one_go
        grid = GridCheck()
        parts = self._checked_parts(grid)
        if in_one_go:
            first = list(islice(parts, 1))
            self.rate = grid.sample_rate
            self._coming = chain(first, parts)
        else:
            deque(parts, 0)

    def chunks(self) -> Iterator[Chunk]:
        """Read anew, or in the one go."""
        first = 0
        for part in self._coming if self._in_one_go else self._filled_parts():
            yield self._chunk(part.time, part.signals, 0, first)
            first += part.time.size

    def _checked_parts(self, grid: GridCheck) -> Iterator[TablePart]:
        """All parts, each checked before it is given."""
        start = 0.0
        for part in self._filled_parts():
            if not grid.samples:
                start = float(part.time[0])
                self._refuse_short(part.time.size)
            row = grid.samples
            self._refuse(grid.take(part.time))
            self._look_at(part, row, 0)
            yield part
        self._refuse_short(grid.samples)
        self._refuse(grid.end())
        expected, self.rate = self.rate, grid.sample_rate
        self.stretches = (Stretch(start, grid.samples),)
        if self._in_one_go and self.rate != expected:
            raise OtherRateError

    def _filled_parts(self) -> Iterator[TablePart]:
        """All parts, joined so that none but the last is a single sample, which has no rate."""
        waiting: TablePart | None = None
        for part in self._all_columns():
            if waiting is not None:
                before = waiting
                signals = {
                    name: np.concatenate((before.signals[name], values))
                    for name, values in part.signals.items()
                }
                part = TablePart(np.concatenate((before.time, part.time)), signals)
            waiting = part if part.time.size < 2 else None
            if waiting is None:
                yield part
        if waiting is not None:
            yield waiting

    def _all_columns(self) -> Iterator[TablePart]:
        """The parts of all time axes, which must have the same stamps."""
        names = self._table.rasters
        for first, *others in zip_longest(*(self._parts(raster) for raster in range(len(names)))):
            for other, (name, *_) in zip(others, names[1:], strict=True):
                if first is None or other is None or not np.array_equal(first.time, other.time):
                    raise UserError(
                        f"{self.path}, {self._table.label(name)}",
                        f"its time stamps differ from those of {names[0][0]}",
                        "record the channels in one group, resample them on one time grid, or describe them in "
                        "[recording] of a bench file, which resamples",
                    )
            yield TablePart(
                first.time, {name: each for part in (first, *others) for name, each in part.signals.items()}
            )

    def _refuse_short(self, samples: int) -> None:
        if samples < 2:
            problem = "holds one sample only" if samples else "holds no sample"
            raise UserError(self._table.place(0, 0), problem, "record, or select, at least two samples")

    def _refuse(self, uneven: UnevenTime | None) -> None:
        if uneven is not None:
            raise UserError(self._table.place(uneven.row, 0), uneven.problem, EQUIDISTANT)
