"""The even time grid of a recording: its check, and the sample rate behind printed time stamps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

STEP_TOLERANCE = 0.2
"""Largest deviation of one step from the median step, as a share of it: stamps are often printed with few
digits (48 kHz in whole microseconds is 5 % off), while a lost sample is 100 % off."""

GRID_TOLERANCE = 0.5
"""Largest distance of a stamp from the straight line through the first and the last, in samples: the clock
must not drift within a recording by as much as would move a sample into its neighbour's place."""

MAX_SIGNIFICANT_DIGITS = 15


class UnevenTime(NamedTuple):
    """Where a time column leaves its even grid."""

    row: int
    """Zero-based index of the first sample that is not where it should be."""
    problem: str


def find_uneven_time(time: NDArray[np.float64]) -> UnevenTime | None:
    """First sample of `time` [s], shape (n,), that is not on an even, rising grid; None if all are."""
    not_finite = np.flatnonzero(~np.isfinite(time))
    if not_finite.size:
        return UnevenTime(int(not_finite[0]), "the time is not a finite number")
    if time.size < 2:
        return UnevenTime(0, f"{time.size} sample(s); a recording needs at least 2")
    step = np.diff(time)
    period = float(np.median(step))
    wrong = np.flatnonzero((step <= 0.0) | (np.abs(step - period) > STEP_TOLERANCE * period))
    if wrong.size:
        row = int(wrong[0]) + 1
        return UnevenTime(row, _describe_step(float(time[row - 1]), float(time[row]), period))
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
    intervals = time.size - 1
    span = float(time[-1] - time[0])
    rate = intervals / span
    stamp_error = float(np.max(np.abs(time - np.linspace(time[0], time[-1], time.size))))
    stamp_error += 2.0 * float(np.spacing(np.max(np.abs(time))))
    margin = 2.0 * stamp_error / span
    for digits in range(1, MAX_SIGNIFICANT_DIGITS):
        for candidate in (_rounded(rate, digits), 1.0 / _rounded(1.0 / rate, digits)):
            if abs(candidate / rate - 1.0) <= margin:
                return candidate
    return rate


def _describe_step(before: float, after: float, period: float) -> str:
    if after <= before:
        verb = "repeats" if after == before else "steps back"
        return f"time {verb}: {before:.9g} s is followed by {after:.9g} s"
    kind = "gap in time" if after - before > period else "uneven time"
    return f"{kind}: step of {after - before:.6g} s after {before:.9g} s, elsewhere {period:.6g} s"


def _rounded(value: float, significant_digits: int) -> float:
    return float(f"{value:.{significant_digits - 1}e}")
