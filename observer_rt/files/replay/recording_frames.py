"""Recordings as the frames that are replayed: whole or windowed, once or again, sample index and time going on."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.links.link import BusFrame, Frame, FrameBlock
from observer_rt.bus.mapping.bus_map import BusMap, message_timing
from observer_rt.files.replay.framing import (
    FramedRecording,
    Framer,
    Span,
    TimedFrame,
    all_samples,
    block_samples,
    grid_samples,
    windows_of,
)
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import SignalStream, cut, followed
from observer_rt.foundation.errors import RunError, UserError

ENCODED_AT_ONCE = 1000  # samples, so that encoding delays no frame by much
SAMPLE_TOLERANCE = 1e-6  # of a sample: a time the user gives names the sample printed with it

NANOSECONDS = 1e9  # in a second
PAUSE = 1.0  # s, between two recordings, and between two stretches of one


@dataclass(frozen=True)
class Extent:
    """Extent of one pass of a replay: its length [s] in the recording's own time, and its frames."""

    duration: float
    frames: int


class RecordingPart:
    """The selected samples of a recording on a time that begins at 0, read from its file as they are sent."""

    def __init__(
        self,
        stream: SignalStream,
        bus: BusMap,
        windowed: bool = False,
        start: float | None = None,
        stop: float | None = None,
    ) -> None:
        """windowed: only round injections, for which the recording is read once. start, stop: [start, stop) in the
        recording's own time [s].

        Raises `UserError` when nothing is selected.
        """
        self._stream, self._bus = stream, bus
        self._first, self._last = _between(stream, start, stop)
        self._block = block_samples(bus)
        self._spans = [Span(0, self.samples)]
        if windowed:
            self._spans = _of_whole_frames(windows_of(self._chunks()), self._block, self.samples)
        if not self._spans:
            raise UserError(
                "--windowed",
                f"no injection in the part selected of {_described(stream)}",
                "send it continuous, or select a part with injections by --start and --stop",
            )

    @property
    def samples(self) -> int:
        """Number of samples of the part."""
        return self._last - self._first

    @property
    def extent(self) -> Extent:
        """Extent of one loop."""
        frames = sum(
            -(-(span.end - span.start) // grid_samples(self._bus, number))
            * int(self._bus.inputs.messages[number]["kind_count"])
            for span in self._spans
            for number in range(len(self._bus.input_layouts))
        )
        return Extent(self.samples / self._stream.sample_rate, frames)

    def frames(self, loop: int = 1) -> Iterator[TimedFrame]:
        """Frames a measuring device would send; time, sample index and counters go on over loops.

        loop: how often, 0 for ever. Between two loops the last samples are left out if they do not fill a frame.
        """
        framer = Framer(self._bus)
        # A frame that is not full at the end of a loop would claim the first indices of the next.
        kept = self.samples - self.samples % self._block
        if loop == 1 or kept < 2:
            kept = self.samples
        repeated = [Span(span.start, min(span.end, kept)) for span in self._spans if span.start < kept]
        for number in count():
            offset = number * kept / self._stream.sample_rate
            if number == loop - 1:
                yield from self._once(framer, self._spans, self.samples, offset)
                return
            yield from self._once(framer, repeated, kept, offset)

    def _once(
        self, framer: Framer, spans: Sequence[Span], samples: int, offset: float
    ) -> Iterator[TimedFrame]:
        """Frames of the spans among the first samples, `offset` [s] later."""
        begin, interval = framer.next_index, 1.0 / self._stream.sample_rate
        for piece in pieces(self._chunks(), _in_pieces(spans, self._block)):
            framer.skip(begin + piece.first - framer.next_index)
            for frame in framer.frames(piece, all_samples(piece)):
                due = piece.first + round(frame.time * self._stream.sample_rate)
                yield frame._replace(time=due * interval + offset)
        framer.skip(begin + samples - framer.next_index)

    def _chunks(self) -> Iterator[Chunk]:
        """The samples of the part, the first of them number 0."""
        for chunk in self._stream.on_one_grid():
            start, end = max(0, self._first - chunk.first), min(chunk.samples, self._last - chunk.first)
            if start < end:
                yield replace(cut(chunk, start, end), first=chunk.first + start - self._first)
            if chunk.first + chunk.samples >= self._last:
                return


def pieces(chunks: Iterable[Chunk], spans: Iterable[Span]) -> Iterator[Chunk]:
    """The samples of spans, which rise and do not overlap, from the chunks of one stretch; the rest is passed over.

    Raises `RunError` where the chunks end before the spans do.
    """
    waiting = iter(chunks)
    held: Chunk | None = None
    for span in spans:
        while held is None or held.first + held.samples < span.end:
            following = next(waiting, None)
            if following is None:
                raise RunError("the recording became shorter while it was read")
            done = 0 if held is None else span.start - held.first
            if held is None or done >= held.samples:
                held = following
            else:
                held = followed(cut(held, max(0, done), held.samples), following)
        yield cut(held, span.start - held.first, span.end - held.first)


def refuse_unordered(start: float | None, stop: float | None) -> None:
    """Raise `UserError` unless the times [s] of --start and --stop are in order; None: not given."""
    first = -math.inf if start is None else start
    last = math.inf if stop is None else stop
    if not first < last:
        raise UserError("--start, --stop", f"{first:g} s is not before {last:g} s", "start before you stop")


def _of_whole_frames(spans: Sequence[Span], block: int, samples: int) -> list[Span]:
    """The spans lengthened to whole frames, those that then touch joined: every index is sent once."""
    result: list[Span] = []
    for span in spans:
        start = result.pop().start if result and span.start <= result[-1].end else span.start
        result.append(Span(start, min(samples, start + -(-(span.end - start) // block) * block)))
    return result


def _in_pieces(spans: Iterable[Span], block: int) -> Iterator[Span]:
    """Cuts spans into pieces short enough to be encoded between two frames."""
    piece = block * max(1, ENCODED_AT_ONCE // block)
    return (
        Span(start, min(start + piece, span.end))
        for span in spans
        for start in range(span.start, span.end, piece)
    )


def _between(stream: SignalStream, start: float | None, stop: float | None) -> tuple[int, int]:
    """First sample selected, and that after the last one."""
    refuse_unordered(start, stop)
    samples = stream.grid_samples

    def sample_at(moment: float) -> int:
        position = (moment - stream.stretches[0].start) * stream.sample_rate
        return math.ceil(min(max(position, 0.0), float(samples)) - SAMPLE_TOLERANCE)

    first = 0 if start is None else sample_at(start)
    last = samples if stop is None else sample_at(stop)
    if last - first < 2:
        raise UserError(
            "--start, --stop",
            f"select {last - first} samples of {_described(stream)}",
            "choose times within the recording",
        )
    return first, last


def _described(stream: SignalStream) -> str:
    begin = stream.stretches[0].start
    end = begin + (stream.grid_samples - 1) / stream.sample_rate
    return f"{stream.path or 'the recording'}, which runs from {begin:.6g} to {end:.6g} s"


class Device:
    """Sends stretches of recordings one after another; between two of them the sample index jumps."""

    def __init__(self, bus: BusMap) -> None:
        self._framer = Framer(bus)
        self.block = block_samples(bus)
        """Number of samples that fill frames of every message."""
        self._layouts = bus.input_layouts
        # of the input messages
        self._keys = np.array([each.key for each in self._layouts], np.int64)
        delays = [float(message_timing(bus, n)["delay"]) for n in range(len(self._layouts))]
        self._delays = np.rint(np.array(delays) * NANOSECONDS).astype(np.int64)
        self._start = 0  # ns, of the stretch

    def begin(self, sample_rate: float) -> int:
        """Begin a stretch; the sample index of its first sample."""
        if self._framer.next_index:
            self._framer.pause(round(PAUSE * sample_rate))
        self._start = round(self._framer.next_index / sample_rate * NANOSECONDS)
        return self._framer.next_index

    def chunks(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """Cuts samples anew, every chunk but the last of a stretch a whole number of blocks of frames."""
        held: Chunk | None = None
        for chunk in chunks:
            if held is not None and held.stretch != chunk.stretch:
                yield held
                held = None
            joined = chunk if held is None else followed(held, chunk)
            full = joined.samples - joined.samples % self.block
            if full:
                yield cut(joined, 0, full)
            held = cut(joined, full, joined.samples) if full < joined.samples else None
        if held is not None:
            yield held

    def frames(self, chunk: Chunk) -> Iterator[BusFrame]:
        """Frames of a chunk of the stretch begun, as `chunks` gives them, stamped as received."""
        for framed, stamps in self._stamped(chunk):
            for number, stamp, payload in zip(
                framed.numbers.tolist(), stamps.tolist(), framed.payloads(), strict=True
            ):
                layout = self._layouts[number]
                frame = Frame(layout.frame_id, payload, stamp, layout.is_extended, layout.is_fd)
                yield BusFrame(layout.bus, frame)

    def blocks(self, chunk: Chunk) -> Iterator[FrameBlock]:
        """Frames of a chunk in arrays."""
        for framed, stamps in self._stamped(chunk):
            yield FrameBlock(self._keys[framed.numbers], stamps, framed.starts, framed.data)

    def _stamped(self, chunk: Chunk) -> Iterator[tuple[FramedRecording, NDArray[np.int64]]]:
        interval = 1.0 / chunk.sample_rate
        for framed in self._framer.framed(chunk, all_samples(chunk)):
            since = np.rint((chunk.first + framed.due) * interval * NANOSECONDS).astype(np.int64)
            yield framed, self._start + since + self._delays[framed.numbers]
