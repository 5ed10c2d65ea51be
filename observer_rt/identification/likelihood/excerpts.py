"""Recordings as measurements, in memory that does not depend on their length: of a long one some injections are kept.

Of each operating point these are all, then every second, every fourth and so on: rare points keep all of theirs.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np

from observer_rt.core.stream.stream import LOOK_BACK, dead_band
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import SignalStream, copied, cut, followed
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.likelihood import events, measurement
from observer_rt.identification.likelihood.events import JudgedEvent
from observer_rt.identification.likelihood.measurement import PART_GAP, Measurement, joined

POINT_PRESSURE, POINT_DURATION = 5 * MEGAPASCAL, 0.1e-3  # Pa, s: one operating point within these
SMOOTHING_REACH = 0.2e-3  # s beside a stretch that the smoothing of the rail pressure reaches to
MOST_SAMPLES = 1 << 19  # stored of a recording: 5 s at 100 kHz, some 100 injections of a longer one
BLOCK_SAMPLES = 1 << 18  # samples looked at together
STORED_STANDSTILL = 30e-3  # s stored after the last closing


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
    return 1 + sum(after - before > POINT_PRESSURE / 2.0 for before, after in pairwise(sorted(rail_pressures)))


def by_operating_point(recordings: Sequence[Measurement]) -> tuple[OperatingPoint, ...]:
    """Every recording's operating points, by rail pressure, then duration, in the order of the recordings."""
    return tuple(
        OperatingPoint(_part(measurement, events), number)
        for number, measurement in enumerate(recordings)
        for events in events_by_point(measurement)
    )


