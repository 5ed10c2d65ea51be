"""Where in a recording of a plant something is injected, and how much. Imports nothing of `observer_rt`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.plant import Outcome

LEAD, TAIL = 0.15e-3, 0.5e-3  # s of a window, before the opening and after the needle is shut
MILLIGRAM = 1e-6  # kg


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

    def masses(self, rate: Array, density: float) -> Array:
        """Mass of every opening [kg], trapezoidal rule over exactly its window."""
        areas = np.array([np.trapezoid(rate[r]) for r in self.ranges], np.float64)
        return np.asarray(areas * self.interval * density, np.float64)

    def opening_masses_mg(self, rate: Array, density: float) -> tuple[float, ...]:
        """Mass of every opening [mg]."""
        return tuple((self.masses(rate, density) / MILLIGRAM).tolist())

    def event_masses_mg(self, rate: Array, density: float) -> tuple[float, ...]:
        """Mass of every event [mg], its openings summed."""
        masses = self.opening_masses_mg(rate, density)
        return tuple(sum(masses[i] for i in openings) for openings in self.of_event)

    def mean_squares(self, error: Array) -> tuple[float, ...]:
        """Mean square of an error over every event's union of windows."""
        return tuple(float(np.mean(error[self.union(i)] ** 2)) for i in range(len(self.of_event)))


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
