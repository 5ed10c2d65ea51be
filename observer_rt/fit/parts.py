"""The recordings as a fit sees them: few events, parts left out in turn; what cannot calibrate is refused."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.measurement import (
    COUNTED_LEAD,
    POINT_DURATION,
    Measurement,
    open_time,
    rail_pressure_before,
)
from observer_rt.evidence.operating_points import distinct, events_by_point
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE

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
    short = []
    for one in found:
        tail = round(RING_DOWN * one.recording.sample_rate)
        events = tuple(replace(e, end=min(e.end, e.openings[-1].last + tail)) for e in one.events)
        short.append(replace(one, events=events))
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


_RUN = 5  # equal samples at the edge of a range that are no chance
_FINE = 0.2  # share of equal neighbours, below which a signal is so noisy that a run of them is none
_FEW = 6  # injections, below which intervals are wide
BETWEEN_SAMPLES = 0.005  # of a mass, by instants SLOW apart: of the richer plant, every fifth sample
FAST, SLOW = 10e-6, 50e-6  # s between samples: edges of the lift lost nothing, and that
WORTH_A_WORD = 0.001  # of a mass


def refuse_clipped(found: Sequence[Measurement]) -> None:
    """Raise `UserError` for a signal that stays at the edge of its range."""
    for one in found:
        recording = one.recording
        signals = (
            ("rail_pressure", recording.rail_pressure, MEGAPASCAL, "MPa", True),
            ("line_pressure", recording.line_pressure, MEGAPASCAL, "MPa", True),
            ("needle_lift", recording.needle_lift, MICROMETRE, "um", False),  # clipped at 0 it serves
        )
        for name, values, unit, symbol, both in signals:
            clipped = _clipped(values, both)
            if clipped is not None:
                level, count = clipped
                raise UserError(
                    f"{recording.path or 'recording'}, {name}",
                    f"is clipped: {count} samples in a row are exactly {level / unit:.6g} {symbol}, the edge of "
                    "its range",
                    "record with a wider range",
                )


def _clipped(values: NDArray[np.float64], both: bool) -> tuple[float, int] | None:
    """The edge at which a noisy signal stays, and its longest run there; None where it does not."""
    present = values[np.isfinite(values)]
    if present.size < 2 or float(np.mean(np.diff(present) == 0.0)) > _FINE:
        return None  # so coarse, or so smooth, that equal samples say nothing
    for edge in (np.max, np.min)[: 2 if both else 1]:
        level = float(edge(present))
        steps = np.flatnonzero(np.diff(np.concatenate(([False], present == level, [False]))))
        longest = int(np.max(steps[1::2] - steps[::2]))
        if longest >= _RUN:
            return level, longest
    return None


def share_between_samples(one: Measurement) -> float:
    """Standard deviation of a mass, as a share: instants far apart miss where the needle leaves and meets its seat.

    A mean over the sample period does not, for it holds what flowed in between.
    """
    return 0.0 if one.means else BETWEEN_SAMPLES * max(0.0, (one.interval - FAST) / (SLOW - FAST))


def warnings(found: Sequence[Measurement]) -> list[str]:
    """What makes the result less sure, in sentences."""
    result = []
    events = [(one, event) for one in found for event in one.events]
    pressures = distinct(rail_pressure_before(event, one.recording) for one, event in events)
    durations = np.array([open_time(event, one.recording) for one, event in events])
    one_duration = float(np.ptp(durations)) < POINT_DURATION
    if pressures == 1 and one_duration:
        result.append(
            "one operating point only: what is fitted holds there and nowhere else for sure; add recordings at other "
            "rail pressures and energizing times, such as 60, 100 and 140 MPa by 0.6 and 1.9 ms"
        )
    elif pressures == 1:
        result.append("one rail pressure only: add recordings at others, such as 60 and 140 MPa")
    elif one_duration:
        result.append("one energizing time only: add recordings with others, such as 0.6 and 1.9 ms")
    if len(events) < _FEW:
        result.append(f"{len(events)} injections only: intervals are wide; record {_FEW} or more")
    between = max(map(share_between_samples, found))
    if between > WORTH_A_WORD:
        result.append(
            f"samples are instants at {found[0].recording.sample_rate:g} Hz: between them the edges of the lift are "
            f"lost, and masses are {between:.1%} (1 sigma) less sure, even if the verdict is adequate. Fit at "
            "the full rate of the bench (100 kHz); if samples are means over the sample period, state it: "
            'meaning = "mean" in [sampling] of the bench file (--bench)'
        )
    return result
