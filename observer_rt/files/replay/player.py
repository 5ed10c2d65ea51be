"""Replays a CAN log, or a recording as frames, onto a link on an absolute time grid; notes how late it was."""

import math
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from observer_rt.bus.links.link import FdFlags, Link, LinkDownError
from observer_rt.bus.links.opening import first_heard, open_link, reconnect
from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import LinkConfig
from observer_rt.engine.signal_survey import refuse_implausible
from observer_rt.files.canlog.can_log import LogReader
from observer_rt.files.channels import chosen_channels
from observer_rt.files.formats import open_log, open_recording
from observer_rt.files.replay.framing import TimedFrame, bench_for, clamped_in
from observer_rt.files.replay.recording_frames import recording_frames
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.console import progress_bar, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MICROSECOND, MILLISECOND, NANOSECONDS

HELD_SAMPLES = 1 << 20  # of a recording that is read before it is sent: reading meanwhile may delay a frame

LATE = 1 * MILLISECOND  # beyond which a frame counts as late
SLEEP_MARGIN = 1_000_000  # ns before a frame is due, from which on the sleep is exact and not interruptible
LONGEST_SLEEP = 100_000_000  # ns between two looks at the progress
PROGRESS_PERIOD = 100_000_000  # ns


class Sent(NamedTuple):
    bus: int
    identifier: int
    is_extended: bool


class LogFrames:
    """Frames of a log as recorded, on a time that begins at 0 with its first frame; read anew by every iteration.

    It is read to its end first, so that malformed entries are found before anything is sent. duration [s]: until the
    last frame; notes: oddities of the log.
    """

    def __init__(self, path: Path, channels: Mapping[int, str | None], results: Collection[Sent] = ()) -> None:
        """channels: of the log by bus, None: all; results: of the observer in the log, not to be sent again.

        Raises `UserError` for a malformed log, or where nothing is left to send.
        """
        self.path = path
        self._channels, self._results = channels, frozenset(results)
        self.duration = 0.0
        sent: set[Sent] = set()
        present: dict[str, None] = {}
        log = open_log(path)
        for channel, frame in self._selected(log):
            self.duration = frame.time
            sent.add(Sent(frame.bus, frame.frame_id, frame.is_extended))
            present[channel] = None
        self.sent, self.channels, self.notes = frozenset(sent), tuple(present), tuple(log.notes())
        if not sent:
            wanted = ", ".join(channel for channel in channels.values() if channel is not None)
            what = f"frame of channel {wanted}" if wanted else "frame but results of the observer"
            problem = "; ".join([f"holds no data {what}", *self.notes])
            raise UserError(str(path), problem, "record the inputs on that channel")

    def __iter__(self) -> Iterator[TimedFrame]:
        return (frame for _, frame in self._selected(open_log(self.path)))

    def _selected(self, log: LogReader) -> Iterator[tuple[str, TimedFrame]]:
        first_stamp: int | None = None
        for entry in log:
            frame = entry.frame
            if first_stamp is None:
                first_stamp = frame.stamp_ns
            for bus, channel in self._channels.items():
                if channel in (None, entry.channel) and (bus, frame.frame_id, frame.is_extended) not in self._results:
                    time_s = (frame.stamp_ns - first_stamp) / NANOSECONDS
                    kind = (frame.frame_id, frame.is_extended, frame.is_fd)
                    flags = (frame.bit_rate_switch, frame.error_state_indicator)
                    yield entry.channel, TimedFrame(time_s, *kind, frame.payload, *flags, bus)


class ReplaySource(NamedTuple):
    """Source of a replay: frames as they are in the file, their duration [s], which kinds of them, on which buses."""

    frames: Iterable[TimedFrame]
    duration: float
    sent: frozenset[Sent]
    buses: Mapping[int, LinkConfig]


def log_source(bench: Bench, path: Path, from_channels: Sequence[str], console: Console) -> ReplaySource:
    """A CAN log. from_channels: as `chosen_channels` takes them. Raises `UserError` for a log that does not fit."""
    mapped = map_bench(bench)
    links = bench.config.buses
    needed = {layout.bus for bus in mapped.injectors for layout in bus.input_layouts}
    channels = chosen_channels(path, links, needed, from_channels)
    results = {Sent(layout.bus, layout.frame_id, layout.is_extended) for layout in mapped.sent}
    frames = LogFrames(path, channels, results)
    for note in frames.notes:
        say(console, note)
    if len(links) > 1:
        say(console, ", ".join(f"{name} goes onto {links[bus].label}" for bus, name in channels.items()))
    elif len(frames.channels) > 1:
        say(console, f"frames of {', '.join(frames.channels)} all go onto one bus; --from-channel chooses among them")
    return ReplaySource(frames, frames.duration, frames.sent, {bus: links[bus].config for bus in channels})


