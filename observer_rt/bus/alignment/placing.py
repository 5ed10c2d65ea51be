"""Where a block of samples belongs in its message's stream: next, repeated, old, or the first of a new count.

Of a repeated block the first wins; an older one is dropped; an index that jumps back or to 0 is a restart of the
device.
"""

from enum import IntEnum

from observer_rt.bus.alignment.alignment import decide_until
from observer_rt.bus.alignment.memory import Alignment
from observer_rt.bus.mapping.timing import SLOTS
from observer_rt.foundation.compiled import inner, separate
from observer_rt.foundation.continuity import Break

OLD_BLOCKS_OF_RESTART = (
    3  # consecutive old blocks that mean: the device began anew, its first blocks were lost
)


class Placing(IntEnum):
    """What became of a block."""

    ACCEPTED = 0
    REPEATED = 1
    OLD = 2
    RESTARTED = 3  # accepted, as the first of a new count


@separate
def place_block(
    alignment: Alignment, message: int, raw_index: int, count: int, contiguous: bool
) -> tuple[int, int]:
    """Where a block of `count` samples belongs: (Placing, unwrapped index of its first sample).

    raw_index: uint32 as sent; contiguous: the E2E counter follows the last one of this message. When accepted,
    the caller stores the samples (`store`, `follow`) and then lets the stream decide (`decide`).
    """
    memory = alignment.memory[0]
    stream = memory.streams[message]
    start = _unwrapped(alignment, message, raw_index)
    if not stream.seen:
        _begin_stream(alignment, message, start, count)
        return Placing.ACCEPTED, start
    if start < stream.next_index:
        placing = _place_old(alignment, message, start, count, raw_index)
        if placing != Placing.RESTARTED:
            return placing, start
        _begin_anew(alignment, message)
        _begin_stream(alignment, message, raw_index, count)
        return Placing.RESTARTED, raw_index
    if raw_index == 0 and start > stream.next_index + SLOTS:
        _begin_anew(alignment, message)  # not lost up to the wrap of the index, but counting from 0 again
        _begin_stream(alignment, message, raw_index, count)
        return Placing.RESTARTED, raw_index
    stream.old_blocks = 0
    if start > stream.next_index and stream.on_grid:
        stream.jump_block = stream.last_start
        stream.jump_from = stream.next_index
        stream.jump_to = start
        stream.jump_contiguous = contiguous
        decide_until(alignment, start + count - SLOTS // 2)
    _extend(alignment, message, start, count)
    return Placing.ACCEPTED, start


@inner
def _unwrapped(alignment: Alignment, message: int, raw_index: int) -> int:
    """The index nearest to what is expected that equals `raw_index` modulo 2^32."""
    memory = alignment.memory[0]
    stream = memory.streams[message]
    if stream.seen:
        expected = stream.next_index
    elif not stream.on_grid:
        return int(raw_index)
    elif memory.begun:
        expected = memory.next_index
    else:
        for m in range(memory.stream_count):
            if memory.streams[m].seen and memory.streams[m].on_grid:
                expected = memory.streams[m].next_index
                break
        else:
            return int(raw_index)
    ahead = (raw_index - expected) & 0xFFFFFFFF
    if ahead >= 0x80000000:
        ahead -= 0x100000000
    return int(expected + ahead)


@inner
def _extend(alignment: Alignment, message: int, start: int, count: int) -> None:
    memory = alignment.memory[0]
    stream = memory.streams[message]
    stream.last_start = start
    stream.next_index = start + count
    if stream.on_grid:
        memory.newest = max(memory.newest, stream.next_index)


@inner
def _begin_stream(alignment: Alignment, message: int, start: int, count: int) -> None:
    stream = alignment.memory[0].streams[message]
    _extend(alignment, message, start, count)
    stream.seen = True
    stream.first_index = start
    stream.jump_block = start
    stream.jump_from = start
    stream.jump_to = start
    stream.jump_contiguous = False
    stream.old_blocks = 0


@inner
def _place_old(alignment: Alignment, message: int, start: int, count: int, raw_index: int) -> int:
    """`Placing` of a block from before the expected index: repeated, old, or the device began anew."""
    memory = alignment.memory[0]
    stream = memory.streams[message]
    if start == stream.last_start:
        memory.repeated += 1
        return Placing.REPEATED
    stream.old_blocks = stream.old_blocks + 1 if start == stream.old_next else 1
    stream.old_next = start + count
    if raw_index == 0 or stream.old_blocks >= OLD_BLOCKS_OF_RESTART:
        return Placing.RESTARTED
    memory.old += 1
    return Placing.OLD


@inner
def _begin_anew(alignment: Alignment, message: int) -> None:
    """The message's device counts from a new index: where that is the grid, forget what waits in every message."""
    memory = alignment.memory[0]
    memory.restarts += 1
    memory.followers[message].begun = False
    if not memory.streams[message].on_grid:
        return
    for m in range(memory.stream_count):
        memory.followers[m].begun = False
        if memory.streams[m].on_grid:
            memory.streams[m].seen = False
    for k in range(SLOTS):
        alignment.slots[k].index = -1
    memory.begun = False
    memory.newest = 0
    memory.next_break = Break.RESTART
