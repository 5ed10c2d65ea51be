"""One recording of an injector: its even time grid, three inputs, and the measured rate where there is one.

The grid is checked, and the sample rate found behind printed time stamps.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.recording import Meaning
from observer_rt.foundation.compiled import compiled
from observer_rt.foundation.errors import UserError

STEP_TOLERANCE = 0.2
"""Largest deviation of one step from the median step, as a share of it: stamps are often printed with few
digits (48 kHz in whole microseconds is 5 % off), while a lost sample is 100 % off."""

GRID_TOLERANCE = 0.5
"""Largest distance of a stamp from the straight line through the first and the last, in samples: the clock
must not drift within a recording by as much as would move a sample into its neighbour's place."""

MAX_SIGNIFICANT_DIGITS = 15
_ROWS = 1024  # whose distances from the grid are remembered by their extremes


class UnevenTime(NamedTuple):
    """Where a time column leaves its even grid."""

    row: int
    """Zero-based index of the first sample that is not where it should be."""
    problem: str


def find_uneven_time(time: NDArray[np.float64]) -> UnevenTime | None:
    """First sample of `time` [s], shape (n,), that is not on an even, rising grid; None if all are."""
    not_finite = _not_finite(time)
    if not_finite is not None:
        return not_finite
    if time.size < 2:
        return UnevenTime(0, f"{time.size} sample(s); a recording needs at least 2")
    period = float(np.median(np.diff(time)))
    uneven = _uneven_step(time[1:], float(time[0]), period)
    if uneven is not None:
        return uneven._replace(row=1 + uneven.row)
    distance = np.abs(time - np.linspace(time[0], time[-1], time.size))
    row = int(np.argmax(distance))
    if distance[row] > GRID_TOLERANCE * period:
        drift = distance[row] / period
        return UnevenTime(row, f"uneven time: {time[row]:.9g} s lies {drift:.2g} samples off an even grid")
    return None


def sample_rate_of(time: NDArray[np.float64]) -> float:
    """Sample rate [Hz] of an even time column [s], shape (n,), n >= 2.

    Printed stamps are rounded, so the slope through them is only known within a margin. The result is the
    rate or period with the fewest significant digits inside that margin: 30 kHz printed in whole
    microseconds gives 30000.0, a period of 3 us gives 1 / 3e-6.
    """
    distance = float(np.max(np.abs(time - np.linspace(time[0], time[-1], time.size))))
    return _roundest_rate(time.size - 1, float(time[0]), float(time[-1]), distance)


