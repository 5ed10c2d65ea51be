"""Replays a CAN log, or a recording as frames, onto a link on an absolute time grid; notes how late it was."""

import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from observer_rt.bus.links.link import FdFlags, Link, LinkDownError
from observer_rt.bus.links.opening import RECONNECT_PERIOD, first_heard, open_link
from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import LinkConfig, NamedLink
from observer_rt.engine.signal_survey import refuse_implausible
from observer_rt.files.canlog.can_log import NANOSECONDS
from observer_rt.files.channels import matched_channels
from observer_rt.files.formats import open_recording
from observer_rt.files.replay.framing import TimedFrame, bench_for, clamped_in
from observer_rt.files.replay.log_frames import LogPart, Sent, log_frames
from observer_rt.files.replay.recording_frames import Extent, RecordingPart
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.console import say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.progress import progress_bar
from observer_rt.foundation.units import MICROSECOND, MILLISECOND

HELD_SAMPLES = 1 << 20  # of a recording that is read before it is sent: reading meanwhile may delay a frame

LATE = 1 * MILLISECOND  # beyond which a frame counts as late
_NANOSECOND = 1e-9  # s

SLEEP_MARGIN = 1_000_000  # ns before a frame is due, from which on the sleep is exact and not interruptible
LONGEST_SLEEP = 100_000_000  # ns between two looks at the progress
PROGRESS_PERIOD = 100_000_000  # ns


@dataclass(frozen=True)
class ReplaySource:
    """Source of a replay: frames as they are in the file, how many, which kinds of frames, on which buses."""

    frames: Iterator[TimedFrame]
    extent: Extent
    identifiers: frozenset[Sent]
    buses: Mapping[int, LinkConfig]


def log_source(
    bench: Bench,
    path: Path,
    channels: Mapping[str, str],
    start: float | None,
    stop: float | None,
    loop: int,
    console: Console,
) -> ReplaySource:
    """A CAN log, from start to stop [s] of its own time, `loop` times (0: for ever).

    channels: those of the log, with the channel or the name of `[links]` that each goes onto; empty: as the bench
    file has them. Raises `UserError` for a log that does not fit.
    """
    mapped = map_bench(bench)
    links = bench.config.buses
    buses = {0: links[0].config}
    routes: dict[str, int] | None = None
    if channels:
        routes, buses = _chosen_routes(links, channels)
    elif len(links) > 1:
        needed = {layout.bus for bus in mapped.injectors for layout in bus.input_layouts}
        matches = matched_channels(
            path, links, needed, {}, lambda number: f"--map-channel CHANNEL={links[number].config.channel}"
        )
        routes = {channel: number for number, channel in sorted(matches.items())}
        buses = {number: links[number].config for number in routes.values()}
    # results recorded beside the inputs are not sent again: the daemon sends its own
    results = frozenset(
        Sent(number, layout.frame_id, layout.is_extended)
        for number in buses
        for layout in mapped.sent
        if layout.bus == number or len(links) == 1 or number >= len(links)
    )
    part = LogPart(path, start, stop, results, routes)
    extent = part.extent()
    for note in extent.notes:
        say(console, note)
    if len(extent.channels) > 1 and routes is None:
        say(
            console,
            f"frames of {', '.join(extent.channels)} all go onto one bus; --map-channel CHANNEL=BUS chooses",
        )
    if routes is not None and not channels:
        say(console, ", ".join(f"{channel} goes onto {links[to].label}" for channel, to in routes.items()))
    return ReplaySource(log_frames(part, loop), extent, extent.identifiers, buses)


def _chosen_routes(
    links: Sequence[NamedLink], channels: Mapping[str, str]
) -> tuple[dict[str, int], dict[int, LinkConfig]]:
    """Bus numbers by channel of the log, and the buses: those of the bench by name or channel, others beside them."""
    buses: dict[int, LinkConfig] = {}
    routes: dict[str, int] = {}
    others = sorted(set(channels.values()))
    for channel, target in channels.items():
        numbers = [n for n, link in enumerate(links) if target in (link.name, link.config.channel)]
        number = numbers[0] if numbers else len(links) + others.index(target)
        routes[channel] = number
        first = links[0].config
        buses[number] = links[number].config if numbers else first.model_copy(update={"channel": target})
    return routes, buses


def recording_source(
    bench: Bench,
    path: Path,
    windowed: bool,
    start: float | None,
    stop: float | None,
    loop: int,
    console: Console,
) -> ReplaySource:
    """A recording, from start to stop [s] of its own time, `loop` times; windowed: some ms round each injection.

    Raises `UserError` for a file that does not fit.
    """
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
        part = RecordingPart(stream, bus, windowed, start, stop)
    inputs = frozenset(Sent(layout.bus, layout.frame_id, layout.is_extended) for layout in bus.input_layouts)
    buses = {each.bus: bench.config.buses[each.bus].config for each in inputs}
    return ReplaySource(part.frames(loop), part.extent, inputs, buses)


