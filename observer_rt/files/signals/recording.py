"""A recording of an injector: an even time grid, the three inputs, and the measured rate if there is one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from observer_rt.config.injector_sections import Meaning
from observer_rt.config.signals import OPTIONAL_SIGNALS, OptionalRole
from observer_rt.core.plant.plant import show_slowly
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from observer_rt.model.surroundings import Surroundings

STEP_TOLERANCE = 0.2
"""Largest deviation of a step from the median, as a share: rounding gives 5 % (48 kHz in us), a lost sample 100 %."""

GRID_TOLERANCE = 0.5
"""Largest distance of a stamp from the line through the first and the last, in samples: the clock must not drift."""

MAX_SIGNIFICANT_DIGITS = 15
_ROWS = 1024  # of every block of so many rows only the two farthest from the grid are remembered

TRUTH_SUFFIX = ".truth.csv"  # added to the name of a simulated recording, for what no sensor measures
SHOTS_SUFFIX = ".shots.csv"  # in place of the suffix of a recording, for when the injector was energized
COMPANION_SUFFIXES = (TRUTH_SUFFIX, SHOTS_SUFFIX)  # of files beside recordings, which are none
EQUIDISTANT = (
    "a recording must be equidistant: cut it at the gap, resample it on an even grid, or describe it in [recording] "
    "of a bench file, which bridges and splits; of rounded stamps state rate_hz there, without [recording.time]"
)

OPTIONAL = ("injection_rate", "energizing", "chamber_pressure", "fuel_temperature")  # that a recording may lack
SIGNALS = ("rail_pressure", "needle_lift", "line_pressure", *OPTIONAL)


def is_needed(signal: str, has_energizing: bool) -> bool:
    """Whether a recording must have a signal; energizing stands in for the lift."""
    return signal not in OPTIONAL and not (signal == "needle_lift" and has_energizing)


Arrays = Mapping[str, Floats]
"""Time and signals by name, each (n,)."""


class UnevenTime(NamedTuple):
    """Place where a time column leaves its even grid."""

    row: int
    """Zero-based index of the first sample that is not where it should be."""
    problem: str


class TimeGrid:
    """Checks that a time column, which may come in parts, is an even, rising grid; keeps two stamps per block."""

    def __init__(self) -> None:
        self.samples = 0
        self._begin = self._last = 0.0
        self._period = self._step = 0.0  # median and mean of the steps in the first part
        self._extremes: list[tuple[int, float]] = []  # row, and its distance [s] from a grid of steps `_step`

    def take(self, time: Floats) -> UnevenTime | None:
        """Check the next stamps (n,) [s], at least two in the first part; returns the first that is off the grid."""
        not_finite = np.flatnonzero(~np.isfinite(time))
        if not_finite.size:
            return UnevenTime(self.samples + int(not_finite[0]), "the time is not a finite number")
        before = self._last
        if not self.samples:
            before = self._begin = float(time[0])
            self._period = float(np.median(np.diff(time)))
            self._step = float(time[-1] - time[0]) / (time.size - 1)
        first = 0 if self.samples else 1
        step = np.diff(time[first:], prepend=before)
        uneven = np.flatnonzero(~((step > 0.0) & (np.abs(step - self._period) <= STEP_TOLERANCE * self._period)))
        if uneven.size:
            row = int(uneven[0]) + first
            before = float(time[row - 1]) if row else before
            return UnevenTime(self.samples + row, _describe_step(before, float(time[row]), self._period))
        for start in range(0, time.size, _ROWS):
            part, number = time[start : start + _ROWS], self.samples + start
            distance = part - (self._begin + np.arange(number, number + part.size) * self._step)
            for row in (int(np.argmin(distance)), int(np.argmax(distance))):
                self._extremes.append((number + row, float(distance[row])))
        self.samples += time.size
        self._last = float(time[-1])
        return None

    def end(self) -> UnevenTime | None:
        """The row where the clock has drifted furthest; None if it lies within GRID_TOLERANCE."""
        row, distance = self._farthest()
        if distance <= GRID_TOLERANCE * self._period:
            return None
        drift, stamp = distance / self._period, self._begin + row * self._step
        return UnevenTime(row, f"uneven time: near {stamp:.9g} s stamps lie {drift:.2g} samples off an even grid")

    @property
    def sample_rate(self) -> float:
        """Sample rate [Hz] of the stamps so far, exact although printed stamps are rounded.

        The rate or period with the fewest digits inside their margin: 30 kHz in whole microseconds gives 30000.0.
        """
        span = self._last - self._begin
        rate = (self.samples - 1) / span
        stamp_error = self._farthest()[1] + 2.0 * float(np.spacing(max(abs(self._begin), abs(self._last))))
        return roundest(rate, 2.0 * stamp_error / span)

    def _farthest(self) -> tuple[int, float]:
        rows, distances = np.array(self._extremes).T
        step = (self._last - self._begin) / (self.samples - 1)
        off_line = np.abs(distances - rows * (step - self._step))
        worst = int(np.argmax(off_line))
        return int(rows[worst]), float(off_line[worst])


def _describe_step(before: float, after: float, period: float) -> str:
    if after <= before:
        verb = "repeats" if after == before else "steps back"
        return f"time {verb}: {before:.9g} s is followed by {after:.9g} s"
    kind = "gap in time" if after - before > period else "uneven time"
    return f"{kind}: step of {after - before:.6g} s after {before:.9g} s, elsewhere {period:.6g} s"


def roundest(rate: float, margin: float) -> float:
    """The rate, or inverse of a period, with the fewest significant digits within a relative margin of `rate`."""
    for digits in range(MAX_SIGNIFICANT_DIGITS - 1):
        for candidate in (float(f"{rate:.{digits}e}"), 1.0 / float(f"{1.0 / rate:.{digits}e}")):
            if abs(candidate / rate - 1.0) <= margin:
                return candidate
    return rate


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals of one recording, SI, float64 (n,), n >= 2; NaN in a signal means "not available".

    Raises `UserError` for different lengths, infinite values, or a `time` that is not an even, rising grid.
    """

    time: Floats
    rail_pressure: Floats
    needle_lift: Floats
    line_pressure: Floats
    injection_rate: Floats | None = None
    """Measured [m3/s]; None where no rate was measured."""
    path: Path | None = None
    """File of the recording; None for one made in memory."""
    meaning: Meaning | None = field(default=None, kw_only=True)
    """Meaning of a sample; None: as the bench file states, without one an instant."""
    meter: tuple[float, ...] | None = field(default=None, kw_only=True)
    """Time constants [s] of the meter of the injection rate; None: not known, taken for none."""
    energizing: Floats | None = field(default=None, kw_only=True)
    """More than 0.5 while the injector is energized; None where that was not recorded."""
    chamber_pressure: Floats | None = field(default=None, kw_only=True)
    """Absolute [Pa], a change between two injections; None where it is as in the injector file."""
    fuel_temperature: Floats | None = field(default=None, kw_only=True)
    """In the feed line [K], as the chamber pressure."""
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    """Notes on what its reader left out or found odd."""

    def __post_init__(self) -> None:
        name = str(self.path) if self.path is not None else "recording"
        for signal, values in self.signals.items():
            if values.shape != self.time.shape:
                problem = f"{values.size} samples, but the time has {self.time.size}"
                remedy = "give every signal one value for each time stamp (NaN where there is none)"
                raise UserError(f"{name}, {signal}", problem, remedy)
        if self.samples < 2:
            problem = "holds one sample only" if self.samples else "holds no sample"
            raise UserError(f"{name}, sample 0", problem, "record, or select, at least two samples")
        grid = TimeGrid()
        uneven = grid.take(self.time) or grid.end()
        if uneven is not None:
            raise UserError(f"{name}, sample {uneven.row}", uneven.problem, EQUIDISTANT)
        refuse_impossible(self.signals, lambda row: f"{name}, sample {row}")

    @property
    def signals(self) -> dict[str, Floats]:
        """The signals by name, without time and those that were not recorded."""
        return {name: values for name in SIGNALS if (values := getattr(self, name)) is not None}

    @property
    def has_lift(self) -> bool:
        """Whether the lift was recorded; else the needle is known by the energizing alone."""
        return bool(np.isfinite(self.needle_lift).any()) or self.energizing is None

    def without_lift(self) -> "Recording":
        """The recording as of a bench that does not measure the lift."""
        return replace(self, needle_lift=np.full(self.samples, np.nan))

    @property
    def recorded(self) -> tuple[str, ...]:
        """Names of the signals that were recorded."""
        return tuple(name for name in self.signals if self.has_lift or name != "needle_lift")

    @property
    def arrays(self) -> dict[str, Floats]:
        """Time and signals by name."""
        return {"time": self.time, **self.signals}

    def with_arrays(self, arrays: Arrays) -> Self:
        """Recording with other values of these names."""
        return replace(self, **arrays)  # type: ignore[arg-type]  # of no other field

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @cached_property
    def sample_rate(self) -> float:
        """Sample rate [Hz], found as `TimeGrid.sample_rate`."""
        grid = TimeGrid()
        grid.take(self.time)
        return grid.sample_rate


