"""Rates of stamps; rows that follow each other at a stated rate are placed by it where their stamps are rounded."""

from dataclasses import dataclass

import numpy as np

from observer_rt.files.signals.recording import roundest
from observer_rt.files.signals.table import Values

AGREES = 0.01  # relative, of the rate stated and that by the rounded stamps
GAP = 1.5  # periods and steps of rounding from stamp to stamp, beyond which rows are missing
_UNSEEN = 0.2  # samples, by which stamps of a grid may lie beside it at the end
_REPEATED = 0.1  # of the steps, beyond which stamps are rounded
_BACK, _GAPS = 0.01, 0.1  # of the steps, that may step back, and be gaps


class StampPace:
    """Takes rounded stamps [s] in order. rate: stated [Hz]; rounding: step from one stamp to another [s]."""

    def __init__(self, rate: float, rounding: float) -> None:
        self._rate, self._rounding = rate, rounding
        self._begin = self._stamp = np.nan
        self._since = 0  # rows since the last gap
        self._steps, self._runs, self._span = 0, 0, 0.0

    @property
    def agrees(self) -> bool:
        """Whether the stamps that were taken have the rate that is stated, but for their rounding."""
        tolerance = AGREES * self._span + self._rounding * self._runs
        return self._span > 0.0 and abs(self._steps / self._rate - self._span) <= tolerance

    def take(self, time: Values) -> Values:
        """Stamps (n,) by the rate; they begin anew where rows are missing or the time steps back."""
        step = np.diff(time, prepend=self._stamp)
        together = (step >= 0.0) & (step <= GAP * (self._rounding + 1.0 / self._rate))
        self._steps += int(np.count_nonzero(together))
        self._span += float(step[together].sum())
        row = np.arange(time.size)
        begins = np.flatnonzero(~together)
        self._runs += begins.size
        before = np.searchsorted(begins, row, side="right") - 1  # -1: as the rows before
        first = np.append(begins, -self._since)[before]
        begin = np.append(time[begins], self._begin)[before]
        placed: Values = begin + (row - first) / self._rate
        self._stamp, self._begin, self._since = float(time[-1]), float(begin[-1]), int(time.size - first[-1])
        return placed


@dataclass(frozen=True)
class Stamps:
    """How a time goes on, in its own unit. period: of the rows; rounding: of the stamps, 0 where it is less than a
    period; rows: after which a wrong rate would show."""

    period: float
    rounding: float
    rows: int

    def rate(self, unit: float) -> float:
        """Rate [Hz] in a unit [s]: the roundest that the stamps allow, or the one of the roundest period."""
        return roundest(1.0 / (self.period * unit), (_UNSEEN + self.rounding / self.period) / self.rows)


def stamps_of(values: Values) -> Stamps | None:
    """How a column (n,) goes on as a time; None where it does not rise nearly everywhere."""
    if values.size < 3 or not np.isfinite(values).all():
        return None
    step = np.diff(values)
    rising = step[step > 0.0]
    if rising.size < 2 or np.count_nonzero(step < 0.0) > _BACK * step.size:
        return None
    usual = float(np.median(rising))
    together = step[(step >= 0.0) & (step <= GAP * usual)]
    if together.size < (1.0 - _GAPS) * step.size or not together.any():
        return None
    is_rounded = np.count_nonzero(step == 0.0) > _REPEATED * step.size
    return Stamps(float(together.mean()), usual if is_rounded else 0.0, together.size)
