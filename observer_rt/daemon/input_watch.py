"""Notices about the inputs, live or over a log: missing messages, lost frames, other senders, and the state."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from functools import partial
from typing import NamedTuple

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import BenchInjector
from observer_rt.core.frames.frames import E2EState
from observer_rt.daemon.arrivals import Arrivals, WatchedMessage, message_text
from observer_rt.daemon.signal_watch import LiftWatch, RangeWatch, RateWatch, UnitWatch, ValueWatch
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import Counters
from observer_rt.engine.service.noise import configured_noise
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import COUNTERS, TOPICS, Topic, is_good, named
from observer_rt.foundation.units import NANOSECONDS

REPORTED_AFTER = 2.0  # s without a frame, or with useless ones only, after which it is reported
LOOKS = 10  # whose frames are judged together
LOOKS_WAITED = 100  # at most, of frames in a receive buffer behind which others were dropped and counted
OTHER_SENDER = "stop the other daemon or replay; two on one bus need messages of their own in [outputs]"
# Counters of useless frames, and the share of all input frames that is reported; of frames out of sequence a larger
# one, for lost frames disturb their order, too.
REPORTED_SHARES = {
    "crc_errors": 0.005,
    "length_errors": 0.005,
    "repeated_frames": 0.005,
    "old_frames": 0.005,
    "sequence_errors": 0.1,
}
_USELESS = 10  # frames
_ALL_SILENT = "check that the measuring devices are on, the cable, and the bit rate"
_LOST_AT_ONCE = 0.1  # s of samples lost from one look to the next

PERIOD = 100_000_000  # ns between two looks
MOST_SAMPLES = 1024  # of a look, which the loop waits for

LASTING = 1.0  # s that a state must last to be reported: a source that sends windows changes it at each of them.
ABOUT_INPUTS = (Reason.INPUT_TIMEOUT, Reason.INPUT_STALE, Reason.STARTING)  # reasons when messages stay away


class Trouble(Enum):
    """Trouble with a message. begun: text when it begins, with the remedy; over: text when it is over."""

    def __init__(self, problem: str, remedy: str, over: str) -> None:
        self.begun = f"{problem}\n  remedy: {remedy}"
        self.over = over

    SILENT = "no frame comes", "check the device that sends it, its cable and identifier", "comes again"
    OTHER_SIZE = (
        "its frames come with an identifier of the other size, 11 or 29 bits, than the database says",
        "correct the identifier in the database, or in the device that sends it",
        "comes as the database says",
    )
    INVALID = (
        "its end-to-end protection is INVALID, its values are not taken",
        "another sender? a disturbed bus? E2EProfile and data id of the database? limits: [e2e]",
        "its end-to-end protection is VALID again",
    )
    USELESS = (
        "frames come, and none could be used for 2 s",
        "compare its length, E2EProfile and E2EDataId with the database; is its index or counter stuck?",
        "its frames can be used again",
    )


class _Use(NamedTuple):
    """Last change of the progress of a message's samples: with how many of its frames it came, and when [ns]."""

    progress: tuple[int, ...] = ()
    frames: int = 0
    since: int = 0


