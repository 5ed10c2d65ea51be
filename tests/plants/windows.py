"""Where in a recording of a plant something is injected, and how much. Imports nothing of `observer_rt`."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.parameters import with_faults
from tests.plants.plant import Bench, Outcome

LEAD, TAIL = 0.15e-3, 0.5e-3  # s of a window, before the opening and after the needle is shut
MILLIGRAM = 1e-6  # kg
BINS = (0.0, 0.15e-3, 0.3e-3, 0.6e-3, 1e-3, 2e-3)  # s after an opening
SETTLED = 0.3e-3  # s after an opening, from which on samples are to be valid
WRONG = 3.0  # %, beyond which a valid sample is wrong
LEAST_RATE = 0.5  # share of an opening's largest rate from which on a sample's own error counts: not at the flanks


@dataclass(frozen=True, eq=False)
class Windows:
    """Samples of every opening's window, and in it those with the needle open; the openings of every event."""

    ranges: tuple[slice, ...]
    opened: tuple[slice, ...]
    of_event: tuple[tuple[int, ...], ...]
    interval: float  # s

    def union(self, event: int) -> NDArray[np.int64]:
        ranges = [self.ranges[i] for i in self.of_event[event]]
        return np.unique(np.concatenate([np.arange(r.start, r.stop) for r in ranges]))

    def nearest(self, first: int) -> int:
        """Number of the opening whose window begins nearest to a sample."""
        return int(np.argmin([abs(first - window.start) for window in self.ranges]))

    def masses(self, rate: Array, density: float) -> Array:
        """Mass of every opening [kg], trapezoidal rule over exactly its window."""
        return np.array([np.trapezoid(rate[window]) for window in self.ranges], np.float64) * self.interval * density

    def by_event(self, masses: Array) -> Array:
        return np.array([masses[list(openings)].sum() for openings in self.of_event])

    def mean_squares(self, error: Array) -> tuple[float, ...]:
        """Mean square of an error over every event's union of windows."""
        return tuple(float(np.mean(error[self.union(i)] ** 2)) for i in range(len(self.of_event)))


def sample_facts(since: Array, valid: Array, true: Array, rates: Mapping[str, Array]) -> dict[str, list[float]]:
    """Of samples (n,) of an opening: valid, wrong, and by the time since it [s] errors of rates [% of what flows]."""
    least = LEAST_RATE * true.max()
    flowing, scale = true > least, np.maximum(true, least)
    errors = {name: 100.0 * np.abs(rate - true) / scale for name, rate in rates.items()}
    facts = {"settled_valid": valid[flowing & (since >= SETTLED)]}
    facts["valid_wrong"] = errors["live"][flowing & valid] > WRONG
    for name, (low, high) in product(rates, pairwise(BINS)):
        facts[f"{name}_from_{1e6 * low:.0f}_us"] = np.round(errors[name][(low <= since) & (since < high)], 3)
    return {column: values.astype(float).tolist() for column, values in facts.items()}


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
