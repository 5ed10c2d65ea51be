"""The recordings as a fit sees them: few events, parts that can be left out in turn."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.measurement import COUNTED_LEAD, Measurement
from observer_rt.evidence.operating_points import events_by_point

T = TypeVar("T")

RING_DOWN = 5e-3  # s after the last closing that count: the line forgets within less


@dataclass(frozen=True)
class Weighed:
    """Measured masses of a recording's injections [kg], each with its standard deviation.

    single: by the first sample of the injection; mean: of all injections, None where they were not weighed together.
    """

    single: Mapping[int, tuple[float, float]]
    mean: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Part:
    """What can be left out to judge a fit by: a recording, or some events of the only one.

    measurement: its events shortened; recording: number of its recording; weights: how
    many injections of the recording each event stands for (events,); weighed: masses, None where none are measured.
    """

    measurement: Measurement
    recording: int
    weights: NDArray[np.float64]
    weighed: Weighed | None = None

    def mass_residuals(self, masses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Modelled masses (events,) [kg] beside the measured ones, in standard deviations (m,)."""
        if self.weighed is None:
            return np.zeros(0)
        single = self.weighed.single
        residuals = [
            (mass - single[first][0]) / single[first][1]
            for event, mass in zip(self.measurement.events, masses, strict=True)
            if (first := event.openings[0].first) in single
        ]
        if self.weighed.mean is not None:
            mean, sigma = self.weighed.mean
            residuals.append((float(np.average(masses, weights=self.weights)) - mean) / sigma)
        return np.array(residuals)


def parts_of(found: Sequence[Measurement], weighed: Mapping[int, Weighed]) -> tuple[Part, ...]:
    """Every recording as a part; of a single one its operating points, or else its events by halves.

    weighed: by the number of the recording.
    """
    short = [_shortened(one) for one in found]
    if len(short) > 1 or len(short[0].events) == 1:
        groups = [(number, list(one.events)) for number, one in enumerate(short)]
    else:
        points = events_by_point(short[0])
        if len(points) == 1:
            half = (len(points[0]) + 1) // 2
            points = [points[0][:half], points[0][half:]]
        groups = [(0, events) for events in points]
    return tuple(
        Part(replace(short[n], events=tuple(events)), n, np.ones(len(events)), weighed.get(n))
        for n, events in groups
    )


def thinned(part: Part, most: int) -> Part:
    """At most so many events of each operating point, spread evenly."""
    kept = [
        (event, len(point) / min(most, len(point)))
        for point in events_by_point(part.measurement)
        for event in spread(point, most)
    ]
    kept.sort(key=lambda item: item[0].start)
    events = tuple(event for event, _ in kept)
    return replace(
        part,
        measurement=replace(part.measurement, events=events),
        weights=np.array([share for _, share in kept]),
    )


def spread(items: Sequence[T], most: int) -> list[T]:
    """At most so many items, spread evenly."""
    return [items[n] for n in np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)]


def standstill_offset(part: Part) -> float:
    """Mean of line minus rail pressure before the injections [Pa]."""
    recording = part.measurement.recording
    difference = recording.line_pressure - recording.rail_pressure
    before = math.ceil(COUNTED_LEAD * recording.sample_rate)
    firsts = [event.openings[0].first for event in part.measurement.events]
    return float(np.mean([np.mean(difference[first - before : first]) for first in firsts]))


def _shortened(one: Measurement) -> Measurement:
    tail = round(RING_DOWN * one.recording.sample_rate)
    events = tuple(replace(e, end=min(e.end, e.openings[-1].last + tail)) for e in one.events)
    return replace(one, events=events)
