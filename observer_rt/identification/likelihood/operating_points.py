"""Recordings taken apart by operating point, and cut down to the stretches that are judged."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.likelihood.measurement import (
    MARGIN,
    POINT_DURATION,
    POINT_PRESSURE,
    JudgedEvent,
    Measurement,
    open_time,
    rail_pressure_before,
)

SMOOTHED = 0.2e-3  # s beside a stretch that the smoothing of the rail pressure reaches to


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """The events of one recording at one rail pressure and duration. file: number of the recording."""

    measurement: Measurement
    file: int

    @property
    def name(self) -> str:
        """Such as `100 MPa, 1.93 ms`."""
        return point_name(self.measurement.rail_pressure, self.measurement.duration)


def point_name(rail_pressure: float, duration: float) -> str:
    """An operating point [Pa, s], such as `100 MPa, 1.93 ms`."""
    return f"{rail_pressure / MEGAPASCAL:.0f} MPa, {duration / MILLISECOND:.2f} ms"


def distinct(rail_pressures: Iterable[float]) -> int:
    """Counts rail pressures [Pa] that differ by more than how closely they are controlled."""
    ordered = sorted(rail_pressures)
    return 1 + sum(after - before > POINT_PRESSURE / 2.0 for before, after in pairwise(ordered))


def by_operating_point(recordings: Sequence[Measurement]) -> tuple[OperatingPoint, ...]:
    """Every recording's operating points, by rail pressure, then duration, in the order of the recordings."""
    return tuple(
        OperatingPoint(_part(measurement, events), number)
        for number, measurement in enumerate(recordings)
        for events in events_by_point(measurement)
    )


def events_by_point(measurement: Measurement) -> list[list[JudgedEvent]]:
    """Events of a recording by operating point, in the order of rail pressure, then duration."""
    recording = measurement.recording
    pressure, duration = (partial(f, recording=recording) for f in (rail_pressure_before, open_time))
    return [
        events
        for same_pressure in _clusters(measurement.events, pressure, POINT_PRESSURE / 2.0)
        for events in _clusters(same_pressure, duration, POINT_DURATION / 2.0)
    ]


def _clusters(
    events: Sequence[JudgedEvent], value: Callable[[JudgedEvent], float], gap: float
) -> list[list[JudgedEvent]]:
    """Events in the order of a value, taken apart where it leaps by more than `gap`."""
    clusters: list[list[JudgedEvent]] = []
    for event in sorted(events, key=value):
        if clusters and value(event) - value(clusters[-1][-1]) <= gap:
            clusters[-1].append(event)
        else:
            clusters.append([event])
    return clusters


def _part(measurement: Measurement, events: Sequence[JudgedEvent]) -> Measurement:
    """Some events of a recording, one stretch after another; what lies between them is left out."""
    recording = measurement.recording
    margin = round((MARGIN + SMOOTHED) / measurement.interval) + 1
    ordered = sorted(events, key=lambda event: event.start)
    stretches = [
        np.clip(np.arange(event.start - margin, event.end + margin), 0, recording.samples - 1)
        for event in ordered
    ]
    kept = np.concatenate(stretches)
    moved, begin = [], 0
    for event, stretch in zip(ordered, stretches, strict=True):
        moved.append(event.moved(begin + margin - event.start))
        begin += stretch.size

    def cut(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.ascontiguousarray(values[kept])

    signals = {name: cut(values) for name, values in recording.signals.items()}
    part = recording.with_arrays(
        {"time": np.arange(kept.size, dtype=np.float64) * measurement.interval, **signals}
    )
    return replace(
        measurement,
        recording=part,
        events=tuple(moved),
        rail_pressure=float(np.mean([rail_pressure_before(event, recording) for event in ordered])),
        duration=float(np.mean([open_time(event, recording) for event in ordered])),
    )
