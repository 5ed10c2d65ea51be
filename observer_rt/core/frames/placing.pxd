# Place of a block of samples in its message's stream: next, repeated, old, or the first of a new count.
#
# Of a repeated block the first wins. An older one is dropped, but several in a row are of a device that began anew, as
# is an index that jumps to 0 from further ahead than blocks are kept for.

from libc.stdint cimport int64_t

from observer_rt.core.frames.alignment cimport PATIENCE, SLOTS, decide_until
from observer_rt.core.frames.records cimport INDEX_MASK, Alignment
from observer_rt.core.stream.state cimport BREAK_RESTART

cdef enum:  # Placing
    PLACING_ACCEPTED, PLACING_REPEATED, PLACING_OLD, PLACING_RESTARTED

cdef enum:
    OLD_BLOCKS_OF_RESTART = 3  # consecutive ones that mean: the device began anew, its first blocks were lost


cdef inline int64_t place_block(
    Alignment* alignment, int64_t message, int64_t raw_index, int64_t count, bint contiguous, int64_t* first
) noexcept nogil:
    """Where a block of `count` samples belongs: Placing; first: unwrapped index of its first sample.

    raw_index: uint32 as sent; contiguous: the E2E counter follows the last one of this message. When accepted,
    the caller stores the samples (`store`, `follow`) and then lets the stream decide (`decide`).
    """
    memory = alignment.memory
    stream = &alignment.streams[message]
    cdef int64_t placing = PLACING_ACCEPTED
    start = _unwrapped(alignment, message, raw_index)
    first[0] = start
    if not stream.seen:
        _begin_stream(alignment, message, start, count)
        return PLACING_ACCEPTED
    if start < stream.next_index:
        placing = _place_old(alignment, message, start, count, raw_index)
        if placing != PLACING_RESTARTED:
            return placing
    elif raw_index == 0 and start > stream.next_index + SLOTS:
        placing = PLACING_RESTARTED  # not lost up to the wrap of the index, but counting from 0 again
    if placing == PLACING_RESTARTED:
        _begin_anew(alignment, message)
        _begin_stream(alignment, message, raw_index, count)
        first[0] = raw_index
        return placing
    stream.old_blocks = 0
    if start > stream.next_index and stream.on_grid:
        stream.jump_block, stream.jump_from, stream.jump_to = stream.last_start, stream.next_index, start
        stream.jump_contiguous = contiguous
        decide_until(alignment, start + count - PATIENCE)  # what waited longer is stale, and a jump needs its slots
    _extend(alignment, message, start, count)
    return placing


cdef inline int64_t _unwrapped(Alignment* alignment, int64_t message, int64_t raw_index) noexcept nogil:
    """The index nearest to the expected one that equals `raw_index` modulo 2^32."""
    cdef int64_t expected = 0
    memory = alignment.memory
    stream = &alignment.streams[message]
    if stream.seen:
        expected = stream.next_index
    elif not stream.on_grid:
        return raw_index
    elif memory.begun:
        expected = memory.next_index
    else:
        for m in range(memory.stream_count):
            if alignment.streams[m].seen and alignment.streams[m].on_grid:
                expected = alignment.streams[m].next_index
                break
        else:
            return raw_index
    cdef int64_t ahead = (raw_index - expected) & INDEX_MASK
    if ahead > INDEX_MASK // 2:
        ahead -= INDEX_MASK + 1
    return expected + ahead


cdef inline void _extend(Alignment* alignment, int64_t message, int64_t start, int64_t count) noexcept nogil:
    memory = alignment.memory
    stream = &alignment.streams[message]
    stream.last_start, stream.next_index = start, start + count
    if stream.on_grid and not stream.spared:
        memory.newest = max(memory.newest, stream.next_index)


cdef inline void _begin_stream(Alignment* alignment, int64_t message, int64_t start, int64_t count) noexcept nogil:
    stream = &alignment.streams[message]
    _extend(alignment, message, start, count)
    stream.seen = True
    stream.first_index = start
    stream.jump_block = stream.jump_from = stream.jump_to = start
    stream.jump_contiguous = False
    stream.old_blocks = 0


cdef inline int64_t _place_old(
    Alignment* alignment, int64_t message, int64_t start, int64_t count, int64_t raw_index
) noexcept nogil:
    """`Placing` of a block from before the expected index: repeated, old, or the device began anew."""
    memory = alignment.memory
    stream = &alignment.streams[message]
    if start == stream.last_start:
        memory.repeated += 1
        return PLACING_REPEATED
    stream.old_blocks = stream.old_blocks + 1 if start == stream.old_next else 1
    stream.old_next = start + count
    if raw_index == 0 or stream.old_blocks >= OLD_BLOCKS_OF_RESTART:
        return PLACING_RESTARTED
    memory.old += 1
    return PLACING_OLD


cdef inline void _begin_anew(Alignment* alignment, int64_t message) noexcept nogil:
    """The message's device counts from a new index: where that is the grid, forget what waits in every message."""
    memory = alignment.memory
    memory.restarts += 1
    alignment.followers[message].begun = False
    if not alignment.streams[message].on_grid or alignment.streams[message].spared:
        return
    for m in range(memory.stream_count):
        alignment.followers[m].begun = False
        if alignment.streams[m].on_grid:
            alignment.streams[m].seen = False
    for k in range(SLOTS):
        alignment.slots[k].index = -1
    memory.begun, memory.newest, memory.next_break = False, 0, BREAK_RESTART