class MessageWatch:
    """Reports troubles of single messages by their arrivals; silence of all inputs together is reported once."""

    def __init__(self, bus_map: BusMap, arrivals: Arrivals) -> None:
        keys = bus_map.inputs.messages["key"].tolist()
        self._rows = {source: keys.index(source.layout.key) for source in arrivals.sources}
        self._arrivals = arrivals
        self._uses = {source: _Use() for source in arrivals.sources}
        self._sampled = {source for source in arrivals.sources if source.streams}
        self._all_silent_until = 0  # ns
        self._are_all_silent = False
        self.reported: dict[WatchedMessage, Trouble] = {}
        """Troubles in force."""

    def look(self, now: int, progress: Sequence[int], protection: Sequence[int]) -> Iterator[Notice]:
        """Notices at a time [ns], by the sample index of every stream and `E2EState` of every input message."""
        troubles = {source: self._trouble(source, now, progress, protection) for source in self._rows}
        silent = {source for source, trouble in troubles.items() if trouble is Trouble.SILENT}
        if self._sampled <= silent:
            if not self._are_all_silent:
                names = ", ".join(source.text for source in self._rows if source in silent)
                yield Notice(Topic.INPUT, f"no frame of any input for 2 s: {names}\n  remedy: {_ALL_SILENT}")
            self._are_all_silent, self._all_silent_until = True, now
        elif self._are_all_silent:
            self._are_all_silent = False
            yield Notice(Topic.INPUT, "inputs come again", is_over=True)
        for source, trouble in troubles.items():
            before = self.reported.get(source)
            if trouble is Trouble.SILENT and now - self._all_silent_until < REPORTED_AFTER * NANOSECONDS:
                continue  # those that were away together do not come again in one moment
            if trouble is before:
                continue
            if trouble is None:
                assert before is not None
                del self.reported[source]
                yield Notice(Topic.INPUT, f"{source.text}: {before.over}", is_over=True)
            else:
                self.reported[source] = trouble
                yield Notice(Topic.INPUT, f"{source.text}: {trouble.begun}")

    def _trouble(
        self, source: WatchedMessage, now: int, progress: Sequence[int], protection: Sequence[int]
    ) -> Trouble | None:
        arrivals, use = self._arrivals, self._uses[source]
        got, frames = tuple(progress[stream] for stream in source.streams), arrivals.count_of(source).frames
        is_invalid = protection[self._rows[source]] == E2EState.INVALID
        if not got or got != use.progress or frames == use.frames or is_invalid:
            use = self._uses[source] = _Use(got, frames, now)
        if arrivals.silence(source, now) > max(REPORTED_AFTER, source.patience):
            return Trouble.OTHER_SIZE if arrivals.has_twin(source) else Trouble.SILENT
        if is_invalid:
            return Trouble.INVALID
        is_useless = frames - use.frames > _USELESS and now - use.since > REPORTED_AFTER * NANOSECONDS
        return Trouble.USELESS if is_useless else None


class FrameWatch:
    """Reports, by the counters, a large share of useless frames with its cause, and many samples lost at once."""

    def __init__(self, arrivals: Arrivals, rate: float, lengths: Callable[[], str] = lambda: "") -> None:
        """rate: of samples [Hz]; lengths: gives the messages that came with a wrong length, in words."""
        self._arrivals = arrivals
        self._rate = rate
        self._lengths = lengths
        self._begin: tuple[Counters, int] | None = None  # at the first of the looks judged together, with frames
        self._lost = 0
        self._dropped = deque([0], LOOKS_WAITED)  # frames, by the last looks
        self._looks = 0
        self._is_explained = False
        self._reported: set[str] = set()

    def look(self, counters: Counters, is_explained: bool, dropped: int = 0) -> Iterator[Notice]:
        """Notices; is_explained: another watch said why frames are useless; dropped: frames this computer lost."""
        since = dropped - self._dropped[0]
        self._dropped.append(dropped)
        lost, self._lost = (counters.lost_samples - self._lost) / self._rate, counters.lost_samples
        if self._begin is None:
            self._begin = counters, self._arrivals.frames
            return
        if _LOST_AT_ONCE <= lost < REPORTED_AFTER:  # a longer silence is reported by itself
            text, remedy = f"samples of {lost:.2g} s were lost at once", TOPICS[Topic.INPUT].remedy
            if since:
                text += f", with {since} frames that this computer dropped"
                remedy = COUNTERS["dropped_frames"].remedy
            yield Notice(Topic.INPUT, f"{text}\n  remedy: {remedy}")
        self._looks += 1
        self._is_explained |= is_explained
        if self._looks >= LOOKS:
            before, frames = self._begin
            if not self._is_explained:
                yield from self._judged(counters.since(before), self._arrivals.frames - frames)
            self._begin, self._looks, self._is_explained = (counters, self._arrivals.frames), 0, False

    def _judged(self, since: Counters, frames: int) -> Iterator[Notice]:
        for name, share in REPORTED_SHARES.items():
            count, words = getattr(since, name), COUNTERS[name]
            if frames and count >= share * frames and name not in self._reported:
                self._reported.add(name)
                lengths = self._lengths() if name == "length_errors" else ""
                # the counters are read after the frames were counted, of which more came meanwhile
                shown = f"{min(count, frames)} of {frames} input frames: {words.what}"
                yield Notice(Topic.INPUT, f"{shown}{lengths and f': {lengths}'}\n  remedy: {words.remedy}")
            elif frames and not count and name in self._reported:
                self._reported.discard(name)
                yield Notice(Topic.INPUT, f"no more {words.what}", is_over=True)


