"""Recordings read in chunks: as long as the disk is large, in memory that does not depend on it."""

import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from observer_rt.config.injector_sections import Meaning
from observer_rt.engine.signal_survey import Survey
from observer_rt.files.signals.recording import OPTIONAL, Chunk, Recording
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats

SAMPLES_AT_ONCE = 1 << 14
LONGEST_HOLE = 1 << 24  # samples that may lie between two stretches put into one array


class Stretch(NamedTuple):
    """Samples of a file between which none is missing. start: time of the first one [s], as in the file."""

    start: float
    samples: int


class SignalStream(ABC):
    """The signals of one file, looked through once, to be read in parts as often as wanted."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        """The file; None for signals in memory."""
        self.stretches: tuple[Stretch, ...] = ()
        """At least one; several where the file was split."""
        self.sample_rate = 0.0
        """Sample rate of every signal [Hz]."""
        self.optional: tuple[str, ...] = ()
        """Signals that it has, of those that a recording need not have."""
        self.has_lift = True
        """Whether the lift was recorded; else the needle is known by the energizing alone."""
        self.notes: tuple[str, ...] = ()
        """Notes for the user on how the file was read."""
        self.survey = Survey()
        """Ranges of the signals."""
        self.names: dict[str, str] = {}
        """Names of signals in the file, where they are not as in a recording."""
        self.meaning: Meaning | None = None
        """Meaning of a sample; None: as the bench file states, without one an instant."""
        self.meter: tuple[float, ...] | None = None
        """Time constants [s] of the meter of a measured rate; None: not known."""
        self.origin = 0.0
        """Moment of time 0 [s since 1970], where the file's stamps say it."""
        self.details: tuple[str, ...] = ()
        """Details of how the file was read, for who looks at it."""

    @property
    def recorded(self) -> tuple[str, ...]:
        """Names of the signals that were recorded."""
        return ("rail_pressure", *(("needle_lift",) if self.has_lift else ()), "line_pressure", *self.optional)

    @property
    def samples(self) -> int:
        """Number of samples of all stretches."""
        return sum(stretch.samples for stretch in self.stretches)

    @abstractmethod
    def chunks(self) -> Iterator[Chunk]:
        """Iterate over all samples in order, stretch by stretch."""

    @property
    def grid_samples(self) -> int:
        """Number of samples of one grid under all stretches, those that lie between them included."""
        return self._places()[-1] + self.stretches[-1].samples

    def on_one_grid(self) -> Iterator[Chunk]:
        """Iterate over all samples in one stretch: NaN between stretches; a restart is a hole of one second."""
        if len(self.stretches) == 1:
            yield from self.chunks()
            return
        places, reached = self._places(), 0
        for part in self.chunks():
            start = places[part.stretch] + part.first
            for first in range(reached, start, SAMPLES_AT_ONCE):
                time = self._grid(first, min(start, first + SAMPLES_AT_ONCE))
                missing = dict.fromkeys(part.signals, np.full(time.size, np.nan))
                yield replace(part.with_arrays({**missing, "time": time}), stretch=0, first=first)
            reached = start + part.samples
            yield replace(part, time=self._grid(start, reached), stretch=0, first=start)

    def collected(self, most: int = sys.maxsize) -> Recording:
        """Recording of all samples in memory, as `on_one_grid`; of the first only where there are far more."""
        parts = takewhile(lambda part: part.first < most, self.on_one_grid())
        return replace(joined(list(parts)), meaning=self.meaning, meter=self.meter, notes=self.notes)

    def _grid(self, first: int, end: int) -> Floats:
        return self.stretches[0].start + np.arange(first, end) / self.sample_rate

    def _places(self) -> list[int]:
        places = [0]
        for before, after in zip(self.stretches, self.stretches[1:], strict=False):
            end = before.start + before.samples / self.sample_rate
            hole = round((after.start - end) * self.sample_rate)
            if hole > LONGEST_HOLE:
                problem = f"nothing was recorded from {end:.6g} s to {after.start:.6g} s"
                raise UserError(str(self.path), problem, "split the file there")
            places.append(places[-1] + before.samples + (hole if hole > 0 else round(self.sample_rate)))
        return places


Sampled: TypeAlias = Recording | SignalStream
"""Recording at a sample rate, in memory or read in parts."""


def joined(parts: Sequence[Recording]) -> Recording:
    """Parts of a recording that follow one another, in one piece."""
    return Recording(**_concatenated(parts), path=parts[0].path)  # type: ignore[arg-type]


def _concatenated(parts: Sequence[Recording]) -> dict[str, Floats]:
    if len(parts) == 1:
        return parts[0].arrays
    return {name: np.concatenate([getattr(part, name) for part in parts]) for name in parts[0].arrays}


class HeldSignals(SignalStream):
    """A recording in memory."""

    def __init__(self, recording: Recording) -> None:
        super().__init__(recording.path)
        self._recording = recording
        self.sample_rate = recording.sample_rate
        self.stretches = (Stretch(float(recording.time[0]), recording.samples),)
        self.optional = tuple(name for name in OPTIONAL if name in recording.signals)
        self.meaning, self.meter, self.has_lift = recording.meaning, recording.meter, recording.has_lift
        for first in range(0, recording.samples, SAMPLES_AT_ONCE):  # what is in the cache
            rows = slice(first, first + SAMPLES_AT_ONCE)
            self.survey.take_together({name: recording.signals[name][rows] for name in recording.recorded})

    def chunks(self) -> Iterator[Chunk]:
        """Views of the recording."""
        chunk = Chunk(**self._recording.arrays, path=self.path, sample_rate=self.sample_rate)  # type: ignore[arg-type]
        for first in range(0, chunk.samples, SAMPLES_AT_ONCE):
            yield cut(chunk, first, first + SAMPLES_AT_ONCE)

    def collected(self, most: int = sys.maxsize) -> Recording:
        """The recording, whole."""
        recording = self._recording
        return recording if recording.meaning is self.meaning else replace(recording, meaning=self.meaning)


def cut(chunk: Chunk, start: int, end: int) -> Chunk:
    """Samples [start, end) of a chunk."""
    arrays = {name: values[start:end] for name, values in chunk.arrays.items()}
    return replace(chunk.with_arrays(arrays), first=chunk.first + start)


def copied(chunk: Chunk) -> Chunk:
    """Copy of the samples without the larger chunk that they were cut from."""
    return chunk.with_arrays({name: values.copy() for name, values in chunk.arrays.items()})


def followed(before: Chunk, after: Chunk) -> Chunk:
    """A chunk and the one that follows it, as one."""
    return before.with_arrays(_concatenated((before, after)))
