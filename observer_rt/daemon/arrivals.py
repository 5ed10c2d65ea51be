"""Arrivals of frames, their number and the last one: of input messages, and of other nodes under our identifiers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from observer_rt.bus.alignment import MessageTiming
from observer_rt.bus.can_frame import STANDARD_MASK, frame_key
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.timing import LINE_SLOPE
from observer_rt.config.signals import Role
from observer_rt.daemon.snapshot import InputStatus
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, NANOSECONDS

STALE = 0.5  # s without a frame of a message that carries samples
CONTESTED = 2.0  # s after a frame of another sender: it may send seldom


class WatchedMessage(NamedTuple):
    """An input message: what it carries, and after which time without a frame it counts as stale [s]."""

    layout: MessageLayout
    text: str
    """`NeedleLiftBlock 0x111 (needle_lift)`."""
    roles: tuple[str, ...]
    streams: tuple[int, ...]
    """Streams of samples that it carries, and that are waited for; none: optional inputs only."""
    patience: float


@dataclass
class FrameCount:
    """Frames of one identifier on one bus so far, and when the last one came [ns]."""

    frames: int
    last: int


class Arrivals:
    """Counts frames by their identifiers. Times [ns] are of the caller's clock."""

    def __init__(self, bus_map: BusMap) -> None:
        self.sources = tuple(watched_input(bus_map, layout) for layout in bus_map.received)
        self.watched = watched_messages(bus_map)
        """Messages whose frames are counted."""
        self._counts = {layout.key: FrameCount(0, 0) for layout in self.watched}
        inputs = {layout.key for layout in bus_map.received}  # one that is shared by mistake, `check` reports
        results = [layout for layout in bus_map.sent if layout.key not in inputs]
        self._own_counts = [(layout, self._counts[layout.key]) for layout in results]
        self._begin = 0

    def begin(self, now: int) -> None:
        """Begin to wait for messages now: no frame could come before."""
        self._begin = now

    def note(self, bus: int, frame_id: int, is_extended: bool, now: int) -> None:
        """Counts a frame."""
        count = self._counts.get(frame_key(frame_id, is_extended, bus))
        if count is not None:
            count.frames += 1
            count.last = now

    def set_count(self, layout: MessageLayout, frames: int, last: int) -> None:
        """Sets how many frames of a message came so far, and when the last one did."""
        count = self._counts[layout.key]
        count.frames, count.last = frames, last

    def count_of(self, source: WatchedMessage) -> FrameCount:
        """Arrivals of an input message."""
        return self._counts[source.layout.key]

    def has_twin(self, source: WatchedMessage) -> bool:
        """Whether frames came with its number only as an identifier of the other size, 11 bits or 29."""
        twin = self._counts.get(_twin(source.layout).key)
        return twin is not None and twin.frames > self.count_of(source).frames == 0

    @property
    def frames(self) -> int:
        """Frames of all input messages."""
        return sum(self.count_of(source).frames for source in self.sources)

    def age(self, source: WatchedMessage, now: int) -> float:
        """Time since its last frame [s]; nan: none came yet."""
        count = self.count_of(source)
        return (now - count.last) / NANOSECONDS if count.frames else math.nan

    def silence(self, source: WatchedMessage, now: int) -> float:
        """Time since its last frame, or since the begin [s]."""
        return (now - max(self.count_of(source).last, self._begin)) / NANOSECONDS

    def age_of(self, role: Role, now: int) -> float:
        """Time since the last frame with a role [s]; nan: none came yet."""
        return self.age(next(source for source in self.sources if role.value in source.roles), now)

    def stale_messages(self, now: int) -> list[WatchedMessage]:
        """Messages with samples that stay away."""
        return [s for s in self.sources if s.streams and self.silence(s, now) > s.patience]

    def lacks_only(self, role: Role, now: int) -> bool:
        """Whether messages with samples stay away, and only those with a role alone."""
        stale = self.stale_messages(now)
        return bool(stale) and all(source.roles == (role.value,) for source in stale)

    @property
    def is_complete(self) -> bool:
        """Whether every message with samples has come."""
        return all(self.count_of(source).frames for source in self.sources if source.streams)

    @property
    def foreign_messages(self) -> tuple[tuple[MessageLayout, FrameCount], ...]:
        """Messages that we send and that others sent, too, with what came of them."""
        return tuple((layout, count) for layout, count in self._own_counts if count.frames)

    @property
    def foreign_frames(self) -> int:
        """Frames that others sent under our identifiers."""
        return sum(count.frames for _, count in self._own_counts)

    def is_contested(self, now: int) -> bool:
        """Whether another node sends under our identifiers now."""
        return any(count.frames and now - count.last < CONTESTED * NANOSECONDS for _, count in self._own_counts)

    def as_text(self, now: int) -> str:
        """Messages that stay away, with their ages; of all where none does."""
        ages = ((source.text, self.age(source, now)) for source in (self.stale_messages(now) or self.sources))
        return ", ".join(
            f"{text}: {'no frame yet' if math.isnan(age) else f'last frame {age_text(age)}'}" for text, age in ages
        )


