"""Recordings as frames: of a replay, whole or windowed, and of a device that sends one stretch after another."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from observer_rt.bus.links.link import BusFrame, Frame, FrameBlock
from observer_rt.bus.mapping.bus_map import BusMap, timing_row
from observer_rt.files.replay import framing
from observer_rt.files.signals.doubts import refuse_without_lift
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import SignalStream, cut, followed
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.units import NANOSECONDS, Ints

ENCODED_AT_ONCE = 1000  # samples, so that encoding delays no frame by much
PAUSE = 1.0  # s, between two recordings, and between two stretches of one


def recording_frames(stream: SignalStream, bus: BusMap, windowed: bool) -> Iterator[framing.TimedFrame]:
    """Frames of a measuring device, from time 0; windowed: only round injections. Raises `UserError` without any."""
    refuse_without_lift(stream, "replay a recording with a lift: frames of samples carry no commands")
    block = framing.block_samples(bus)
    spans = [framing.Span(0, stream.grid_samples)]
    if windowed:
        spans = _of_whole_frames(framing.windows_of(stream.on_one_grid()), block, stream.grid_samples)
    if not spans:
        raise UserError("--windowed", f"no injection in {stream.path or 'the recording'}", "send it continuous")
    piece = block * max(1, ENCODED_AT_ONCE // block)
    cut_up = (
        framing.Span(start, min(start + piece, span.end))
        for span in spans
        for start in range(span.start, span.end, piece)
    )
    return _frames_of(stream, bus, cut_up)


def _frames_of(stream: SignalStream, bus: BusMap, spans: Iterable[framing.Span]) -> Iterator[framing.TimedFrame]:
    framer, rate = framing.Framer(bus), stream.sample_rate
    interval = 1.0 / rate
    for piece in pieces(stream.on_one_grid(), spans):
        framer.next_index = piece.first  # samples between are not sent
        for frame in framer.frames(piece, framing.all_samples(piece)):
            yield frame._replace(time=(piece.first + round(frame.time * rate)) * interval)


def pieces(chunks: Iterable[Chunk], spans: Iterable[framing.Span]) -> Iterator[Chunk]:
    """The samples of rising, separate spans, out of the chunks of a stretch. Raises `RunError` if these end early."""
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


def _of_whole_frames(spans: Sequence[framing.Span], block: int, samples: int) -> list[framing.Span]:
    """The spans lengthened to whole frames, those that then touch joined: every index is sent once."""
    result: list[framing.Span] = []
    for span in spans:
        start = result.pop().start if result and span.start <= result[-1].end else span.start
        result.append(framing.Span(start, min(samples, start + -(-(span.end - start) // block) * block)))
    return result


class Device:
    """Sends stretches of recordings one after another; between two of them the sample index jumps."""

    def __init__(self, bus: BusMap) -> None:
        self._framer = framing.Framer(bus)
        self.block = framing.block_samples(bus)
        """Number of samples that fill frames of every message."""
        self._layouts = bus.input_layouts
        self._keys = np.array([layout.key for layout in self._layouts], np.int64)  # of the input messages
        delays = [float(timing_row(bus, n)["delay"]) for n in range(len(self._layouts))]
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
            for number, stamp, data in zip(framed.numbers.tolist(), stamps.tolist(), framed.payloads(), strict=True):
                layout = self._layouts[number]
                yield BusFrame(layout.bus, Frame(layout.frame_id, data, stamp, layout.is_extended, layout.is_fd))

    def blocks(self, chunk: Chunk) -> Iterator[FrameBlock]:
        for framed, stamps in self._stamped(chunk):
            yield FrameBlock(self._keys[framed.numbers], stamps, framed.starts, framed.data)

    def _stamped(self, chunk: Chunk) -> Iterator[tuple[framing.FramedRecording, Ints]]:
        interval = 1.0 / chunk.sample_rate
        for framed in self._framer.framed(chunk, framing.all_samples(chunk)):
            since = np.rint((chunk.first + framed.due) * interval * NANOSECONDS).astype(np.int64)
            yield framed, self._start + since + self._delays[framed.numbers]