@dataclass(frozen=True, eq=False)
class Chunk(Recording):
    """Consecutive samples of a recording whose grid was checked as a whole; a single sample is allowed.

    sample_rate [Hz]; stretch: number of the stretch without a gap; first: number of the first sample in it.
    """

    sample_rate: float = 0.0
    stretch: int = 0
    first: int = 0

    def __post_init__(self) -> None:
        """Check nothing: the reader of a recording in parts has checked its grid."""


def shown_slowly(values: Floats, interval: float, *lags: float) -> Floats:
    """Values (n,) at every interval [s] behind first-order lags of these time constants [s], at rest before."""
    for lag in lags:
        shown = np.empty(values.size)
        show_slowly(np.ascontiguousarray(values), interval, lag, shown)
        values = shown
    return values


def refuse_impossible(signals: Arrays, place_of_row: Callable[[int], str]) -> None:
    """Raise `UserError` for the first value of signals (n,) [SI] that is infinite, or impossible round an injector.

    `place_of_row` turns a row from 0 into a location for users.
    """
    for signal, values in signals.items():
        odd, problem = np.isinf(values), "is infinite, or larger than any measurement"
        if signal in Surroundings._fields:
            carried = OPTIONAL_SIGNALS[OptionalRole(signal)]
            (lowest, highest), (factor, origin) = carried.possible, carried.to_si(carried.shown)
            odd = (values < lowest) | (values > highest)
            first, low, high = ((value - origin) / factor for value in (values[odd.argmax()], lowest, highest))
            problem = f"is {first:.4g}, not {low:g} to {high:g} {carried.shown}: {carried.wrong}"
        if odd.any():
            remedy = "write NaN, or leave the cell empty, where a value is not available"
            raise UserError(place_of_row(int(odd.argmax())), f"{signal} {problem}", remedy)
