"""Operating points: recordings taken apart by them, cut down to the stretches that are judged, and halved."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.likelihood.events import MARGIN, JudgedEvent, open_time, rail_pressure_before
from observer_rt.identification.likelihood.measurement import Measurement

POINT_PRESSURE, POINT_DURATION = 5 * MEGAPASCAL, 0.1e-3  # Pa, s: one operating point within these
SMOOTHING_REACH = 0.2e-3  # s beside a stretch that the smoothing of the rail pressure reaches to


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
    """Number of rail pressures [Pa] that differ by more than the accuracy with which they are controlled."""
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
    pressure, duration = (partial(f, recording=measurement.recording) for f in (rail_pressure_before, open_time))
    return [
        events
        for same_pressure in _clusters(measurement.events, pressure, POINT_PRESSURE / 2.0)
        for events in _clusters(same_pressure, duration, POINT_DURATION / 2.0)
    ]


def _clusters(
    events: Sequence[JudgedEvent], value: Callable[[JudgedEvent], float], gap: float
) -> list[list[JudgedEvent]]:
    """Events in the order of a value, divided where it leaps by more than `gap`."""
    clusters: list[list[JudgedEvent]] = []
    for event in sorted(events, key=value):
        if clusters and value(event) - value(clusters[-1][-1]) <= gap:
            clusters[-1].append(event)
        else:
            clusters.append([event])
    return clusters


def _part(measurement: Measurement, events: Sequence[JudgedEvent]) -> Measurement:
    """A recording of some of the events, one stretch after another, without the samples between them."""
    recording = measurement.recording
    margin = round((MARGIN + SMOOTHING_REACH) / measurement.interval) + 1
    ordered = sorted(events, key=lambda event: event.start)
    last = recording.samples - 1
    stretches = [np.clip(np.arange(event.start - margin, event.end + margin), 0, last) for event in ordered]
    kept = np.concatenate(stretches)
    moved, commands, begin = [], [], 0
    for event, stretch in zip(ordered, stretches, strict=True):
        moved.append(event.moved(begin + margin - event.start))
        if measurement.commands is not None:
            commands.append(measurement.commands[measurement.shots_in(event)] + begin + margin - event.start)
        begin += stretch.size

    signals = {name: np.ascontiguousarray(values[kept]) for name, values in recording.signals.items()}
    part = recording.with_arrays({"time": np.arange(kept.size, dtype=np.float64) * measurement.interval, **signals})
    pressure = float(np.mean([rail_pressure_before(event, recording) for event in ordered]))
    duration = float(np.mean([open_time(event, recording) for event in ordered]))
    split = replace(measurement, recording=part, events=tuple(moved), rail_pressure=pressure, duration=duration)
    return replace(split, commands=np.concatenate(commands) if commands else None)


def every_second_point(recordings: Sequence[Measurement]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Numbers of the recordings at every second operating point, and at the others, as squares of a chessboard."""
    points = [operating_point(one.rail_pressure, one.duration) for one in recordings]
    pressures = sorted({pressure for pressure, _ in points})
    halves: tuple[list[int], list[int]] = [], []
    for number, (pressure, duration) in enumerate(points):
        durations = sorted({other for same, other in points if same == pressure})
        halves[(pressures.index(pressure) + durations.index(duration)) % 2].append(number)
    return tuple(halves[0]), tuple(halves[1])


def operating_point(rail_pressure: float, duration: float) -> tuple[int, int]:
    """Key of a rail pressure [Pa] and time open [s]: equal within a few MPa and some hundredths of a millisecond."""
    return round(rail_pressure / POINT_PRESSURE), round(duration / POINT_DURATION)
