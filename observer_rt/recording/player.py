"""Replay: frames of a recording or a log onto a link, on an absolute time grid."""

import math
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

from observer_rt.bus.link import Link
from observer_rt.bus.mapping import BusMap
from observer_rt.errors import UserError
from observer_rt.recording.candump_log import CLASSIC_LENGTH, NANOSECONDS, CandumpLog, LogFrame
from observer_rt.recording.framing import Framer, Span, TimedFrame, whole, windows
from observer_rt.recording.lateness import LATE, Lateness, LatenessCounter
from observer_rt.recording.recording import Recording
from observer_rt.units import MICROSECOND, MILLISECOND

SLEEP_MARGIN_NS = 1_000_000  # before a frame is due, from which on the sleep is not to be interrupted
LONGEST_SLEEP_NS = 100_000_000  # between two looks at the progress
PROGRESS_PERIOD_NS = 100_000_000
ENCODED_AT_ONCE = 1000  # samples, so that encoding never delays a frame by much
SAMPLE_TOLERANCE = 1e-6  # of a sample: a time given by the user names the sample printed with it


@dataclass(frozen=True)
class PlayStatistics:
    """What was sent: number of frames, duration [s], and how late they were (nan without a time grid)."""

    frames: int
    duration: float
    lateness: Lateness

    def as_text(self) -> str:
        """One line for the screen."""
        sent = f"{self.frames} frames in {self.duration:.3f} s"
        if math.isnan(self.lateness.median):
            return sent
        return (
            f"{sent}; late by {self.lateness.median / MICROSECOND:.0f} us (median), "
            f"{self.lateness.p99 / MICROSECOND:.0f} us (99 %), {self.lateness.maximum / MICROSECOND:.0f} us (most); "
            f"{100 * self.lateness.late_share:.2g} % by more than {LATE / MILLISECOND:g} ms"
        )

    def as_json(self) -> dict[str, Any]:
        """The same for a program; null where nothing was measured."""

        def known(value: float) -> float | None:
            return None if math.isnan(value) else value

        return {
            "frames": self.frames,
            "duration_s": self.duration,
            "lateness_median_s": known(self.lateness.median),
            "lateness_p99_s": known(self.lateness.p99),
            "lateness_max_s": known(self.lateness.maximum),
            "late_share": known(self.lateness.late_share),
        }


@dataclass(frozen=True)
class Extent:
    """How much one pass of a replay is: its length [s] in the recording's own time, and its frames."""

    duration: float
    frames: int


def play(
    frames: Iterable[TimedFrame],
    link: Link,
    speed: float,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
) -> PlayStatistics:
    """Send each frame at start + its time / `speed` by the monotonic clock; late ones at once, so nothing drifts.

    speed: > 0; math.inf sends as fast as the link takes, and lateness is not measured. `progress` is told the time
    of the recording [s] that is reached, some ten times a second. `stop`: end early.

    Raises:
        RunError: the link failed.
        UserError: from reading the frames.
    """
    stop = stop or threading.Event()
    on_grid = math.isfinite(speed)
    lateness = LatenessCounter()
    sent = 0
    stream = iter(frames)
    frame = next(stream, None)  # before the clock starts: opening and encoding take their time
    start = now = time.monotonic_ns()
    next_progress = start
    while frame is not None:
        due = start + round(frame.time / speed * NANOSECONDS)
        while now < due and not stop.is_set():
            if progress is not None and now >= next_progress:
                progress((now - start) / NANOSECONDS * speed)
                next_progress = now + PROGRESS_PERIOD_NS
            _sleep(due - now, stop)
            now = time.monotonic_ns()
        if stop.is_set():
            break
        link.send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd)
        sent += 1
        if on_grid:
            lateness.add(max(0, now - due))
        now = time.monotonic_ns()
        if progress is not None and now >= next_progress:
            progress(frame.time)
            next_progress = now + PROGRESS_PERIOD_NS
        frame = next(stream, None)
    return PlayStatistics(sent, (time.monotonic_ns() - start) / NANOSECONDS, lateness.result())


def _sleep(nanoseconds: int, stop: threading.Event) -> None:
    """Sleep until shortly before a frame is due, or, then, until it is. Never busy: other threads need the time."""
    if nanoseconds > SLEEP_MARGIN_NS:
        stop.wait(min(nanoseconds - SLEEP_MARGIN_NS, LONGEST_SLEEP_NS) / NANOSECONDS)
    else:
        time.sleep(nanoseconds / NANOSECONDS)


def recording_frames(
    recording: Recording,
    bus: BusMap,
    windowed: bool,
    loop: int = 1,
    start: float | None = None,
    stop: float | None = None,
) -> Iterator[TimedFrame]:
    """Frames a measuring device would send for a recording; time, sample index and counters go on over loops.

    windowed: only round injections. loop: how often, 0 for ever. start, stop: [start, stop) in the recording's own
    time [s]. Between two loops the samples that do not fill a frame are left out.

    Raises:
        UserError: nothing is selected, or a message is too long for its kind of frame.
    """
    part, spans = _selected(recording, bus, windowed, start, stop)
    for layout in bus.input_layouts:
        if not layout.is_fd and layout.length > CLASSIC_LENGTH:
            raise UserError(
                f"message {layout.name}",
                f"{layout.length} bytes do not fit a classic CAN frame, and the database does not say CAN FD",
                "set its VFrameFormat to 14 (StandardCAN_FD) or 15 (ExtendedCAN_FD)",
            )
    return _looped(part, spans, bus, loop)


