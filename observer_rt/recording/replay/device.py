"""A measuring device that sends recordings: frames as a bus receives them, sample index and time going on."""

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.frame_block import FrameBlock
from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.recording.replay.framing import Framed, Framer, grid_samples, message_timing, whole
from observer_rt.recording.signals.chunks import cut, followed
from observer_rt.recording.signals.recording import Chunk

NANOSECONDS = 1e9  # in a second
PAUSE = 1.0  # s, between two recordings, and between two stretches of one


class Device:
    """Sends stretches of recordings one after another; between two of them the sample index jumps."""

    def __init__(self, bus: BusMap) -> None:
        self._framer = Framer(bus)
        self._block = math.lcm(*(grid_samples(bus, number) for number in range(len(bus.input_layouts))))
        self._layouts = bus.input_layouts
        # of the input messages
        self._keys = np.array(
            [frame_key(each.frame_id, each.is_extended, each.bus) for each in self._layouts], np.int64
        )
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
        """The same samples, every chunk but the last of a stretch a whole number of blocks of frames."""
        held: Chunk | None = None
        for chunk in chunks:
            if held is not None and held.stretch != chunk.stretch:
                yield held
                held = None
            joined = chunk if held is None else followed(held, chunk)
            full = joined.samples - joined.samples % self._block
            if full:
                yield cut(joined, 0, full)
            held = cut(joined, full, joined.samples) if full < joined.samples else None
        if held is not None:
            yield held

    def frames(self, chunk: Chunk) -> Iterator[BusFrame]:
        """Of a chunk of the stretch begun, as `chunks` gives them, stamped as received."""
        for framed, stamps in self._stamped(chunk):
            for number, stamp, payload in zip(
                framed.numbers.tolist(), stamps.tolist(), framed.payloads(), strict=True
            ):
                layout = self._layouts[number]
                frame = Frame(layout.frame_id, payload, stamp, layout.is_extended, layout.is_fd)
                yield BusFrame(layout.bus, frame)

    def blocks(self, chunk: Chunk) -> Iterator[FrameBlock]:
        """The same in arrays."""
        for framed, stamps in self._stamped(chunk):
            yield FrameBlock(self._keys[framed.numbers], stamps, framed.starts, framed.data)

    def _stamped(self, chunk: Chunk) -> Iterator[tuple[Framed, NDArray[np.int64]]]:
        interval = 1.0 / chunk.sample_rate
        for framed in self._framer.framed(chunk, whole(chunk)):
            since = np.rint((chunk.first + framed.due) * interval * NANOSECONDS).astype(np.int64)
            yield framed, self._start + since + self._delays[framed.numbers]