def refuse_traffic(buses: Mapping[int, LinkConfig], sent: Collection[Sent], stop: threading.Event) -> None:
    """Listen a moment on all buses. `stop` ends it early.

    Raises:
        UserError: something of what will be sent is sent already, on the same bus.
        RunError: the interface cannot be used.
    """
    with ExitStack() as stack:
        links = {}
        for bus, config in buses.items():
            mine = sorted((each.identifier, each.is_extended) for each in sent if each.bus == bus)
            links[bus] = stack.enter_context(open_link(config.interface, config.channel, config.fd, mine))
        traffic = first_heard(links, stop)
    if traffic is not None:
        config = buses[traffic.bus]
        raise UserError(
            f"{config.interface} {config.channel}",
            f"another sender is active: frames with identifier 0x{traffic.frame.frame_id:X} come in already",
            "stop it, or send all the same (--force)",
        )


@dataclass(frozen=True)
class ReplayLateness:
    """Median, 99th percentile and maximum [s], and the share of frames later than `LATE`; nan without frames."""

    median: float
    p99: float
    maximum: float
    late_share: float


class LatenessCounter:
    """Counts delays rounded to three digits, so that a replay may go on for ever."""

    def __init__(self) -> None:
        self._delays: Counter[float] = Counter()
        self._late = 0
        self._maximum = 0

    def add(self, nanoseconds: int) -> None:
        """Count one frame, `nanoseconds` >= 0 late."""
        self._delays[float(f"{nanoseconds:.2e}")] += 1
        self._late += nanoseconds > LATE / _NANOSECOND
        self._maximum = max(self._maximum, nanoseconds)

    def result(self) -> ReplayLateness:
        """The figures of all frames counted; median and percentile to within 0.5 %."""
        frames = self._delays.total()
        if not frames:
            return ReplayLateness(math.nan, math.nan, math.nan, math.nan)
        delays = np.array(sorted(self._delays.items()))
        up_to = np.cumsum(delays[:, 1])
        # A delay that was rounded up is not above the largest.
        median, p99 = (
            min(float(delays[np.searchsorted(up_to, math.ceil(share * frames)), 0]), self._maximum)
            * _NANOSECOND
            for share in (0.5, 0.99)
        )
        return ReplayLateness(median, p99, self._maximum * _NANOSECOND, self._late / frames)


@dataclass(frozen=True)
class PlayStatistics:
    """Statistics of what was sent: number of frames, duration [s], and how late they were (nan without a time grid).

    paused: for how long an interface was waited for [s].
    """

    frames: int
    duration: float
    lateness: ReplayLateness
    paused: float = 0.0

    def as_text(self) -> str:
        """Summary for the screen in one line."""
        sent = f"{self.frames} frames in {self.duration:.3f} s"
        if self.paused:
            sent += f", {self.paused:.1f} s of which without the interface"
        late = self.lateness
        if math.isnan(late.median):
            return sent
        return (
            f"{sent}; late by {late.median / MICROSECOND:.0f} us (median), {late.p99 / MICROSECOND:.0f} us (99 %), "
            f"{late.maximum / MICROSECOND:.0f} us (most); "
            f"{100 * late.late_share:.3g} % by more than {LATE / MILLISECOND:g} ms"
        )

    def as_json(self) -> dict[str, Any]:
        """Statistics for a program; null where nothing was measured."""

        def finite(value: float) -> float | None:
            return None if math.isnan(value) else value

        return {
            "frames": self.frames,
            "duration_s": self.duration,
            "paused_s": self.paused,
            "lateness_median_s": finite(self.lateness.median),
            "lateness_p99_s": finite(self.lateness.p99),
            "lateness_max_s": finite(self.lateness.maximum),
            "late_share": finite(self.lateness.late_share),
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

    speed: > 0; math.inf sends as fast as the link takes, and lateness is not measured. `progress` is called with the
    time [s] reached in the recording, some ten times a second. `stop`: end early. `by_bus`: links for frames on
    these buses, instead of `link`. While an interface is down or away all wait, which `tell` is given, and go on as
    much later; no frame is left out.

    Raises:
        RunError: the link failed otherwise.
        UserError: from reading the frames.
    """
    stop = stop or threading.Event()
    links = by_bus or {}
    report = _Progress(progress)
    lateness = LatenessCounter()
    sent = 0
    paused = 0
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
            report.reached(frame.time - max(0, due - time.monotonic_ns()) / NANOSECONDS * speed)
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
            lateness.add(now - due)
        report.reached(frame.time)
        frame = next(stream, None)
    duration = (time.monotonic_ns() - start + paused) / NANOSECONDS
    return PlayStatistics(sent, duration, lateness.result(), paused / NANOSECONDS)


def _wait_until_back(
    link: Link, error: LinkDownError, stop: threading.Event, tell: Callable[[str], None]
) -> int:
    """Reconnect a link whose interface is down or away; ns it took. `stop` ends it early."""
    since = time.monotonic_ns()
    tell(f"waiting for the interface: {error}")
    while not stop.wait(RECONNECT_PERIOD):
        try:
            link.reconnect()
        except LinkDownError:
            continue
        tell("the interface is back, going on")
        break
    return time.monotonic_ns() - since


class _Progress:
    """Passes on the time reached, not more often than a screen needs."""

    def __init__(self, callback: Callable[[float], None] | None) -> None:
        self._callback = callback
        self._next = 0

    def reached(self, moment: float) -> None:
        if self._callback is not None and (now := time.monotonic_ns()) >= self._next:
            self._callback(moment)
            self._next = now + PROGRESS_PERIOD
