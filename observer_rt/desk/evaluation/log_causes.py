"""Why a log gives no samples, or at another rate than its stamps: one rule for each cause.

A remedy is given only if it was tried on the log and gives samples.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from observer_rt.bus.can_frame import EXTENDED_FLAG, frame_key
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.link import BusFrame, blocks_of
from observer_rt.bus.mapping.bus_map import BusMap, layout_of, map_bus, stream_of
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.bench import Bench
from observer_rt.config.injector_sections import HIGHEST_RATE, LOWEST_RATE
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import FLOAT32, FLOAT64, IMPOSSIBLE, Joining
from observer_rt.daemon.input_watch import odd_lengths
from observer_rt.daemon.signal_watch import OUTSIDE_REMEDY
from observer_rt.desk.evaluation.log_watch import LogWatch
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.noise import SIGNALS
from observer_rt.engine.signal_survey import Survey, implausible
from observer_rt.files.canlog.can_log import PAUSE
from observer_rt.files.channels import InputFrames
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import NANOSECONDS

RATE_TOLERANCE = 0.02  # relative deviation of the sample rate by stamps from that of the bench file
FEWEST_FOR_RATE = 2000  # samples
TRIED = 1 << 16  # frames of each message, by which a remedy is tried
FEWEST = 0.1  # samples for each frame of the line pressure, that a remedy must give
SHORTEST_PAUSE = 0.1  # s in the stamps: no frame waits so long
TO_KNOW_CLOCKS = 1.0  # s of frames
ZONE = 900.0  # s, of whole numbers of which are the differences of time zones
_FLOATS = {(1 << 32) - 1: FLOAT32, (1 << 64) - 1: FLOAT64}  # by the mask of a field


class Stamps:
    """Stamps [ns] of a log's frames; pauses and rate are of the message with the line pressure, the grid's.

    spans: first and last one, by the key of the message; pauses: when stamps step ahead, and by how much [s];
    duration [s]: since there are samples.
    """

    def __init__(self, bus: BusMap) -> None:
        self.leading = layout_of(bus, stream_of(bus, Role.LINE_PRESSURE)).key
        self.spans: dict[int, tuple[int, int]] = {}
        self.pauses: list[tuple[float, float]] = []
        self.has_begun, self.duration = False, 0.0

    def note(self, frame: BusFrame, gives_samples: bool) -> None:
        """Take a frame; gives_samples: before that, the core may still learn the clocks."""
        key, now = frame_key(frame.frame.frame_id, frame.frame.is_extended, frame.bus), frame.frame.stamp_ns
        first, last = self.spans.get(key, (now, now))
        self.spans[key] = (first, now)
        if key == self.leading:
            step = (now - last) / NANOSECONDS
            if step > SHORTEST_PAUSE:
                self.pauses.append(((last - first) / NANOSECONDS, step))
            self.duration += step if self.has_begun else 0.0
            self.has_begun |= gives_samples

    def pause(self) -> str:
        """The pauses in words."""
        (begin, longest), total = max(self.pauses, key=lambda each: each[1]), sum(step for _, step in self.pauses)
        more = f" ({len(self.pauses)} such steps, {total:.6g} s in all)" if len(self.pauses) > 1 else ""
        return f"after {begin:.4g} s its stamps step ahead by {longest:.6g} s{more}"


@dataclass(frozen=True)
class DecodedLog:
    """A log that was decoded once; earlier: ns by which stamps are set back, by the key of their message."""

    frames: InputFrames
    bench: Bench
    bus: BusMap
    core: Core
    watch: LogWatch
    stamps: Stamps
    earlier: Mapping[int, int] = field(default_factory=dict)

    def gives_samples(self) -> bool:
        """Whether its frames give plausible samples by this bench, these tables and these stamps."""
        core = Core(self.bench.injector, self.bus, learning=False)
        counts: Counter[int] = Counter()
        held = []
        for on, frame in self.frames:
            key = frame_key(frame.frame_id, frame.is_extended, on)
            counts[key] += 1
            if counts[key] <= TRIED:
                held.append(BusFrame(on, frame._replace(stamp_ns=frame.stamp_ns - self.earlier.get(key, 0))))
        if self.earlier:
            held.sort(key=lambda each: each.frame.stamp_ns)
        for block in blocks_of(held):
            core.handle_many(block)
        core.finish()
        survey = Survey()
        for role, values in core.inputs(0, TRIED).items():
            survey.take(role.value, values)
        fewest = max(2.0, FEWEST * min(counts[self.stamps.leading], TRIED))
        return core.processed >= fewest and not any(implausible(survey))


class Cause(NamedTuple):
    """Fault of a log, in words. trial: the log with the remedy; other: a remedy by another log or bench file."""

    problem: str
    remedy: str = ""
    trial: DecodedLog | None = None
    other: str = ""


def absent_message(log: DecodedLog) -> Iterator[Cause]:
    """A message that samples need is not in it."""
    if absent := log.watch.absent():
        yield Cause("; ".join(absent), other="record all inputs: was the device on, its channel recorded?")


def frame_length(log: DecodedLog) -> Iterator[Cause]:
    """Frames are of another length than the database says."""
    lengths = log.core.parts["receiver"]["odd_length"].tolist()
    messages, signals = log.bus.inputs.messages.copy(), log.bus.inputs.signals
    ends = np.maximum(signals["first_byte"], signals["first_byte"] + signals["step"] * (signals["byte_count"] - 1))
    names = []
    for number, layout in enumerate(log.bus.input_layouts):
        used = [ends[row] for role in ROLES if _layout(log.bus, role) == layout for row in _rows(log.bus, role)]
        if lengths[number] > max(used):
            messages["length"][number] = messages["padded_length"][number] = lengths[number]
            names.append(f"{layout.name} to {lengths[number]}")
    if count := log.core.counters.length_errors:
        remedy = f"set the length of {', '.join(names)} bytes in the database"
        problem = f"{count} of wrong length: {odd_lengths(log.bus, log.core)}"
        yield Cause(problem, remedy, _by_tables(log, messages=messages))


def impossible_value(log: DecodedLog) -> Iterator[Cause]:
    """Values that no sensor can mean: those of a float that the database has for an integer, above all."""
    receiver, signals = log.core.parts["receiver"], log.bus.inputs.signals.copy()
    words, kinds = [], []
    for column, role in enumerate(ROLES):
        lowest, highest = float(receiver["lowest"][column]), float(receiver["highest"][column])
        if max(-lowest, highest) < IMPOSSIBLE[column]:
            continue
        layout, name, (_, unit, size) = _layout(log.bus, role), _signal_name(log.bench, role), SIGNALS[role]
        rows = _rows(log.bus, role)
        words.append(f"{name} of {layout.name} is {lowest / size:.3g} to {highest / size:.3g} {unit}")
        kind = _FLOATS.get(int(signals["mask"][rows[0]]))
        if kind is not None and signals["kind"][rows[0]] < FLOAT32:
            signals["kind"][rows] = kind
            identifier = layout.frame_id | EXTENDED_FLAG * layout.is_extended
            kinds.append(f"SIG_VALTYPE_ {identifier} {name} : {kind - FLOAT32 + 1};")
    if words:
        remedy = f"state in the database that these are floats: {' '.join(kinds)}"
        yield Cause("; ".join(words), remedy, _by_tables(log, signals=signals))


def declared_range(log: DecodedLog) -> Iterator[Cause]:
    """Values are outside the range that the database declares."""
    if outside := log.watch.outside():
        entries = [entry.model_copy(update={"lenient": True}) for entry in log.bench.config.dbc]
        bench = replace(log.bench, config=log.bench.config.model_copy(update={"dbc": entries}))
        yield Cause(outside, OUTSIDE_REMEDY, replace(log, bench=bench, bus=map_bus(bench)))


def protection(log: DecodedLog) -> Iterator[Cause]:
    """The data id, or the profile, is another one."""
    if errors := log.core.counters.crc_errors:
        yield Cause(f"{errors} CRC errors", other="give --bench with the file the log was recorded by")


def clocks_apart(log: DecodedLog) -> Iterator[Cause]:
    """Messages are stamped by clocks that differ by more than their frames take."""
    spans = [(*log.stamps.spans[each.key], each) for each in log.bus.input_layouts if each.key in log.stamps.spans]
    begin, end, reference = min(spans, key=lambda span: span[0])
    later = [(first, layout) for first, _, layout in spans if first > end]
    for first, layout in later[:1]:
        offset = (first - begin) / NANOSECONDS
        shift = round(offset / ZONE) * ZONE
        problem = (
            f"{layout.name} begins {offset:.9g} s after {reference.name}, when that has ended: their clocks differ"
        )
        earlier = {each.key: round(shift * NANOSECONDS) for _, each in later}
        yield Cause(problem, f"take {shift:g} s from the stamps of {layout.name}", replace(log, earlier=earlier))


def pause(log: DecodedLog) -> Iterator[Cause]:
    """The stamps step ahead."""
    if log.stamps.pauses:
        yield Cause(log.stamps.pause())


def short_log(log: DecodedLog) -> Iterator[Cause]:
    """It ends before the clocks are known by which samples are joined."""
    joining = log.bus.inputs.timing["joining"]
    names = [layout_of(log.bus, n).name for n, by in enumerate(joining) if by in (Joining.NEAREST, Joining.CLOCK)]
    duration = max(last - first for first, last in log.stamps.spans.values()) / NANOSECONDS
    if names and duration < TO_KNOW_CLOCKS:
        takes = f"which takes {TO_KNOW_CLOCKS:g} s of frames, and it has {duration:.3g} s"
        yield Cause(f"samples of {', '.join(names)} are joined by clocks, {takes}")


def missing_value(log: DecodedLog) -> Iterator[Cause]:
    """A signal says `not available` all the time."""
    for role, highest in zip(ROLES, log.core.parts["receiver"]["highest"].tolist(), strict=True):
        if np.isinf(highest):
            name = f"{_signal_name(log.bench, role)} of {_layout(log.bus, role).name}"
            yield Cause(f"{name} says `not available` or `error` in every frame")


CAUSES: tuple[Callable[[DecodedLog], Iterator[Cause]], ...] = (
    absent_message,
    frame_length,
    impossible_value,
    declared_range,
    protection,
    clocks_apart,
    pause,
    short_log,
    missing_value,
)
"""The rules, of which the first counts that finds something."""


def refusal(log: DecodedLog, samples: int) -> UserError:
    """The error for a log that gives so few samples."""
    problem = f"its {log.core.counters.frames} input frames give {samples} samples"
    for cause in (cause for rule in CAUSES for cause in rule(log)):
        is_tried = cause.trial is not None and cause.trial.gives_samples()
        return UserError(
            str(log.frames.path), f"{problem}: {cause.problem}", cause.remedy if is_tried else cause.other
        )
    return UserError(str(log.frames.path), problem)


def odd_stamps(log: DecodedLog, intervals: int) -> Iterator[str]:
    """Stamps that contradict the sample rate, in words; intervals: between the samples that the log gives."""
    stamps, stated = log.stamps, log.bench.injector.sample_rate
    paused = sum(step for _, step in stamps.pauses)
    if intervals < FEWEST_FOR_RATE or stamps.duration <= paused:
        return
    rate = intervals / stamps.duration
    off, off_moving = (abs(each / stated - 1.0) for each in (rate, intervals / (stamps.duration - paused)))
    if off_moving < min(off, RATE_TOLERANCE):
        if any(step != PAUSE / NANOSECONDS for _, step in stamps.pauses):  # else the log's reader made them
            yield f"{stamps.pause()}, while its samples go on: the source paused, or a clock was set anew"
    elif off > RATE_TOLERANCE:
        likely = float(f"{rate:.3g}")
        remedy = f", else set sampling.rate_hz = {likely:g}" if _gives_samples_at(log, likely) else ""
        text = f"by its stamps {rate:.4g} samples a second were sent, the bench file says {stated:g}"
        yield f"{text}: right if it was replayed at another speed{remedy}"


def _gives_samples_at(log: DecodedLog, rate: float) -> bool:
    """Whether the log gives samples by another sample rate in the bench file."""
    if not LOWEST_RATE <= rate <= HIGHEST_RATE:
        return False
    sampling = log.bench.injector.config.sampling.model_copy(update={"rate_hz": rate})
    bench = log.bench.with_sections(sampling=sampling)
    try:
        return replace(log, bench=bench, bus=map_bus(bench)).gives_samples()
    except UserError:
        return False


def _by_tables(log: DecodedLog, **tables: Any) -> DecodedLog:
    """The log by other tables of the inputs."""
    return replace(log, bus=replace(log.bus, inputs=log.bus.inputs._replace(**tables)))


def _layout(bus: BusMap, role: Role) -> MessageLayout:
    return layout_of(bus, stream_of(bus, role))


def _signal_name(bench: Bench, role: Role) -> str:
    names = bench.injector.config.signals.of(role).names
    return names if isinstance(names, str) else names[0]


def _rows(bus: BusMap, role: Role) -> list[int]:
    """Rows of the role's signals in the table of the signals."""
    groups = bus.inputs.groups[bus.inputs.groups["stream"] == stream_of(bus, role)]
    first = groups["first_signal"] + groups["position"][:, ROLES.index(role)]
    return [
        n + k for n, samples in zip(first.tolist(), groups["samples"].tolist(), strict=True) for k in range(samples)
    ]