class SenderWatch:
    """Reports another sender of our identifiers when it begins, and when it is silent again."""

    def __init__(self, bus_map: BusMap, arrivals: Arrivals) -> None:
        self._bus_map = bus_map
        self._arrivals = arrivals
        self._is_contested = False

    def look(self, now: int) -> Iterator[Notice]:
        """Notices at a time [ns]."""
        before, self._is_contested = self._is_contested, self._arrivals.is_contested(now)
        frames = self._arrivals.foreign_frames
        if before and not self._is_contested:
            yield Notice(Topic.SENDER, f"the other sender is silent after {frames} frames", is_over=True)
        elif self._is_contested and not before:
            names = ", ".join(message_text(self._bus_map, layout) for layout, _ in self._arrivals.foreign_messages)
            yield Notice(Topic.SENDER, f"another node sends {names}\n  remedy: {OTHER_SENDER}")


class InputWatch:
    """Reports faults of the inputs of a core, by message and identifier."""

    def __init__(self, injector: BenchInjector, bus_map: BusMap, core: Core) -> None:
        self.arrivals = Arrivals(bus_map)
        rate = injector.sample_rate
        self._core = core
        self._messages = MessageWatch(bus_map, self.arrivals)
        self._useless = FrameWatch(self.arrivals, rate, partial(odd_lengths, bus_map, core))
        self._senders = SenderWatch(bus_map, self.arrivals)
        self._values = ValueWatch(bus_map, configured_noise(injector), self.arrivals.sources, injector.has_lift)
        self._units, self._rate = UnitWatch(self.arrivals.sources), RateWatch(rate)
        self._lift = LiftWatch()
        self.ranges = RangeWatch(bus_map, injector.config.signals)
        self._seen = 0
        self._frames = 0

    def look(self, now: int, dropped: int = 0) -> list[Notice]:
        """Notices at a time [ns] of the arrivals' clock; to be called every `PERIOD`. dropped: as of `FrameWatch`."""
        core = self._core
        notices = [*self._messages.look(now, core.progress, core.protection)]
        notices += self._useless.look(core.counters, Trouble.INVALID in self._messages.reported.values(), dropped)
        notices += self._rate.look(core.timing, core.state[1])
        notices += self.ranges.look(core.parts["receiver"])
        has_frames = core.frames_taken > self._frames
        self._frames = core.frames_taken
        if has_frames and self.arrivals.is_complete and not self.arrivals.stale_messages(now):
            samples = core.inputs(self._seen, MOST_SAMPLES)
            self._seen = core.processed
            notices += self._values.look(core.newest, samples)
            notices += self._units.look(core.newest, samples)
        return [*notices, *self._lift.look(core.lift), *self._senders.look(now)]

    @property
    def is_lift_missing(self) -> bool:
        """Whether the frames of the needle lift come, but have no possible value."""
        return "needle_lift" in self._values.odd

    @property
    def causes(self) -> tuple[str, ...]:
        """Lasting faults of the inputs, which may be why nothing is valid."""
        return (*self._units.reported.values(), *filter(None, [self._rate.reported]))


def odd_lengths(bus_map: BusMap, core: Core) -> str:
    """Describes messages whose frames came with a wrong length, with the length of the last such frame."""
    lengths = core.parts["receiver"]["odd_length"].tolist()
    came = dict(zip(bus_map.inputs.messages["key"].tolist(), lengths, strict=False))
    return ", ".join(
        f"{message_text(bus_map, layout)} with {came[layout.key]} bytes for {layout.length}"
        for layout in bus_map.received
        if came.get(layout.key, -1) >= 0
    )


class _Standing(NamedTuple):
    """State of the service with its reasons, and lasting faults of the inputs in words."""

    service: State
    reasons: tuple[Reason, ...]
    causes: tuple[str, ...]


class StateWatch:
    """Reports the state of the service, with the ages of the inputs where these are the reason."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._current: _Standing | None = None
        self.since = 0
        """When the state became what it is [ns]."""
        self._reported: _Standing | None = None

    def look(self, now: int, state: tuple[State, tuple[Reason, ...]], causes: tuple[str, ...] = ()) -> list[Notice]:
        """Notices at a time [ns]; state: with all its reasons; causes: lasting faults of the inputs, in words."""
        service, reasons = state
        standing = _Standing(service, reasons, () if is_good(service) else causes)
        if standing != self._current:
            self._current, self.since = standing, now
        if standing == self._reported or now - self.since < LASTING * NANOSECONDS:
            return []
        self._reported = standing
        words = [named(reason) for reason in reasons if reason.name != service.name]
        text = "; ".join([named(service), *words, *standing.causes])
        if not is_good(service) and any(reason in ABOUT_INPUTS for reason in reasons):
            text += f"; {self._arrivals.as_text(now)}"
        return [Notice(Topic.STATE, text, is_good(service))]
