"""A recording, or a part of it, as the frames that are replayed: whole or windowed, once or again and again."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from observer_rt.bus.can_frame import CLASSIC_LENGTH
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.foundation.errors import UserError
from observer_rt.recording.replay.framing import Framer, Span, TimedFrame, grid_samples, whole, windows
from observer_rt.recording.signals.recording import Recording

ENCODED_AT_ONCE = 1000  # samples, so that encoding delays no frame by much
SAMPLE_TOLERANCE = 1e-6  # of a sample: a time the user gives names the sample printed with it


@dataclass(frozen=True)
class Extent:
    """How much one pass of a replay is: its length [s] in the recording's own time, and its frames."""

    duration: float
    frames: int


def recording_frames(
    recording: Recording,
    bus: BusMap,
    windowed: bool,
    loop: int = 1,
    start: float | None = None,
    stop: float | None = None,
) -> Iterator[TimedFrame]:
    """Frames a measuring device would send for a recording; time, sample index and counters go on over loops.

    windowed: only round injections. loop: how often, 0 for ever. start, stop: [start, stop) in the recording's
    own time [s]. Between two loops the last samples are left out if they do not fill a frame.

    Raises:
        UserError: nothing is selected, or a message is too long for its kind of frame.
    """
    part, spans = _selected(recording, bus, windowed, start, stop)
    refuse_long_frames(bus)
    return _looped(part, spans, bus, loop)


def refuse_long_frames(bus: BusMap) -> None:
    """Raise `UserError` for an input message that is too long for its kind of frame."""
    for layout in bus.input_layouts:
        if not layout.is_fd and layout.length > CLASSIC_LENGTH:
            raise UserError(
                f"message {layout.name}",
                f"{layout.length} bytes do not fit a classic CAN frame, and the database does not say CAN FD",
                "set its VFrameFormat to 14 (StandardCAN_FD) or 15 (ExtendedCAN_FD)",
            )


def recording_extent(
    recording: Recording, bus: BusMap, windowed: bool, start: float | None = None, stop: float | None = None
) -> Extent:
    """Extent of one loop of `recording_frames`. Raises `UserError` when nothing is selected."""
    part, spans = _selected(recording, bus, windowed, start, stop)
    frames = sum(
        -(-(span.end - span.start) // grid_samples(bus, number))
        * int(bus.inputs.messages[number]["kind_count"])
        for span in spans
        for number in range(len(bus.input_layouts))
    )
    return Extent(part.samples / part.sample_rate, frames)


def refuse_unordered(start: float | None, stop: float | None) -> None:
    """Raise `UserError` unless the times [s] of --start and --stop are in order; None: not given."""
    first = -math.inf if start is None else start
    last = math.inf if stop is None else stop
    if not first < last:
        raise UserError("--start, --stop", f"{first:g} s is not before {last:g} s", "start before you stop")


def _looped(part: Recording, spans: Sequence[Span], bus: BusMap, loop: int) -> Iterator[TimedFrame]:
    framer = Framer(bus)
    # A frame that is not full at the end of a loop would claim the first indices of the next.
    kept = part.samples - part.samples % _block(bus)
    if loop == 1 or kept < 2:
        kept = part.samples
    repeated = _cut(part, 0, kept)
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
    return math.lcm(*(grid_samples(bus, number) for number in range(len(bus.input_layouts))))


def _selected(
    recording: Recording, bus: BusMap, windowed: bool, start: float | None, stop: float | None
) -> tuple[Recording, list[Span]]:
    """The part of the recording to send, on a time that begins at 0, and its spans."""
    part = _between(recording, start, stop)
    spans = windows(part) if windowed else whole(part)
    if not spans:
        raise UserError(
            "--windowed",
            f"no injection in the part selected of {_described(recording)}",
            "send it continuous, or select a part with injections by --start and --stop",
        )
    block = _block(bus)
    return part, _in_pieces(_of_whole_frames(spans, block, part.samples), block)


def _of_whole_frames(spans: Sequence[Span], block: int, samples: int) -> list[Span]:
    """The spans lengthened to whole frames, those that then touch joined: every index is sent once."""
    result: list[Span] = []
    for span in spans:
        start = result.pop().start if result and span.start <= result[-1].end else span.start
        result.append(Span(start, min(samples, start + -(-(span.end - start) // block) * block)))
    return result


def _in_pieces(spans: Sequence[Span], block: int) -> list[Span]:
    """The same frames from spans short enough to be encoded between two frames."""
    piece = block * max(1, ENCODED_AT_ONCE // block)
    return [
        Span(start, min(start + piece, span.end))
        for span in spans
        for start in range(span.start, span.end, piece)
    ]


def _between(recording: Recording, start: float | None, stop: float | None) -> Recording:
    refuse_unordered(start, stop)

    def sample_at(moment: float) -> int:
        place = (moment - float(recording.time[0])) * recording.sample_rate
        return math.ceil(min(max(place, 0.0), float(recording.samples)) - SAMPLE_TOLERANCE)

    first = 0 if start is None else sample_at(start)
    last = recording.samples if stop is None else sample_at(stop)
    if last - first < 2:
        raise UserError(
            "--start, --stop",
            f"select {last - first} samples of {_described(recording)}",
            "choose times within the recording",
        )
    return _cut(recording, first, last)


def _cut(recording: Recording, start: int, end: int) -> Recording:
    """Samples [start, end) on a time that begins at 0, at exactly the rate of the whole."""
    return replace(
        recording,
        time=np.arange(end - start) / recording.sample_rate,
        rail_pressure=recording.rail_pressure[start:end],
        needle_lift=recording.needle_lift[start:end],
        line_pressure=recording.line_pressure[start:end],
        injection_rate=None,
    )


def _described(recording: Recording) -> str:
    name = recording.path or "the recording"
    return f"{name}, which runs from {recording.time[0]:.6g} to {recording.time[-1]:.6g} s"
