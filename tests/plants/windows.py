"""Where in a recording of a plant something is injected, and how much. Imports nothing of `observer_rt`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.parameters import with_faults
from tests.plants.plant import Bench, Outcome

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

    def nearest(self, first: int) -> int:
        """Number of the opening whose window begins nearest to a sample."""
        return int(np.argmin([abs(first - window.start) for window in self.ranges]))

    def masses(self, rate: Array, density: float) -> Array:
        """Mass of every opening [kg], trapezoidal rule over exactly its window."""
        return np.array([np.trapezoid(rate[window]) for window in self.ranges], np.float64) * self.interval * density

    def opening_masses_mg(self, rate: Array, density: float) -> tuple[float, ...]:
        """Mass of every opening [mg]."""
        return tuple((self.masses(rate, density) / MILLIGRAM).tolist())

    def by_event(self, masses: Array) -> Array:
        """Sum of the masses of every event's openings."""
        return np.array([masses[list(openings)].sum() for openings in self.of_event])

    def mean_squares(self, error: Array) -> tuple[float, ...]:
        """Mean square of an error over every event's union of windows."""
        return tuple(float(np.mean(error[self.union(i)] ** 2)) for i in range(len(self.of_event)))


def true_masses(outcome: Outcome, bench: Bench) -> Array:
    """Mass of every opening [kg]: what a fuel of another density injects is not what the injector file would say."""
    densities = np.array([with_faults(bench.injector, event.faults).density for event in bench.events])
    windows = windows_of(outcome, bench.sample_rate)
    return np.asarray(windows.masses(outcome.truth.injection_rate, 1.0) * densities[outcome.event_of])


def windows_of(outcome: Outcome, sample_rate: float) -> Windows:
    """Windows of the true openings; two that reach into each other part where the flow between them is least."""
    lead, tail = round(LEAD * sample_rate), round(TAIL * sample_rate)
    rate = outcome.truth.injection_rate
    bounds = [[max(0, begin - lead), min(shut + 1 + tail, rate.size - 1)] for begin, shut in outcome.openings]
    for number, (begin, _) in enumerate(outcome.openings[1:], 1):
        first = max(begin - lead, outcome.openings[number - 1, 1] + 1)
        if bounds[number - 1][1] >= begin:
            bounds[number][0] = bounds[number - 1][1] = first + int(np.argmin(rate[first : begin + 1]))
    ranges = tuple(slice(int(first), int(last) + 1) for first, last in bounds)
    members = tuple(tuple(int(i) for i in np.flatnonzero(outcome.event_of == e)) for e in np.unique(outcome.event_of))
    opened = tuple(slice(int(begin), int(shut) + 1) for begin, shut in outcome.openings)
    return Windows(ranges, opened, members, 1.0 / sample_rate)
