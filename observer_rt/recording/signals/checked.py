"""Files that must be on an even grid as they are: looked through, then read in chunks, or both at once."""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.recording import EQUIDISTANT, Chunk, refuse_infinite
from observer_rt.recording.signals.stream import SignalStream, Stretch
from observer_rt.recording.signals.time_grid import GridCheck, UnevenTime


class OtherRateError(Exception):
    """A file that was read in one go has another sample rate than its first part told."""


Arrays = Mapping[str, NDArray[np.float64]]
"""A part of a file: `time` and signals (SI), each (n,)."""


class CheckedGrid:
    """Takes a file's parts in order and gives its stream what is then known of it."""

    def __init__(self, stream: SignalStream, place_of_row: Callable[[int], str]) -> None:
        """place_of_row: turns a zero-based row into what a user finds it by."""
        self._stream = stream
        self._place = place_of_row
        self._grid = GridCheck()
        self._start = 0.0

    def take(self, arrays: Arrays) -> None:
        """Check a part. Raises `UserError` for an uneven time or an infinite value."""
        signals = {name: values for name, values in arrays.items() if name != "time"}
        time, row = arrays["time"], self._grid.samples
        if not row:
            self._refuse_short(time.size)
            self._start = float(time[0])
        self._refuse(self._grid.take(time))
        refuse_infinite(signals, lambda inside: self._place(row + inside))
        for name, values in signals.items():
            self._stream.survey.take(name, values)

    def end(self) -> None:
        """All was taken."""
        if not self._grid.samples:
            self._refuse_short(0)
        self._refuse(self._grid.end())
        self._stream.rate = self.sample_rate
        self._stream.stretches = (Stretch(self._start, self._grid.samples),)

    @property
    def sample_rate(self) -> float:
        """As far as it was taken [Hz]."""
        return self._grid.sample_rate

    def _refuse_short(self, samples: int) -> None:
        if samples < 2:
            problem = "holds one sample only" if samples else "holds no sample"
            raise UserError(self._place(0), problem, "record, or select, at least two samples")

    def _refuse(self, uneven: UnevenTime | None) -> None:
        if uneven is not None:
            raise UserError(self._place(uneven.row), uneven.problem, EQUIDISTANT)


class GridSignals(SignalStream):
    """A file in one stretch, in a layout of our own; a subclass reads it, and looks at it when made."""

    def __init__(self, path: Path, in_one_go: bool) -> None:
        """in_one_go: look at the first part only, and at all others when they are read, which is once.

        Stretches and the ranges of all signals are known then. What is wrong with the file is raised there, too, and
        `OtherRateError`.
        """
        super().__init__(path)
        self._file = path
        self._in_one_go = in_one_go
        self._coming: Iterator[Arrays] = iter(())  # what is read in one go

    @abstractmethod
    def _parts(self) -> Iterator[Arrays]:
        """Read the file, in parts of any length."""

    @abstractmethod
    def _place(self, row: int) -> str:
        """What a user finds a zero-based row by."""

    def _look(self) -> None:
        """Check all parts, or the first one. Raises `UserError` as `CheckedGrid`."""
        checked = CheckedGrid(self, self._place)
        parts = self._checked_parts(checked)
        if self._in_one_go:
            first = list(islice(parts, 1))
            self.rate = checked.sample_rate
            self._coming = chain(first, parts)
        else:
            deque(parts, 0)

    def _filled_parts(self) -> Iterator[Arrays]:
        """All parts, joined so that none is empty and none but the last a single sample, which has no rate."""
        waiting: Arrays = {}
        for arrays in self._parts():
            if waiting:
                arrays = {name: np.concatenate((waiting[name], values)) for name, values in arrays.items()}
            waiting = arrays if arrays["time"].size < 2 else {}
            if not waiting:
                yield arrays
        if waiting and waiting["time"].size:
            yield waiting

    def _checked_parts(self, checked: CheckedGrid) -> Iterator[Arrays]:
        """All parts, each checked before it is given."""
        for arrays in self._filled_parts():
            self.has_rate = "injection_rate" in arrays
            checked.take(arrays)
            yield arrays
        expected = self.rate
        checked.end()
        if self._in_one_go and self.rate != expected:
            raise OtherRateError

    def chunks(self) -> Iterator[Chunk]:
        """Read anew, or in the one go."""
        first = 0
        for arrays in self._coming if self._in_one_go else self._filled_parts():
            yield Chunk(
                arrays["time"],
                arrays["rail_pressure"],
                arrays["needle_lift"],
                arrays["line_pressure"],
                arrays.get("injection_rate"),
                self.path,
                self.sample_rate,
                first=first,
            )
            first += arrays["time"].size
