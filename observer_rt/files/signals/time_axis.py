"""The time of a file: stamps of a calendar as seconds, their rate, gaps and restarts, places on a grid."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from observer_rt.config.injector_sections import TimeConfig
from observer_rt.files.signals.recording import roundest
from observer_rt.files.signals.table import TablePart
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Bools, Floats, Ints

ISO_8601 = "ISO8601"  # as pandas calls it
TIMEDELTA = "N days HH:MM:SS"  # as pandas writes time that has passed
_ISO = re.compile(r"\s*\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
_TIMEDELTA = re.compile(r"\s*-?\d+ days? [-+]?\d\d:\d\d:\d\d")
NO_MOMENT = np.iinfo(np.int64).min  # as NumPy and pandas have it
_DATE = re.compile(r"ISO8601|%[aAbBcdDFGjmsuUVWxyY]")  # in the format of stamps
_DAY, _HOUR = 86_400_000_000_000, 3_600_000_000_000  # ns
_UNSEEN = 0.2  # samples, by which stamps of a grid may lie beside it at the end
_BACK, _GAPS = 0.01, 0.1  # of the steps, that may not rise, and be gaps
_PAIRED = 0.45  # of the rows, whose time the next one has, too: each but a few
_LIMITED = 0.1  # of the other difference: that of a pair, or between two pairs
SNAPPED = 0.4  # samples off an even grid up to which a stamp is taken for the grid's
LOST = 1.5  # periods from stamp to stamp, beyond which samples are missing
_CLOCK = 2e-3  # relative: no clock is so wrong
_NEAR = 0.1  # relative: so near another rate, no recorder is set but to a usual one
_USUAL = 3.2e3  # Hz: converters of sound and vibration take multiples, 48, 51.2, 96 or 102.4 kHz


class Calendar(NamedTuple):
    """Format of the stamps, as of strptime, `ISO_8601`, or `TIMEDELTA`. Without a zone they count as UTC."""

    form: str

    @property
    def has_date(self) -> bool:
        """Whether the stamps are more than a time of day."""
        return _DATE.search(self.form) is not None

    def nanoseconds(self, cells: Any) -> Ints:
        """Nanoseconds since 1970, or since midnight, of stamps (n,); `NO_MOMENT` for invalid ones."""
        import pandas  # slow to import

        if self.form == TIMEDELTA:
            passed = pandas.to_timedelta(pandas.Series(cells), errors="coerce").to_numpy("timedelta64[ns]")
            return np.asarray(passed.astype(np.int64))
        try:
            stamps = pandas.to_datetime(pandas.Series(cells), format=self.form, errors="coerce", utc=True)
        except ValueError as error:
            remedy = "write it as '%d.%m.%Y %H:%M:%S.%f', with the letters of strptime"
            raise UserError(f"[recording.time] format = '{self.form}'", str(error), remedy) from None
        moments: Ints = stamps.dt.tz_localize(None).to_numpy("datetime64[ns]").astype(np.int64)
        return moments if self.has_date else np.where(moments == NO_MOMENT, NO_MOMENT, moments % _DAY)

    def as_text(self, origin: int) -> str:
        """Description of how the stamps are read."""
        form = "ISO 8601" if self.form == ISO_8601 else f"'{self.form}'"
        begin = str(np.datetime64(origin, "ns"))
        return f"calendar stamps as {form}, counted from {begin if self.has_date else begin.partition('T')[2]}"


def calendar_of(time: TimeConfig | None, cells: Iterable[str]) -> Calendar | None:
    """Calendar of a column: as stated, or as a cell looks where no unit is stated. None: numbers."""
    if time is not None and time.format is not None:
        return Calendar(time.format)
    forms = {ISO_8601: _ISO, TIMEDELTA: _TIMEDELTA} if time is None or time.unit is None else {}
    cells = list(cells)
    return next((Calendar(form) for form, pattern in forms.items() if any(map(pattern.match, cells))), None)


def seconds_since(origin: int, moments: Ints, of_day: bool = False) -> Floats:
    """Moments [ns] (n,) as exact seconds since `origin` [ns]; NaN if invalid. of_day: may pass midnight once."""
    after = moments - origin
    if of_day:
        after = (after + _HOUR) % _DAY - _HOUR  # a clock that was set back steps back by less
    return np.where(moments == NO_MOMENT, np.nan, after / 1e9)


def rate_of(stamps: Floats) -> float | None:
    """Rate [Hz] of stamps [s] (n,), the roundest they allow, or of the roundest period; None for disordered ones."""
    step = np.diff(stamps)
    rising = step[step > 0.0]
    if not np.isfinite(stamps).all() or rising.size < max(2.0, (1.0 - _BACK) * step.size):
        return None
    together = rising[rising <= LOST * float(np.median(rising))]
    if together.size < (1.0 - _GAPS) * step.size:
        return None
    return roundest(1.0 / float(together.mean()), _UNSEEN / together.size)


def has_limits(part: TablePart) -> bool:
    """Whether rows are pairs of one instant, the left and the right limit, as simulations write them.

    A state is equal in a pair, a held input from pair to pair; what was measured, with rounded stamps, in neither.
    """
    first = np.flatnonzero(np.diff(part.time) == 0.0)
    if first.size <= _PAIRED * part.time.size or np.any(np.diff(first) == 1):
        return False
    changes = (np.abs(np.diff(values)) for values in part.signals.values())
    both = [(np.nansum(change[first]), np.nansum(change[first[1:] - 1])) for change in changes]
    return all(min(within, across) <= _LIMITED * max(within, across) for within, across in both)


def refuse_wrong_clock(path: Path | None, rate: float, expected: float, of: str) -> None:
    """Raise `UserError` for a rate of stamps [Hz] that is likely `expected` [Hz] by a wrong clock; of: its source."""
    off = abs(rate / expected - 1.0)
    if _CLOCK < off < _NEAR and abs(math.remainder(rate, _USUAL)) > _CLOCK:
        raise UserError(
            f"{path or 'recording'}: time",
            f"its stamps say {rate:g} Hz, {of} {expected:g} Hz: likely a clock is off by {off:.1%}, "
            "and masses by twice that",
            f"correct the stamps, or state rate_hz = {expected:g} without [recording.time]; if they are right, state "
            f"rate_hz = {rate:.9g} in [recording] or [sampling] of a bench file, and fit the model at it",
        )


@dataclass
class RowRun:
    """Rows without a gap that is not bridged. begin, end: their first and last stamp [s]; rows [first, last]."""

    first: int
    last: int
    begin: float
    end: float
    is_restart: bool


class AxisSurvey:
    """Takes the stamps of one axis in order, and grids its values; rate [Hz]: of the grid; bridge [s]: of gaps."""

    def __init__(self, rate: float, bridge: float) -> None:
        self._rate, self._bridge = rate, bridge
        self.period = 0.0
        """Period of the stamps [s], their median in the first part."""
        self.runs: list[RowRun] = []
        self.bridged = 0
        """Gaps that are closed by a straight line."""
        self.longest_bridge = 0.0  # s
        self.disordered = 0
        """Stamps that repeat, of which the last counts, or step back a little: left out."""
        self.off_grid = 0.0
        """Largest distance of a stamp from a grid that begins with its run [samples]."""
        self.rows = 0

    @property
    def reach(self) -> float:
        """Longest time from stamp to stamp over which values are interpolated [s]."""
        return self._bridge + LOST * self.period

    @property
    def is_on_grid(self) -> bool:
        """Whether the stamps are the grid's but for their jitter."""
        return self.off_grid <= SNAPPED

    def take(self, time: Floats) -> None:
        """Go on with stamps [s], (n,), n >= 1, all finite."""
        if not self.period:
            rising = np.diff(time)
            rising = rising[rising > 0.0]
            self.period = float(np.median(rising)) if rising.size else 0.0
        step = np.diff(time, prepend=self.runs[-1].end if self.runs else np.nan)
        limit = max(self.reach, self.period)
        breaks = np.flatnonzero(~((step <= limit) & (step >= -limit)))
        gaps = step[(step > LOST * self.period) & (step <= limit)]
        self.bridged += gaps.size
        self.longest_bridge = max(self.longest_bridge, float(gaps.max()) if gaps.size else 0.0)
        self.disordered += int(np.count_nonzero((step <= 0.0) & (step >= -limit)))
        edges = [*([0] if not breaks.size or breaks[0] else []), *breaks.tolist(), time.size]
        for first, end in pairwise(edges):
            if first in breaks:
                stamp, row = float(time[first]), self.rows + first
                self.runs.append(RowRun(row, row, stamp, stamp, bool(step[first] < 0.0)))
            run = self.runs[-1]
            run.last = self.rows + end - 1
            run.end = max(run.end, float(time[first:end].max()))
            position = (time[first:end] - run.begin) * self._rate
            self.off_grid = max(self.off_grid, float(np.abs(position - np.rint(position)).max()))
        self.rows += time.size

    def knots(self, time: Floats, begin: float) -> tuple[Floats, Bools]:
        """Places of stamps [s] on the grid that begins at `begin`, and which of them rise: the last of equal ones."""
        position = (time - begin) * self._rate
        if self.is_on_grid:
            position = np.rint(position)
        rises = position >= np.maximum.accumulate(position)
        rises[rises] = np.diff(position[rises], append=np.inf) > 0.0
        return position, rises

    def at(self, grid: Floats, position: Floats, values: Floats) -> Floats:
        """Floats at places of the grid by lines between knots; NaN beyond the knots, and between distant ones."""
        available = ~np.isnan(values)
        position, values = position[available], values[available]
        if not position.size:
            return np.full(grid.size, np.nan)
        result = np.interp(grid, position, values, left=np.nan, right=np.nan)
        after = np.minimum(np.searchsorted(position, grid), position.size - 1)
        is_far = position[after] - position[np.maximum(after - 1, 0)] > self.reach * self._rate + 1e-6
        result[(position[after] != grid) & is_far] = np.nan
        return result