def recording_source(bench: Bench, path: Path, windowed: bool, console: Console) -> ReplaySource:
    """A recording; windowed: some ms round each injection. Raises `UserError` for a file that does not fit."""
    bus = map_bus(bench)
    with progress_bar(console, f"looking through {path.name}", None):
        stream = open_recording(path, bench.injector)
    refuse_implausible(path, stream.survey, stream.names)
    for note in stream.notes:
        say(console, note)
    bench_for(bench, stream)
    for warning in clamped_in(stream.survey, bus):
        say(console, f"warning: {warning}")
    if stream.grid_samples <= HELD_SAMPLES:
        stream = HeldSignals(stream.collected())
    with progress_bar(console, f"looking through {path.name}", None):
        frames = recording_frames(stream, bus, windowed)
    inputs = frozenset(Sent(layout.bus, layout.frame_id, layout.is_extended) for layout in bus.input_layouts)
    buses = {message.bus: bench.config.buses[message.bus].config for message in inputs}
    return ReplaySource(frames, stream.grid_samples / stream.sample_rate, inputs, buses)


def refuse_traffic(buses: Mapping[int, LinkConfig], sent: Collection[Sent], stop: threading.Event) -> None:
    """Listen a moment on all buses, or until `stop`, for what will be sent.

    Raises `UserError` where something sends it already on the same bus, `RunError` for an unusable interface.
    """
    with ExitStack() as stack:
        links = {}
        for bus, config in buses.items():
            identifiers = sorted((message.identifier, message.is_extended) for message in sent if message.bus == bus)
            link = open_link(config.interface, config.channel, config.fd, identifiers, bit_rates=config.bit_rates)
            links[bus] = stack.enter_context(link)
        traffic = first_heard(links, stop)
    if traffic is not None:
        config = buses[traffic.bus]
        problem = f"another sender is active: frames with identifier 0x{traffic.frame.frame_id:X} come in already"
        raise UserError(f"{config.interface} {config.channel}", problem, "stop it, or send all the same (--force)")


class PlayStatistics(NamedTuple):
    """Statistics of what was sent: number of frames, duration [s], and how late they were.

    latest: largest delay [s], nan without a time grid; late: frames later than `LATE`; paused [s]: for an interface.
    """

    frames: int
    duration: float
    latest: float = math.nan
    late: int = 0
    paused: float = 0.0

    def as_text(self) -> str:
        sent = f"{self.frames} frames in {self.duration:.3f} s"
        if self.paused:
            sent += f", {self.paused:.1f} s of which without the interface"
        if math.isnan(self.latest):
            return sent
        most = f"{self.latest / MICROSECOND:.0f} us"
        return f"{sent}; late by {most} at most, {self.late} by more than {LATE / MILLISECOND:g} ms"

    def as_json(self) -> dict[str, Any]:
        """Statistics for a program; null where nothing was measured."""
        return {
            "frames": self.frames,
            "duration_s": self.duration,
            "paused_s": self.paused,
            "lateness_max_s": None if math.isnan(self.latest) else self.latest,
            "late_frames": self.late,
        }


def play(
    frames: Iterable[TimedFrame],
    link: Link,
    speed: float,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    by_bus: Mapping[int, Link] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> PlayStatistics:
    """Send each frame at start + its time / `speed` by the monotonic clock; late ones at once, so nothing drifts.

    speed: > 0; math.inf: as fast as the link takes, lateness unknown. `progress`, some ten times a second: time [s]
    of the recording; `by_bus`: links for these buses, instead of `link`. While an interface is away (`tell` gets it)
    all wait; no frame is left out. Raises `RunError` where a link fails otherwise, `UserError` from reading the
    frames.
    """
    stop = stop or threading.Event()
    links = by_bus or {}
    next_report = 0
    sent = late = paused = 0
    latest = math.nan

    def reached(moment: float) -> None:
        nonlocal next_report
        if progress is not None and (now := time.monotonic_ns()) >= next_report:
            progress(moment)
            next_report = now + PROGRESS_PERIOD

    stream = iter(frames)
    frame = next(stream, None)  # before the clock starts: opening and encoding take their time
    start = time.monotonic_ns()
    while frame is not None and not stop.is_set():
        due = start + round(frame.time / speed * NANOSECONDS)
        now = time.monotonic_ns()
        if now < due:
            left = due - now
            if left > SLEEP_MARGIN:
                stop.wait(min(left - SLEEP_MARGIN, LONGEST_SLEEP) / NANOSECONDS)
            else:
                time.sleep(left / NANOSECONDS)  # never busy: other threads need the time
            reached(frame.time - max(0, due - time.monotonic_ns()) / NANOSECONDS * speed)
            continue
        flags = FdFlags(frame.bit_rate_switch, frame.error_state_indicator)
        to = links.get(frame.bus, link)
        try:
            to.send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd, flags)
        except LinkDownError as error:
            pause = _wait_until_back(to, error, stop, tell)
            paused += pause
            start += pause
            continue
        sent += 1
        if math.isfinite(speed):
            delay = (now - due) / NANOSECONDS
            latest = max(delay, latest) if sent > 1 else delay
            late += delay > LATE
        reached(frame.time)
        frame = next(stream, None)
    duration = (time.monotonic_ns() - start + paused) / NANOSECONDS
    return PlayStatistics(sent, duration, latest, late, paused / NANOSECONDS)


def _wait_until_back(link: Link, error: LinkDownError, stop: threading.Event, tell: Callable[[str], None]) -> int:
    """Reconnect a link whose interface is down or away; returns how long it took [ns]."""
    since = time.monotonic_ns()
    tell(f"waiting for the interface: {error}")
    if reconnect(link, stop):
        tell("the interface is back, going on")
    return time.monotonic_ns() - since
