"""Samples of the observer into injection-rate frames: every index once, in blocks that carry their index."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.codec import SIGNAL, encode
from observer_rt.bus.database.e2e import PROTECTION, protect
from observer_rt.bus.mapping.input_tables import LONGEST_FRAME
from observer_rt.bus.mapping.output_messages import HEADER_SIGNALS, RateMessage
from observer_rt.foundation.compiled import inner, inner_separate, separate
from observer_rt.foundation.continuity import Break
from observer_rt.foundation.referenced import referenced
from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.observer.stream.state import RING, Observer, State

FRAMES = 512  # that one input frame can cause at the most, with a wide margin
_SAMPLE_INDEX, _VALID, _LEARNING, _STATE = (
    HEADER_SIGNALS.index(name) for name in ("SampleIndex", "Valid", "Learning", "State")
)
_MASK = RING - 1
_DEGRADED = int(State.DEGRADED)

OUT_FRAME = np.dtype([("length", np.int64), ("payload", np.uint8, (LONGEST_FRAME,))], align=True)

PUBLISHER = np.dtype(
    [
        ("published", np.int64),  # position in the observer's stream of the next sample to publish
        ("block_start", np.int64),  # index of the block's first sample
        ("filled", np.int64),  # of the block, 0: none begun
        ("block_valid", np.bool_),  # all of it so far, without a gap
        ("block_state", np.int64),
        ("learning", np.bool_),
        ("contested", np.bool_),  # another node sends the same: nothing that goes out is valid
        ("header", np.int64, (len(HEADER_SIGNALS),)),  # their places among the values, -1: not in the message
        ("samples", np.int64),  # of a block, 0: no rates are published
        ("length", np.int64),
        ("protection", PROTECTION),
        ("counter", np.int64),
        ("frames", np.int64),  # ready in `out`
    ],
    align=True,
)


@referenced()
class Publisher(NamedTuple):
    """Publisher as compiled functions see it; `out` holds `memory[0].frames` frames for the caller.

    values: what is encoded; the block's rates come last.
    """

    memory: NDArray[np.void]  # (1,) PUBLISHER
    table: NDArray[np.void]  # SIGNAL
    values: NDArray[np.float64]
    out: NDArray[np.void]  # (FRAMES,) OUT_FRAME


def make_publisher(message: RateMessage | None, learning: bool) -> Publisher:
    """Publisher of blocks of rates in `message`; None: of nothing."""
    if message is None:
        return Publisher(np.zeros(1, PUBLISHER), np.zeros(0, SIGNAL), np.zeros(0), np.zeros(0, OUT_FRAME))
    names = message.page.names
    publisher = Publisher(
        np.zeros(1, PUBLISHER), message.page.table, np.full(len(names), np.nan), np.zeros(FRAMES, OUT_FRAME)
    )
    memory = publisher.memory[0]
    memory["learning"] = learning
    memory["header"] = [names.index(name) if name in names else -1 for name in HEADER_SIGNALS]
    memory["samples"] = message.samples
    memory["length"] = message.layout.length
    memory["protection"] = message.layout.protection
    return publisher


@inner_separate
def publish(publisher: Publisher, observer: Observer) -> None:
    """Frames of all blocks completed by the samples processed since the last call."""
    memory = publisher.memory[0]
    samples = memory.samples
    if samples == 0:
        return
    rates = publisher.values[publisher.values.size - samples :]
    while memory.published < observer.memory[0].processed:
        row = observer.ring[memory.published & _MASK]
        if memory.filled > 0 and (row.broken == Break.RESTART or row.index >= memory.block_start + samples):
            flush(publisher)
        if memory.filled == 0:
            memory.block_start = row.index
            memory.block_valid = True
            rates[:] = np.nan
        place = row.index - memory.block_start
        rates[place] = row.injection_rate / MM3_PER_MS
        memory.block_valid = memory.block_valid and row.valid and place == memory.filled
        memory.filled = place + 1
        memory.block_state = row.state
        memory.published += 1
        if memory.filled == samples:
            flush(publisher)


@separate
def flush(publisher: Publisher) -> None:
    """The block under way into a frame, not valid if anything is missing of it; nothing without a block."""
    memory = publisher.memory[0]
    if memory.filled == 0:
        return
    is_complete = memory.filled == memory.samples
    _put(publisher, _SAMPLE_INDEX, memory.block_start & 0xFFFFFFFF)
    _put(publisher, _VALID, memory.block_valid and is_complete and not memory.contested)
    _put(publisher, _LEARNING, memory.learning)
    _put(publisher, _STATE, _DEGRADED if memory.contested else memory.block_state)
    frame = publisher.out[memory.frames]
    frame.payload[:] = 0
    frame.length = memory.length
    encode(publisher.values, publisher.table, frame.payload)
    protect(frame.payload, memory.length, memory.protection, memory.counter)
    memory.counter += 1
    memory.filled = 0
    memory.frames += 1


@inner
def _put(publisher: Publisher, signal: int, value: float) -> None:
    """One signal of the header, where the message has it."""
    place = publisher.memory[0].header[signal]
    if place >= 0:
        publisher.values[place] = value
