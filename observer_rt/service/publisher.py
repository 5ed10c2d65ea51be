"""Samples of the observer into injection-rate frames: every index once, in blocks that carry their index."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus.codec import encode
from observer_rt.bus.e2e import protect
from observer_rt.bus.mapping import HEADER_SIGNALS, OutputMessage
from observer_rt.continuity import Break
from observer_rt.observer.state import RING, Observer
from observer_rt.units import MM3_PER_MS

MAX_FRAME = 64  # bytes
FRAMES = 512  # that one input frame can cause at the most, with a wide margin
_HEADER = len(HEADER_SIGNALS)
_MASK = RING - 1
_RESTART = int(Break.RESTART)

OUT_FRAME = np.dtype([("length", np.int64), ("payload", np.uint8, (MAX_FRAME,))], align=True)

PUBLISHER = np.dtype(
    [
        ("published", np.int64),  # position in the observer's stream of the next sample to publish
        ("block_start", np.int64),  # index of the block's first sample
        ("filled", np.int64),  # of the block, 0: none begun
        ("block_valid", np.bool_),
        ("block_state", np.int64),
        ("learning", np.bool_),
        ("length", np.int64),
        ("data_id", np.int64),  # -1: not protected
        ("counter", np.int64),
        ("frames", np.int64),  # ready in `out`
    ],
    align=True,
)


class Publisher(NamedTuple):
    """Publisher as compiled functions see it; `out` holds `memory[0].frames` frames for the caller.

    values: what is encoded: SampleIndex, Valid, Learning, State, then the block's rates.
    """

    memory: NDArray[np.void]  # (1,) PUBLISHER
    table: NDArray[np.void]  # SIGNAL
    values: NDArray[np.float64]
    out: NDArray[np.void]  # (FRAMES,) OUT_FRAME


def make_publisher(message: OutputMessage, samples: int, learning: bool) -> Publisher:
    """Publisher of blocks of `samples` rates in `message`."""
    publisher = Publisher(
        np.zeros(1, PUBLISHER), message.table, np.full(_HEADER + samples, np.nan), np.zeros(FRAMES, OUT_FRAME)
    )
    memory = publisher.memory[0]
    memory["learning"] = learning
    memory["length"] = message.layout.length
    memory["data_id"] = -1 if message.layout.e2e_data_id is None else message.layout.e2e_data_id
    return publisher


@njit(cache=True, nogil=True)
def publish(publisher: Publisher, observer: Observer) -> None:
    """Frames of all blocks completed by the samples processed since the last call."""
    memory = publisher.memory[0]
    samples = publisher.values.shape[0] - _HEADER
    while memory.published < observer.memory[0].processed:
        row = observer.ring[memory.published & _MASK]
        if memory.filled > 0 and (row.broken == _RESTART or row.index >= memory.block_start + samples):
            flush(publisher)
        if memory.filled == 0:
            memory.block_start = row.index
            memory.block_valid = True
            publisher.values[_HEADER:] = np.nan
        place = row.index - memory.block_start
        publisher.values[_HEADER + place] = row.injection_rate / MM3_PER_MS
        memory.filled = place + 1
        memory.block_valid = memory.block_valid and row.valid
        memory.block_state = row.state
        memory.published += 1
        if memory.filled == samples:
            flush(publisher)


@njit(cache=True, nogil=True)
def flush(publisher: Publisher) -> None:
    """The block under way into a frame, what is missing of it as not available; nothing without a block."""
    memory = publisher.memory[0]
    if memory.filled == 0:
        return
    publisher.values[0] = memory.block_start & 0xFFFFFFFF
    publisher.values[1] = memory.block_valid
    publisher.values[2] = memory.learning
    publisher.values[3] = memory.block_state
    frame = publisher.out[memory.frames]
    frame.payload[:] = 0
    frame.length = memory.length
    encode(publisher.values, publisher.table, frame.payload)
    if memory.data_id >= 0:
        protect(frame.payload, memory.length, memory.data_id, memory.counter)
        memory.counter = (memory.counter + 1) & 0xFF
    memory.filled = 0
    memory.frames += 1
