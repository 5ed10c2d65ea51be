"""The daemon's watches over a log, and why it gives no samples, or at another rate; remedies were tried on it."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from observer_rt.bus.can_frame import EXTENDED_FLAG, frame_key
from observer_rt.bus.links.link import BusFrame, Frame, blocks_of
from observer_rt.bus.mapping.bus_map import BusMap, layout_of, map_bus, stream_of
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.config.injector_sections import HIGHEST_RATE, LOWEST_RATE
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import FLOAT32, FLOAT64, IMPOSSIBLE, Joining
from observer_rt.daemon.arrivals import STALE
from observer_rt.daemon.input_watch import PERIOD, InputWatch, odd_lengths
from observer_rt.daemon.signal_watch import OUTSIDE_REMEDY
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.noise import SIGNALS
from observer_rt.engine.signal_survey import Survey, implausible
from observer_rt.files.canlog.can_log import PAUSE
from observer_rt.files.channels import InputFrames
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import NANOSECONDS, first_of

RATE_TOLERANCE = 0.02  # relative deviation of the sample rate by stamps from that of the bench file
FEWEST_FOR_RATE = 2000  # samples
TRIED = 1 << 16  # frames of each message, by which a remedy is tried
FEWEST = 0.1  # samples for each frame of the line pressure, that a remedy must give
TO_KNOW_CLOCKS = 1.0  # s of frames
ZONE = 900.0  # s, of whole numbers of which are the differences of time zones
NONE: Mapping[int, int] = {}
_FLOATS = {(1 << 32) - 1: FLOAT32, (1 << 64) - 1: FLOAT64}  # by the mask of a field
MOST_NOTES = 20
SHORTEST_PAUSE = 0.1  # s in the stamps: no frame waits so long


class LogWatch:
    """Is given every frame of a log after the core; the first stamp is the begin.

    spans: first and last stamp [ns] by the key of a message; of that with the line pressure, steps of its stamps [s]
    and its duration [s] since there are samples.
    """

    def __init__(self, injector: BenchInjector, bus_map: BusMap, core: Core) -> None:
        self.core, self._watch = core, InputWatch(injector, bus_map, core)
        self.leading = layout_of(bus_map, stream_of(bus_map, Role.LINE_PRESSURE)).key
        self.spans: dict[int, tuple[int, int]] = {}
        self.pauses: list[tuple[float, float]] = []
        self._has_begun, self.duration = False, 0.0
        self._first: int | None = None
        self._next = 0
        self._now = 0
        self._notes: list[str] = []

    def is_due(self, stamp: int) -> bool:
        """Whether a look at the core is due with the frame of a stamp [ns]."""
        return self._first is None or stamp >= self._next

    def note(self, bus: int, frame: Frame) -> None:
        """Takes a frame of the log."""
        if self._first is None:
            self._first = self._next = frame.stamp_ns
            self._watch.arrivals.begin(frame.stamp_ns)
        self._now = frame.stamp_ns
        self._watch.arrivals.note(bus, frame.frame_id, frame.is_extended, self._now)
        key = frame_key(frame.frame_id, frame.is_extended, bus)
        first, last = self.spans.get(key, (self._now, self._now))
        self.spans[key] = (first, self._now)
        if key == self.leading:
            step = (self._now - last) / NANOSECONDS
            if step > SHORTEST_PAUSE:
                self.pauses.append(((last - first) / NANOSECONDS, step))
            self.duration += step if self._has_begun else 0.0
            self._has_begun |= self.core.processed > 0  # before that, it may still learn the clocks
        if self.is_due(self._now):
            self._next = self._now + PERIOD
            at = (self._now - self._first) / NANOSECONDS
            texts = (notice.text for notice in self._watch.look(self._now))
            self._notes += [f"at {at:.1f} s: {text}" for text in texts if OUTSIDE_REMEDY not in text]

    def paused(self) -> str:
        """The pauses in words."""
        return first_of([f"after {begin:.4g} s its stamps step ahead by {step:.6g} s" for begin, step in self.pauses])

    def outside(self) -> str:
        """Signals with values that are missing because they lie outside the declared range, in words."""
        return "; ".join(self._watch.ranges.described(self.core.parts["receiver"]).values())

    def absent(self) -> list[str]:
        """Messages that samples need and that never came."""
        arrivals = self._watch.arrivals
        return [
            f"{source.text}: no frame in the log"
            for source in arrivals.sources
            if source.streams and not arrivals.count_of(source).frames
        ]

    def notes(self, path: Path) -> list[str]:
        """Findings in words, the end of the log included."""
        arrivals = self._watch.arrivals
        ended = [
            f"{source.text}: no frame in the last {arrivals.age(source, self._now):.1f} s"
            for source in arrivals.sources
            if source.streams and arrivals.age(source, self._now) > STALE
        ]
        findings = [*self._notes, *ended]
        left = len(findings) - MOST_NOTES
        more = [f"{left} more of the kind are left out"] if left > 0 else []
        return [f"{path}: {text}" for text in (*findings[:MOST_NOTES], *more)]


@dataclass(frozen=True)
class DecodedLog:
    """A log that was decoded once."""

    frames: InputFrames
    bench: Bench
    bus: BusMap
    watch: LogWatch

    def gives_samples(self, bench: Bench | None = None, earlier: Mapping[int, int] = NONE, **tables: Any) -> bool:
        """Whether it gives plausible samples by another bench, other input tables, or `earlier` stamps [ns]."""
        counts: Counter[int] = Counter()
        held = []
        for on, frame in self.frames:
            key = frame_key(frame.frame_id, frame.is_extended, on)
            counts[key] += 1
            if counts[key] <= TRIED:
                held.append(BusFrame(on, frame._replace(stamp_ns=frame.stamp_ns - earlier.get(key, 0))))
        if earlier:
            held.sort(key=lambda each: each.frame.stamp_ns)
        try:
            bus = map_bus(bench) if bench else replace(self.bus, inputs=self.bus.inputs._replace(**tables))
            core = Core((bench or self.bench).injector, bus, learning=False)
        except UserError:
            return False
        for block in blocks_of(held):
            core.handle_many(block)
        core.finish()
        survey = Survey()
        for role, values in core.inputs(0, TRIED).items():
            survey.take(role.value, values)
        fewest = max(2.0, FEWEST * min(counts[self.watch.leading], TRIED))
        return core.processed >= fewest and not any(implausible(survey))


class Cause(NamedTuple):
    """Fault of a log, in words. tried: whether the remedy gives samples; what needs another log cannot be tried."""

    problem: str
    remedy: str = ""
    tried: Callable[[], bool] = lambda: True


def absent_message(log: DecodedLog) -> Iterator[Cause]:
    """A message that samples need is not in it."""
    if absent := log.watch.absent():
        yield Cause("; ".join(absent), "record all inputs: was the device on, its channel recorded?")


def frame_length(log: DecodedLog) -> Iterator[Cause]:
    """Frames are of another length than the database says."""
    lengths = log.watch.core.parts["receiver"]["odd_length"].tolist()
    messages, names = log.bus.inputs.messages.copy(), []
    for row, layout, length in zip(messages, log.bus.input_layouts, lengths, strict=False):
        if length > layout.length:  # a shorter frame may lack what is read
            row["length"] = row["padded_length"] = length
            names.append(f"{layout.name} to {length}")
    count = log.watch.core.counters.length_errors
    if max(lengths[: len(log.bus.input_layouts)]) >= 0:
        remedy = f"set the length of {', '.join(names)} bytes in the database"
        tried = partial(log.gives_samples, messages=messages)
        yield Cause(f"{count} of wrong length: {odd_lengths(log.bus, log.watch.core)}", remedy, tried)


def impossible_value(log: DecodedLog) -> Iterator[Cause]:
    """Values that no sensor can mean: those of a float that the database has for an integer, above all."""
    receiver, signals = log.watch.core.parts["receiver"], log.bus.inputs.signals.copy()
    config, words, kinds = log.bench.injector.config.signals, [], []
    for column, role in enumerate(ROLES):
        lowest, highest = float(receiver["lowest"][column]), float(receiver["highest"][column])
        if max(-lowest, highest) < IMPOSSIBLE[column]:
            continue
        stream, names, (_, unit, size) = stream_of(log.bus, role), config.of(role).names, SIGNALS[role]
        layout, name = layout_of(log.bus, stream), names if isinstance(names, str) else names[0]
        words.append(f"{name} of {layout.name} is {lowest / size:.3g} to {highest / size:.3g} {unit}")
        groups = log.bus.inputs.groups[log.bus.inputs.groups["stream"] == stream]
        first = (groups["first_signal"] + groups["position"][:, column]).tolist()
        rows = [n + k for n, size in zip(first, groups["samples"].tolist(), strict=True) for k in range(size)]
        kind = _FLOATS.get(int(signals["mask"][rows[0]]))
        if kind is not None:
            signals["kind"][rows] = kind
            identifier = layout.frame_id | EXTENDED_FLAG * layout.is_extended
            kinds.append(f"SIG_VALTYPE_ {identifier} {name} : {kind - FLOAT32 + 1};")
    if words:
        remedy = f"state in the database that these are floats: {' '.join(kinds)}"
        yield Cause("; ".join(words), remedy, partial(log.gives_samples, signals=signals))


def declared_range(log: DecodedLog) -> Iterator[Cause]:
    """Values are outside the range that the database declares."""
    if outside := log.watch.outside():
        databases = [each.model_copy(update={"lenient": True}) for each in log.bench.config.dbc]
        bench = replace(log.bench, config=log.bench.config.model_copy(update={"dbc": databases}))
        yield Cause(outside, OUTSIDE_REMEDY, partial(log.gives_samples, bench))


def protection(log: DecodedLog) -> Iterator[Cause]:
    """The data id, or the profile, is another one."""
    if errors := log.watch.core.counters.crc_errors:
        yield Cause(f"{errors} CRC errors", "give --bench with the file the log was recorded by")


def clocks_apart(log: DecodedLog) -> Iterator[Cause]:
    """Messages are stamped by clocks that differ by more than their frames take."""
    spans = [(*log.watch.spans[each.key], each) for each in log.bus.input_layouts if each.key in log.watch.spans]
    begin, end, reference = min(spans, key=lambda span: span[0])
    later = [(first, layout) for first, _, layout in spans if first > end]
    for first, layout in later[:1]:
        offset = (first - begin) / NANOSECONDS
        shift = round(offset / ZONE) * ZONE
        begins = f"{layout.name} begins {offset:.9g} s after {reference.name}, when that has ended"
        earlier = {each.key: round(shift * NANOSECONDS) for _, each in later}
        remedy = f"take {shift:g} s from the stamps of {layout.name}"
        yield Cause(f"{begins}: their clocks differ", remedy, partial(log.gives_samples, earlier=earlier))


def short_log(log: DecodedLog) -> Iterator[Cause]:
    """It ends, or the stamps step ahead, before the clocks are known by which samples are joined."""
    joining = log.bus.inputs.timing["joining"]
    names = [layout_of(log.bus, n).name for n, by in enumerate(joining) if by in (Joining.NEAREST, Joining.CLOCK)]
    first, last = log.watch.spans[log.watch.leading]
    if names and (log.watch.pauses or last - first < TO_KNOW_CLOCKS * NANOSECONDS):
        has = log.watch.paused() if log.watch.pauses else f"it has {(last - first) / NANOSECONDS:.3g} s"
        takes = f"which takes {TO_KNOW_CLOCKS:g} s of frames"
        yield Cause(f"samples of {', '.join(names)} are joined by clocks, {takes}, and {has}")


CAUSES = (absent_message, frame_length, impossible_value, declared_range, protection, clocks_apart, short_log)
"""The rules, of which the first counts that finds something."""


def refusal(log: DecodedLog, samples: int) -> UserError:
    """The error for a log that gives so few samples."""
    cause = next((cause for rule in CAUSES for cause in rule(log)), Cause("no known cause"))
    problem = f"its {log.watch.core.counters.frames} input frames give {samples} samples: {cause.problem}"
    return UserError(str(log.frames.path), problem, cause.remedy if cause.tried() else "")


def odd_stamps(log: DecodedLog, intervals: int) -> Iterator[str]:
    """Stamps that contradict the sample rate, in words; intervals: between the samples that the log gives."""
    watch, stated = log.watch, log.bench.injector.sample_rate
    paused = sum(step for _, step in watch.pauses)
    if intervals < FEWEST_FOR_RATE or watch.duration <= paused:
        return
    rate = intervals / watch.duration
    off, off_moving = (abs(each / stated - 1.0) for each in (rate, intervals / (watch.duration - paused)))
    if off_moving < min(off, RATE_TOLERANCE):
        if any(step != PAUSE / NANOSECONDS for _, step in watch.pauses):  # else the log's reader made them
            yield f"{watch.paused()}, while its samples go on: the source paused, or a clock was set anew"
    elif off > RATE_TOLERANCE:
        likely = float(f"{rate:.3g}")
        sampling = log.bench.injector.config.sampling.model_copy(update={"rate_hz": likely})
        bench = log.bench.with_sections(sampling=sampling)
        helps = LOWEST_RATE <= likely <= HIGHEST_RATE and log.gives_samples(bench)
        text = f"by its stamps {rate:.4g} samples a second were sent, the bench file says {stated:g}"
        remedy = f", else set sampling.rate_hz = {likely:g}" if helps else ""
        yield f"{text}: right if it was replayed at another speed{remedy}"