def age_text(age: float) -> str:
    """Describes an age [s] in a few words."""
    if math.isnan(age):
        return "never came"
    return f"{age * 1e3:.0f} ms ago" if age < 1.0 else f"{age:.1f} s ago"


def watched_input(bus_map: BusMap, layout: MessageLayout) -> WatchedMessage:
    """An input message with what it carries."""
    streams = tuple(number for number in range(len(bus_map.inputs.streams)) if layout_of(bus_map, number) == layout)
    bits = [int(bus_map.inputs.streams[number]["roles"]) for number in streams]
    roles = [role.value for carried in bits for place, role in enumerate(ROLES) if carried >> place & 1]
    patience = [STALE] if streams else []
    for message in bus_map.slow:
        if message.layout == layout:
            roles += [signal.role.value for signal in message.signals]
            patience += [signal.timeout for signal in message.signals]
    if bus_map.energizing is not None and bus_map.energizing.layout == layout:
        from observer_rt.bus.mapping.optional_inputs import slow_timeout  # optional: [signals.energizing]

        roles.append("energizing")
        if bus_map.energizing.cycle is not None:
            patience.append(slow_timeout(None, round(bus_map.energizing.cycle * NANOSECONDS)))
    text = f"{message_text(bus_map, layout)} ({', '.join(roles)})"
    awaited = tuple(number for number in streams if number not in bus_map.spared)
    return WatchedMessage(layout, text, tuple(roles), awaited, min(patience, default=math.inf))


def inputs_of(arrivals: Arrivals, timing: Sequence[MessageTiming], now: int) -> tuple[InputStatus, ...]:
    """All input messages at a time [ns]; timing: of all streams."""
    stale = arrivals.stale_messages(now)
    inputs = []
    for source in arrivals.sources:
        age, is_stale = arrivals.age(source, now), source in stale
        late = "" if is_stale else lateness([timing[stream] for stream in source.streams])
        inputs.append(InputStatus(source.text, None if math.isnan(age) else age, is_stale, late))
    return tuple(inputs)


def lateness(timing: Sequence[MessageTiming]) -> str:
    """Describes how late frames come, and how well the time of their samples is known."""
    if not timing or any(message.jitter.frames == 0 for message in timing):
        return ""
    text = f", late by up to {max(message.lately for message in timing) / MICROSECOND:.0f} us"
    unknown = max(message.unknown for message in timing)
    if unknown == math.inf:
        text += ", clocks not known yet"
    elif unknown > 0.0:
        error = unknown * LINE_SLOPE / MEGAPASCAL
        text += f"; joined by clock, known to {unknown / MICROSECOND:.2g} us ({error:.2g} MPa)"
    return text


def watched_messages(bus_map: BusMap) -> tuple[MessageLayout, ...]:
    """Messages whose frames tell of faults: inputs, results, which nobody else sends, and twins of the inputs.

    A twin has an identifier of the other size, 11 bits or 29, by which no message is known.
    """
    own = (*bus_map.received, *bus_map.sent)
    keys = {layout.key for layout in own}
    twins = (_twin(layout) for layout in bus_map.received if layout.frame_id <= STANDARD_MASK)
    return (*own, *(twin for twin in twins if twin.key not in keys))


def _twin(layout: MessageLayout) -> MessageLayout:
    return replace(layout, is_extended=not layout.is_extended)


def message_text(bus_map: BusMap, layout: MessageLayout) -> str:
    """Describes a message with its identifier."""
    return f"{bus_map.name_of(layout)} 0x{layout.frame_id:X}"
