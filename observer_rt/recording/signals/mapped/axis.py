"""One time axis of a foreign file looked through: its rate, its gaps, where it begins anew, how it fits the grid."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from observer_rt.recording.signals.mapped.table import Values

SNAPPED = 0.4  # samples off an even grid up to which a stamp is taken for the grid's
LOST = 1.5  # periods from stamp to stamp, beyond which samples are missing


@dataclass
class RowRun:
    """Rows without a gap that is not bridged. begin, end: their first and last stamp [s]; rows [first, last]."""

    first: int
    last: int
    begin: float
    end: float
    is_restart: bool


class AxisSurvey:
    """Takes the stamps of one axis in order. rate: of the grid they go onto [Hz]; bridge: longest gap [s] closed."""

    def __init__(self, rate: float, bridge: float) -> None:
        self._rate, self._bridge = rate, bridge
        self.period = 0.0
        """Of the stamps [s], their median in the first part."""
        self.runs: list[RowRun] = []
        self.bridged = 0
        """Gaps that are closed by a straight line."""
        self.longest_bridge = 0.0  # s
        self.disordered = 0
        """Stamps that repeat, or step back a little: left out."""
        self.off_grid = 0.0
        """Largest distance of a stamp from a grid that begins with its run [samples]."""
        self._row = 0

    @property
    def reach(self) -> float:
        """Longest time from stamp to stamp over which values are interpolated [s]."""
        return self._bridge + LOST * self.period

    @property
    def is_on_grid(self) -> bool:
        """Whether the stamps are the grid's but for their jitter."""
        return self.off_grid <= SNAPPED

    def take(self, time: Values) -> None:
        """Go on with stamps [s], (n,), n >= 1, all finite."""
        if not self.period:
            rising = np.diff(time)
            rising = rising[rising > 0.0]
            self.period = float(np.median(rising)) if rising.size else 0.0
        before = self.runs[-1].end if self.runs else np.nan
        step = np.diff(time, prepend=before)
        limit = max(self.reach, self.period)
        breaks = np.flatnonzero(~((step <= limit) & (step >= -limit)))
        gaps = step[(step > LOST * self.period) & (step <= limit)]
        self.bridged += gaps.size
        self.longest_bridge = max(self.longest_bridge, float(gaps.max()) if gaps.size else 0.0)
        self.disordered += int(np.count_nonzero((step <= 0.0) & (step >= -limit)))
        edges = [*([0] if not breaks.size or breaks[0] else []), *breaks.tolist(), time.size]
        for first, end in pairwise(edges):
            if first in breaks:
                self._begin(float(time[first]), self._row + first, bool(step[first] < 0.0))
            self._go_on(time[first:end], self._row + end - 1)
        self._row += time.size

    def _begin(self, stamp: float, row: int, is_restart: bool) -> None:
        self.runs.append(RowRun(row, row, stamp, stamp, is_restart))

    def _go_on(self, time: Values, last: int) -> None:
        run = self.runs[-1]
        run.last = last
        run.end = max(run.end, float(time.max()))
        place = (time - run.begin) * self._rate
        self.off_grid = max(self.off_grid, float(np.abs(place - np.rint(place)).max()))


class Cursor:
    """Rows of one axis as knots of straight lines, for grid places that only rise."""

    def __init__(self, rate: float, reach: float, is_on_grid: bool) -> None:
        """reach [s]: as of `AxisSurvey`."""
        self._rate = rate
        self._reach = reach * rate + 1e-6
        self._is_on_grid = is_on_grid

    def knots(self, time: Values, begin: float) -> tuple[Values, NDArray[np.bool_]]:
        """Places of stamps [s] on the grid that begins at `begin`, and which of them rise."""
        place = (time - begin) * self._rate
        if self._is_on_grid:
            place = np.rint(place)
        rises = np.ones(place.size, np.bool_)
        rises[1:] = place[1:] > np.maximum.accumulate(place)[:-1]
        return place, rises

    def at(self, grid: Values, place: Values, values: Values) -> Values:
        """Values at places of the grid: NaN beyond the knots, and where neighbours are too far apart."""
        there = ~np.isnan(values)
        place, values = place[there], values[there]
        if not place.size:
            return np.full(grid.size, np.nan)
        result = np.interp(grid, place, values, left=np.nan, right=np.nan)
        after = np.minimum(np.searchsorted(place, grid), place.size - 1)
        before = np.maximum(after - 1, 0)
        result[(place[after] != grid) & (place[after] - place[before] > self._reach)] = np.nan
        return result
