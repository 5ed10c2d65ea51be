"""Folds: parts of recordings that a fit can leave out, with few events of each operating point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.fit.masses import MeanMass
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.operating_points import events_by_point

T = TypeVar("T")

RING_DOWN = 5e-3  # s after the last closing that count: the line forgets within less


@dataclass(frozen=True, eq=False)
class Fold:
    """A part of the data that can be left out of a fit: a recording, or some events of the only one."""

    measurement: Measurement  # with shortened events
    recording: int  # its number
    weights: NDArray[np.float64]  # (events,) number of injections for which each event stands
    weighed: MeanMass | None = None  # None: not measured
    rate_shape: bool = False  # whether a measured rate counts sample by sample, and not by its integrals alone

    def mass_residuals(self, masses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean of modelled masses (events,) [kg] beside the measured one, in standard deviations (1,), or (0,)."""
        if self.weighed is None:
            return np.zeros(0)
        mean = np.average(masses, weights=self.weights)
        return np.array([(mean - self.weighed.mass) / self.weighed.sigma])


def folds_of(recordings: Sequence[Measurement], weighed: Mapping[int, MeanMass]) -> tuple[Fold, ...]:
    """Every recording as a fold; a single recording is divided by operating points, or else into halves.

    With a measured mass it stays whole, for that is of all injections. weighed: masses by number of the recording.
    """
    short = []
    for recording in recordings:
        tail = round(RING_DOWN * recording.recording.sample_rate)
        events = tuple(replace(e, end=min(e.end, e.openings[-1].last + tail)) for e in recording.events)
        short.append(replace(recording, events=events))
    if len(short) > 1 or len(short[0].events) == 1 or weighed:
        groups = [(number, list(recording.events)) for number, recording in enumerate(short)]
    else:
        points = events_by_point(short[0])
        if len(points) == 1:
            half = (len(points[0]) + 1) // 2
            points = [points[0][:half], points[0][half:]]
        groups = [(0, events) for events in points]
    return tuple(
        Fold(replace(short[n], events=tuple(events)), n, np.ones(len(events)), weighed.get(n)) for n, events in groups
    )


def by_meter(fold: Fold, meter: tuple[float, ...]) -> Fold:
    """A fold whose rate has a meter of these time constants [s]."""
    recording = replace(fold.measurement.recording, meter=meter)
    return replace(fold, measurement=replace(fold.measurement, recording=recording))


def thinned(fold: Fold, most: int) -> Fold:
    """At most so many events of each operating point, spread evenly."""
    kept = [
        (event, len(point) / min(most, len(point)))
        for point in events_by_point(fold.measurement)
        for event in spread(point, most)
    ]
    kept.sort(key=lambda item: item[0].start)
    measurement = replace(fold.measurement, events=tuple(event for event, _ in kept))
    return replace(fold, measurement=measurement, weights=np.array([share for _, share in kept]))


def spread(items: Sequence[T], most: int) -> list[T]:
    """At most so many items, spread evenly."""
    return [items[n] for n in np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)]
