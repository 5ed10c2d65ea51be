"""The recordings as a fit sees them: quiet rail pressure, few events, parts that can be left out in turn."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.measurement import COUNTED_LEAD, JudgedEvent, Measurement
from observer_rt.evidence.operating_points import events_by_point

RAIL_MEAN = 0.11e-3  # s over which the rail pressure is averaged, centred: 11 samples at 100 kHz
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

    measurement: its rail pressure averaged, its events shortened; recording: number of its recording; weights: how
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
    quiet = [_shortened(_quiet(one)) for one in found]
    if len(quiet) > 1 or len(quiet[0].events) == 1:
        groups = [(number, list(one.events)) for number, one in enumerate(quiet)]
    else:
        points = events_by_point(quiet[0])
        if len(points) == 1:
            half = (len(points[0]) + 1) // 2
            points = [points[0][:half], points[0][half:]]
        groups = [(0, events) for events in points]
    return tuple(
        Part(replace(quiet[n], events=tuple(events)), n, np.ones(len(events)), weighed.get(n))
        for n, events in groups
    )


def thinned(part: Part, most: int) -> Part:
    """At most so many events of each operating point, spread evenly."""
    kept = [
        (event, share) for point in events_by_point(part.measurement) for event, share in _spread(point, most)
    ]
    kept.sort(key=lambda item: item[0].start)
    events = tuple(event for event, _ in kept)
    return replace(
        part,
        measurement=replace(part.measurement, events=events),
        weights=np.array([share for _, share in kept]),
    )


def _spread(events: Sequence[JudgedEvent], most: int) -> list[tuple[JudgedEvent, float]]:
    places = np.unique(np.linspace(0, len(events) - 1, min(most, len(events))).round().astype(int))
    return [(events[place], len(events) / len(places)) for place in places]


def as_recorded(part: Part, measurement: Measurement) -> Part:
    """The part with the rail pressure of its recording as it was measured."""
    return replace(part, measurement=replace(part.measurement, recording=measurement.recording))


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


def _quiet(one: Measurement) -> Measurement:
    """The recording with its rail pressure averaged.

    A model takes rail noise for pressure, and a fit would make the line stiffer to explain why it does not follow.
    """
    rail = centred_mean(one.recording.rail_pressure, round(RAIL_MEAN * one.recording.sample_rate))
    return replace(one, recording=replace(one.recording, rail_pressure=rail))


def centred_mean(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Mean (n,) of an odd number of samples, at most `width`, round each; the first and last few as they are."""
    half = (width - 1) // 2
    if half < 1 or values.size <= 2 * half:
        return values
    means = np.convolve(values, np.ones(2 * half + 1), "valid") / (2 * half + 1)
    return np.concatenate([values[:half], means, values[-half:]])
