"""Where to look in a recording, by the true lift: the windows of openings and events, and sums over them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MILLIGRAM, MILLISECOND, MM3_PER_MS
from tools.benchmarks.plant import Outcome, Truth
from tools.benchmarks.score import EstimatorScore

LEAD = 0.15 * MILLISECOND  # of a window, before the opening
TAIL = 0.5 * MILLISECOND  # after the needle is shut
Z_95 = 1.96  # sigmas


@dataclass(frozen=True, eq=False)
class Windows:
    """Where to look in a recording: a range of samples for every opening, and in it those with the needle open; the
    openings of every event."""

    ranges: tuple[slice, ...]
    opened: tuple[slice, ...]
    of_event: tuple[tuple[int, ...], ...]
    interval: float  # s

    def union(self, event: int) -> NDArray[np.int64]:
        """Samples of an event's windows, each once."""
        ranges = [self.ranges[i] for i in self.of_event[event]]
        return np.unique(np.concatenate([np.arange(r.start, r.stop) for r in ranges]))

    def masses(self, rate: NDArray[np.float64], density: float) -> NDArray[np.float64]:
        """Mass of every opening [kg], trapezoidal rule over exactly its window."""
        areas = np.array([np.trapezoid(rate[r]) for r in self.ranges], np.float64)
        return np.asarray(areas * self.interval * density, np.float64)

    def event_masses_mg(self, rate: NDArray[np.float64], density: float) -> tuple[float, ...]:
        """Mass of every event [mg], its openings summed."""
        masses = self.masses(rate, density) / MILLIGRAM
        return tuple(float(sum(masses[i] for i in openings)) for openings in self.of_event)

    def mean_squares(self, error: NDArray[np.float64]) -> tuple[float, ...]:
        """Mean square of an error over every event's union of windows."""
        return tuple(float(np.mean(error[self.union(i)] ** 2)) for i in range(len(self.of_event)))


def covered_samples(
    error: NDArray[np.float64], sigma: NDArray[np.float64], windows: Windows
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Samples with an open needle and a standard deviation, and of these those within 1.96 of it, event by event.

    error, sigma: of the rate at every sample, in one unit; sigma is nan where it is not available.
    """
    available = np.isfinite(sigma)
    covered = available & (np.abs(error) <= Z_95 * np.where(available, sigma, 0.0))

    def counted(marked: NDArray[np.bool_]) -> tuple[int, ...]:
        return tuple(
            sum(int(np.sum(marked[windows.opened[i]])) for i in openings) for openings in windows.of_event
        )

    return counted(available), counted(covered)


def score_rate(
    name: str,
    rate: NDArray[np.float64],
    truth: Truth,
    windows: Windows,
    density: float,
    x3_error: NDArray[np.float64] | None = None,
) -> EstimatorScore:
    """Score of an estimator's rate [m3/s] at every sample, and of its normalised sac pressure if it has one."""
    return EstimatorScore(
        name,
        windows.event_masses_mg(rate, density),
        windows.mean_squares((rate - truth.injection_rate) / MM3_PER_MS),
        () if x3_error is None else windows.mean_squares(x3_error),
    )


def windows_of(outcome: Outcome, sample_rate: float) -> Windows:
    """Windows of the true openings, ending where the next opening begins."""
    lead, tail = round(LEAD * sample_rate), round(TAIL * sample_rate)
    samples = outcome.truth.needle_lift.size
    first = outcome.openings[:, 0]
    following = np.append(first[1:], samples - 1)
    ranges = tuple(
        slice(max(0, int(begin) - lead), min(int(shut) + 1 + tail, int(next_begin)) + 1)
        for (begin, shut), next_begin in zip(outcome.openings, following, strict=True)
    )
    members = tuple(
        tuple(int(i) for i in np.flatnonzero(outcome.event_of == e)) for e in np.unique(outcome.event_of)
    )
    opened = tuple(slice(int(begin), int(shut) + 1) for begin, shut in outcome.openings)
    return Windows(ranges, opened, members, 1.0 / sample_rate)