def recording_extent(
    recording: Recording, bus: BusMap, windowed: bool, start: float | None = None, stop: float | None = None
) -> Extent:
    """Extent of one loop of `recording_frames`, which raises the same errors."""
    part, spans = _selected(recording, bus, windowed, start, stop)
    frames = sum(
        -(-(span.end - span.start) // int(message["samples"]))
        for span in spans
        for message in bus.inputs.messages
    )
    return Extent(part.samples / part.sample_rate, frames)


def _looped(part: Recording, spans: Sequence[Span], bus: BusMap, loop: int) -> Iterator[TimedFrame]:
    framer = Framer(bus)
    # A frame begun before the end of a loop would overlap the first of the next.
    kept = part.samples - part.samples % _block(bus) or part.samples
    repeated = _first_samples(part, kept) if loop != 1 else part
    repeated_spans = [Span(span.start, min(span.end, kept)) for span in spans if span.start < kept]
    for number in count():
        offset = number * kept / part.sample_rate
        if number == loop - 1:
            yield from _shifted(framer.frames(part, spans), offset)
            return
        yield from _shifted(framer.frames(repeated, repeated_spans), offset)


def _shifted(frames: Iterable[TimedFrame], offset: float) -> Iterator[TimedFrame]:
    return (frame._replace(time=frame.time + offset) for frame in frames)


def _block(bus: BusMap) -> int:
    """Samples after which all input messages begin a frame together."""
    return math.lcm(*(int(message["samples"]) for message in bus.inputs.messages))


def _selected(
    recording: Recording, bus: BusMap, windowed: bool, start: float | None, stop: float | None
) -> tuple[Recording, list[Span]]:
    part = _between(recording, start, stop)
    spans = windows(part) if windowed else whole(part)
    if not spans:
        raise UserError(
            "--windowed",
            f"no injection in {recording.path or 'the recording'} {_range_text(recording)}",
            "send it continuous, or select a part with injections by --start and --stop",
        )
    block = _block(bus)
    return part, _in_pieces(_of_whole_frames(spans, block, part.samples), block)


def _of_whole_frames(spans: Sequence[Span], block: int, samples: int) -> list[Span]:
    """The spans lengthened to whole frames, those that then touch joined."""
    result: list[Span] = []
    for span in spans:
        start = result.pop().start if result and span.start <= result[-1].end else span.start
        result.append(Span(start, min(samples, start + -(-(span.end - start) // block) * block)))
    return result


def _in_pieces(spans: Sequence[Span], block: int) -> list[Span]:
    """The same samples in the same frames, in spans short enough to encode between two frames."""
    piece = block * max(1, ENCODED_AT_ONCE // block)
    return [
        Span(start, min(start + piece, span.end))
        for span in spans
        for start in range(span.start, span.end, piece)
    ]


def _between(recording: Recording, start: float | None, stop: float | None) -> Recording:
    _refuse_unordered(start, stop)
    first_time, rate = float(recording.time[0]), recording.sample_rate

    def sample_at(moment: float) -> int:
        place = min(max((moment - first_time) * rate, 0.0), float(recording.samples))
        return math.ceil(place - SAMPLE_TOLERANCE)

    first = 0 if start is None else sample_at(start)
    last = recording.samples if stop is None else sample_at(stop)
    if last - first < 2:
        raise UserError(
            "--start, --stop",
            f"select {max(0, last - first)} samples of {recording.path or 'the recording'} {_range_text(recording)}",
            "choose times within the recording",
        )
    return _first_samples(recording, last, first)


def _first_samples(recording: Recording, end: int, start: int = 0) -> Recording:
    arrays = {name: values[start:end] for name, values in recording.signals.items()}
    return replace(recording, time=recording.time[start:end], **arrays)


def _range_text(recording: Recording) -> str:
    return f"(from {recording.time[0]:.6g} to {recording.time[-1]:.6g} s)"


def _refuse_unordered(start: float | None, stop: float | None) -> None:
    first = -math.inf if start is None else start
    last = math.inf if stop is None else stop
    if not first < last:
        raise UserError("--start, --stop", f"{first:g} s is not before {last:g} s", "start before you stop")


def log_frames(
    path: Path,
    loop: int = 1,
    start: float | None = None,
    stop: float | None = None,
    leave_out: Collection[tuple[int, bool]] = frozenset(),
) -> Iterator[TimedFrame]:
    """Frames of a candump log as recorded, of all its channels; a loop repeats them with the times going on.

    loop: how often, 0 for ever. start, stop: [start, stop) in seconds after the log's first frame.
    leave_out: (identifier, is extended) of frames not to send, such as results recorded beside the inputs.

    Raises:
        UserError: nothing is selected; while iterating: the log is malformed, or has no duration to loop over.
    """
    _refuse_unordered(start, stop)
    selection = _LogSelection(path, start or 0.0, math.inf if stop is None else stop, frozenset(leave_out))
    selection.require_frames()
    return selection.looped(loop)


def log_extent(
    path: Path,
    start: float | None = None,
    stop: float | None = None,
    leave_out: Collection[tuple[int, bool]] = frozenset(),
) -> Extent:
    """Extent of one loop of `log_frames`. Reads the whole log, so that it is refused before anything is sent."""
    times = [frame.time for frame in log_frames(path, 1, start, stop, leave_out)]
    return Extent(times[-1], len(times))