def events_by_point(measurement: Measurement) -> list[list[JudgedEvent]]:
    """Events of a recording by operating point, in the order of rail pressure, then duration."""
    pressure, duration = (
        partial(f, recording=measurement.recording) for f in (events.rail_pressure_before, events.open_time)
    )
    return [
        of_point
        for same_pressure in _clusters(measurement.events, pressure, POINT_PRESSURE / 2.0)
        for of_point in _clusters(same_pressure, duration, POINT_DURATION / 2.0)
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


def _part(measurement: Measurement, chosen: Sequence[JudgedEvent]) -> Measurement:
    """A recording of some of the events, one stretch after another, without the samples between them."""
    recording = measurement.recording
    margin = round((events.MARGIN + SMOOTHING_REACH) / measurement.interval) + 1
    ordered = sorted(chosen, key=lambda event: event.start)
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
    pressure = float(np.mean([events.rail_pressure_before(event, recording) for event in ordered]))
    duration = float(np.mean([events.open_time(event, recording) for event in ordered]))
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


@dataclass(frozen=True, eq=False)
class _Excerpt:
    part: Chunk
    event: events.JudgedEvent

    @property
    def samples(self) -> int:
        """Samples of the part and of the gap after it."""
        return self.part.samples + round(PART_GAP * self.part.sample_rate)


@dataclass
class _Point:
    """Injections stored of an operating point: every stride-th injection, beginning with the first."""

    seen: int = 0
    stride: int = 1
    kept: list[_Excerpt] = field(default_factory=list)


class _ChosenEvents:
    def __init__(self, most: int) -> None:
        """most: samples of all together."""
        self._most = most
        self._points: dict[tuple[int, int], _Point] = {}
        self._samples = 0

    def take(self, excerpt: _Excerpt) -> None:
        """Keep an injection or pass it over; others make room for it."""
        part, event = excerpt.part, excerpt.event
        key = operating_point(events.rail_pressure_before(event, part), events.open_time(event, part))
        point = self._points.setdefault(key, _Point())
        if point.seen % point.stride == 0:
            point.kept.append(excerpt)
            self._samples += excerpt.samples
        point.seen += 1
        while self._samples > self._most:
            largest = max(self._points.values(), key=lambda each: len(each.kept))
            if len(largest.kept) > 1:
                dropped = largest.kept[1::2]
                largest.kept, largest.stride = largest.kept[::2], 2 * largest.stride
            else:  # more operating points than injections that can be stored
                dropped = [point.kept.pop()]
            self._samples -= sum(each.samples for each in dropped)

    def excerpts(self) -> list[_Excerpt]:
        """Injections kept, in the order of time."""
        every = [excerpt for point in self._points.values() for excerpt in point.kept]
        return sorted(every, key=lambda excerpt: excerpt.part.first)


def measured(
    source: SignalStream, progress: Callable[[float], None] = lambda _: None, most: int = MOST_SAMPLES
) -> measurement.Measurement:
    """A recording, or excerpts beyond `most` samples. progress: takes samples read; errors as of `measurements`."""
    if source.grid_samples <= most:
        return measurement.measurements([source.collected()])[0]
    measurement.refuse_slow(source)
    chosen = _ChosenEvents(most)
    samples = missing = complete = 0
    left_out: list[events.LeftOut] = []
    for block in _blocks(source.on_one_grid()):
        missing += int(np.count_nonzero(events.missing_samples(block)[samples - block.first :]))
        samples = block.first + block.samples
        openings = events.openings_of(block)
        judged, others = events.events_of(block, openings)
        complete += len(judged)
        left_out += others
        starts = [opening.first - round(events.LEAD * block.sample_rate) for opening in openings]
        for event in judged:
            chosen.take(_excerpt(block, event, starts))
        progress(samples)
    injections = measurement.FoundInjections(samples, missing, complete, tuple(left_out))
    return _joined(source, chosen.excerpts(), injections)


def _blocks(chunks: Iterator[Chunk]) -> Iterator[Chunk]:
    """The samples in blocks that overlap where the needle is shut longest, so that injections stay whole."""
    held: Chunk | None = None
    for chunk in chunks:
        held = chunk if held is None else followed(held, chunk)
        if held.samples >= BLOCK_SAMPLES:
            end, begin = _ends(held)
            yield cut(held, 0, end)
            held = cut(held, begin, held.samples)
    if held is not None and held.samples:
        yield held


def _ends(block: Chunk) -> tuple[int, int]:
    """Both lie in the longest standstill of the block's second half: the end of it, and the begin of the next."""
    half, rate = block.samples // 2, block.sample_rate
    noise = events.noise_level(block.needle_lift, np.ones(block.samples, np.bool_), rate)
    opens, _ = dead_band(noise if np.isfinite(noise) else 0.0)
    edges = np.flatnonzero(np.diff(~(block.needle_lift[half:] > opens), prepend=False, append=False))
    if not edges.size:
        return block.samples, block.samples
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    shut, opening = (half + int(edge) for edge in edges[2 * longest : 2 * longest + 2])
    margin = round(events.MARGIN * rate) + 1
    end = min(block.samples, opening - round(events.COUNTED_LEAD * rate) + margin)
    begin = opening - LOOK_BACK - round(events.LEAD * rate) - margin
    return max(end, shut), min(max(begin, shut), max(end, shut))


def _excerpt(block: Chunk, event: events.JudgedEvent, starts: Sequence[int]) -> _Excerpt:
    """An event of a block with the standstill up to the next event; starts: of all events of the block."""
    margin = round(events.MARGIN * block.sample_rate) + 1
    last = event.openings[-1].last
    following = min(
        (start - margin for start in starts if start > last - round(events.LEAD * block.sample_rate)),
        default=block.samples,
    )
    end = max(event.end + margin, min(following, last + round(STORED_STANDSTILL * block.sample_rate), block.samples))
    begin = event.start - margin
    return _Excerpt(copied(cut(block, begin, end)), event.moved(-begin))


def _joined(
    source: SignalStream, excerpts: Sequence[_Excerpt], injections: measurement.FoundInjections
) -> measurement.Measurement:
    moved, begin = [], 0
    for excerpt in excerpts:
        moved.append(excerpt.event.moved(begin))
        begin += excerpt.samples
    names = ("rail_pressure", "needle_lift", "line_pressure", *source.optional)
    parts = [excerpt.part.signals for excerpt in excerpts] or [dict.fromkeys(names, np.zeros(0))]
    of = {"path": source.path, "meaning": source.meaning, "meter": source.meter, "notes": source.notes}
    recording = joined(parts, source.sample_rate, **of)
    openings = [opening for event in moved for opening in event.openings]
    return measurement.measurement_of(recording, openings, tuple(moved), injections)
