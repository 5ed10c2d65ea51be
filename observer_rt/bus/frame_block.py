"""Frames one after another in arrays, as compiled code takes many of them at once."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.links.link import BusFrame

AT_ONCE = 256  # frames of a block: they bring far fewer samples than the observer remembers


class FrameBlock(NamedTuple):
    """Frames in the order received (n of them)."""

    keys: NDArray[np.int64]
    """(n,), as by `frame_key`."""
    stamps: NDArray[np.int64]
    """(n,), when each was received [ns], as of `Frame`."""
    starts: NDArray[np.int64]
    """(n + 1,), where the payload of each begins in `data`, and where that of the last one ends."""
    data: NDArray[np.uint8]
    """The payloads, one after another."""

    @property
    def frames(self) -> int:
        """How many there are."""
        return int(self.keys.size)


def block_of(frames: Sequence[BusFrame]) -> FrameBlock:
    """The frames in arrays."""
    return FrameBlock(
        np.array([frame_key(frame.frame_id, frame.is_extended, bus) for bus, frame in frames], np.int64),
        np.array([frame.stamp_ns for _, frame in frames], np.int64),
        np.cumsum([0, *(len(frame.payload) for _, frame in frames)], dtype=np.int64),
        np.frombuffer(b"".join(frame.payload for _, frame in frames), np.uint8),
    )


def blocks_of(frames: Iterable[BusFrame]) -> Iterator[FrameBlock]:
    """All of them, so many at a time that none waits long."""
    coming = iter(frames)
    while some := list(islice(coming, AT_ONCE)):
        yield block_of(some)