class GridCheck:
    """The same of a time column that comes in parts: nearly nothing of it is remembered."""

    def __init__(self) -> None:
        self.samples = 0
        self._begin = self._last = 0.0
        self._period = 0.0
        self._residuals: list[tuple[int, float, float]] = []  # middle row, lowest and highest, of _ROWS rows
        self._whole: NDArray[np.float64] | None = None  # the first part, while it is the only one

    def take(self, time: NDArray[np.float64]) -> UnevenTime | None:
        """Go on with further stamps [s], (n,), n >= 1: at least two in the first part. The first one off the grid."""
        if not self.samples:
            return self._begin_with(time)
        uneven = _uneven_step(time, self._last, self._period)
        if uneven is not None:
            uneven = _not_finite(time) or uneven
            return uneven._replace(row=self.samples + uneven.row)
        self._whole = None
        self._note(time)
        return None

    def end(self) -> UnevenTime | None:
        """Where the clock drifted, if it did."""
        distance, row = self._farthest()
        if distance > GRID_TOLERANCE * self._period:
            drift = distance / self._period
            return UnevenTime(row, f"uneven time: stamps lie {drift:.2g} samples off an even grid")
        return None

    @property
    def sample_rate(self) -> float:
        """As `sample_rate_of` all."""
        if self._whole is not None:
            return sample_rate_of(self._whole)
        return _roundest_rate(self.samples - 1, self._begin, self._last, self._farthest()[0])

    def _begin_with(self, time: NDArray[np.float64]) -> UnevenTime | None:
        uneven = find_uneven_time(time)
        if uneven is not None:
            return uneven
        self._begin, self._period = float(time[0]), float(np.median(np.diff(time)))
        self._whole = time
        self._note(time)
        return None

    def _note(self, time: NDArray[np.float64]) -> None:
        for first in range(0, time.size, _ROWS):
            part, row = time[first : first + _ROWS], self.samples + first
            lowest, highest = _residuals(np.ascontiguousarray(part), self._begin, self._period, row)
            self._residuals.append((row + part.size // 2, lowest, highest))
        self.samples += time.size
        self._last = float(time[-1])

    def _farthest(self) -> tuple[float, int]:
        """Largest distance [s] from the line through the first and the last stamp, and about where."""
        slope = (self._last - self._begin) / (self.samples - 1)
        rows, lowest, highest = np.array(self._residuals).T
        line = rows * (slope - self._period)
        distances = np.maximum(np.abs(lowest - line), np.abs(highest - line))
        worst = int(np.argmax(distances))
        return float(distances[worst]), int(rows[worst])


def _roundest_rate(intervals: int, first: float, last: float, distance: float) -> float:
    """Of a number of intervals between two stamps [s], when stamps lie up to `distance` [s] off the line."""
    span = last - first
    rate = intervals / span
    stamp_error = distance + 2.0 * float(np.spacing(max(abs(first), abs(last))))
    margin = 2.0 * stamp_error / span
    for digits in range(1, MAX_SIGNIFICANT_DIGITS):
        for candidate in (_rounded(rate, digits), 1.0 / _rounded(1.0 / rate, digits)):
            if abs(candidate / rate - 1.0) <= margin:
                return candidate
    return rate


def _not_finite(time: NDArray[np.float64]) -> UnevenTime | None:
    """The first stamp that is no number."""
    rows = np.flatnonzero(~np.isfinite(time))
    return UnevenTime(int(rows[0]), "the time is not a finite number") if rows.size else None


def _uneven_step(time: NDArray[np.float64], before: float, period: float) -> UnevenTime | None:
    """As `_first_uneven`, in words."""
    row = int(_first_uneven(np.ascontiguousarray(time), before, period))
    if row < 0:
        return None
    return UnevenTime(row, _describe_step(float(time[row - 1]) if row else before, float(time[row]), period))


@compiled
def _first_uneven(time: NDArray[np.float64], before: float, period: float) -> int:
    """The first stamp that is not a period [s] after the one before it, which is `before` for row 0; -1: none."""
    for row in range(time.size):
        step = time[row] - before
        if not (step > 0.0 and abs(step - period) <= STEP_TOLERANCE * period):
            return row
        before = time[row]
    return -1


@compiled
def _residuals(time: NDArray[np.float64], begin: float, period: float, row: int) -> tuple[float, float]:
    """Lowest and highest distance [s] of stamps, those from `row` on, from a grid that begins at row 0."""
    lowest, highest = np.inf, -np.inf
    for number in range(time.size):
        residual = time[number] - (begin + (row + number) * period)
        lowest, highest = min(lowest, residual), max(highest, residual)
    return lowest, highest


def _describe_step(before: float, after: float, period: float) -> str:
    if after <= before:
        verb = "repeats" if after == before else "steps back"
        return f"time {verb}: {before:.9g} s is followed by {after:.9g} s"
    kind = "gap in time" if after - before > period else "uneven time"
    return f"{kind}: step of {after - before:.6g} s after {before:.9g} s, elsewhere {period:.6g} s"


def _rounded(value: float, significant_digits: int) -> float:
    return float(f"{value:.{significant_digits - 1}e}")


TRUTH_SUFFIX = ".truth.csv"  # added to the name of a simulated recording: what nobody could measure
EQUIDISTANT = (
    "a recording must be equidistant: cut it at the gap, resample it on an even grid, or describe it in [recording] "
    "of a bench file, which bridges and splits"
)


class Sampled(Protocol):
    """What was recorded somewhere at a sample rate: a recording, or the file of one that is read in parts."""

    @property
    def path(self) -> Path | None:
        """Where it was read from; None for one made in memory."""

    @property
    def sample_rate(self) -> float:
        """Of every signal [Hz]."""

    @property
    def meaning(self) -> Meaning | None:
        """What a sample is; None: as the bench file says, without one an instant."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals of one recording, SI units, every array float64 of shape (n,), n >= 2.

    NaN in a signal means "not available". Raises `UserError` when the arrays differ in length, a signal holds
    an infinite value or `time` is not an even, rising grid.
    """

    time: NDArray[np.float64]
    """[s]"""
    rail_pressure: NDArray[np.float64]
    """[Pa]"""
    needle_lift: NDArray[np.float64]
    """[m]"""
    line_pressure: NDArray[np.float64]
    """[Pa]"""
    injection_rate: NDArray[np.float64] | None = None
    """Measured [m3/s]; None where no rate was measured."""
    path: Path | None = None
    """Where the recording was read from; None for one made in memory."""
    meaning: Meaning | None = field(default=None, kw_only=True)
    """What a sample is; None: as the bench file says, without one an instant."""

    def __post_init__(self) -> None:
        name = str(self.path) if self.path is not None else "recording"
        for signal, values in self.signals.items():
            if values.shape != self.time.shape:
                raise UserError(
                    f"{name}, {signal}",
                    f"{values.size} samples, but the time has {self.time.size}",
                    "give every signal one value for each time stamp (NaN where there is none)",
                )
        check_samples(self.time, self.signals, lambda row: f"{name}, sample {row}")

    @property
    def signals(self) -> dict[str, NDArray[np.float64]]:
        """The signals by name, without time and without a rate that was not measured."""
        signals = {
            "rail_pressure": self.rail_pressure,
            "needle_lift": self.needle_lift,
            "line_pressure": self.line_pressure,
        }
        if self.injection_rate is not None:
            signals["injection_rate"] = self.injection_rate
        return signals

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @cached_property
    def sample_rate(self) -> float:
        """Sample rate [Hz], exact although printed time stamps are rounded."""
        return sample_rate_of(self.time)


@dataclass(frozen=True, eq=False)
class Chunk(Recording):
    """Samples of a recording that follow one another, be it one alone: its grid was checked as a whole.

    rate: sample rate [Hz]; stretch, first: number of its stretch, and of its first sample therein.
    """

    rate: float = 0.0
    stretch: int = 0
    first: int = 0

    def __post_init__(self) -> None:
        """Nothing: whoever reads a recording in parts has checked it."""

    @property
    def sample_rate(self) -> float:
        """As of the recording."""
        return self.rate


def check_samples(
    time: NDArray[np.float64],
    signals: dict[str, NDArray[np.float64]],
    place_of_row: Callable[[int], str],
) -> None:
    """Check an even time [s] and finite-or-NaN signals, all of shape (n,).

    `place_of_row` turns a zero-based row into what a user finds it by: a line of a file, a sample number.
    Raises `UserError` for the first violation.
    """
    if time.size < 2:
        problem = "holds no sample" if not time.size else "holds one sample only"
        raise UserError(place_of_row(0), problem, "record, or select, at least two samples")
    uneven = find_uneven_time(time)
    if uneven is not None:
        raise UserError(
            place_of_row(uneven.row),
            uneven.problem,
            EQUIDISTANT,
        )
    refuse_infinite(signals, place_of_row)


def refuse_infinite(signals: Mapping[str, NDArray[np.float64]], place_of_row: Callable[[int], str]) -> None:
    """Raise `UserError` for the first infinite value; arguments as of `check_samples`."""
    for signal, values in signals.items():
        infinite = np.flatnonzero(np.isinf(values))
        if infinite.size:
            raise UserError(
                place_of_row(int(infinite[0])),
                f"{signal} is infinite",
                "write NaN, or leave the cell empty, where a value is not available",
            )
