# Publishes samples of the observer in injection-rate frames: every index once, in blocks that carry their index.

from libc.math cimport NAN
from libc.stdint cimport int64_t
from libc.string cimport memset

from observer_rt.core.frames.codec cimport encode
from observer_rt.core.frames.e2e cimport protect
from observer_rt.core.frames.records cimport INDEX_MASK, LONGEST_FRAME, Publisher
from observer_rt.core.stream.state cimport BREAK_RESTART, MASK, STATE_DEGRADED, Observer

cdef enum:
    FRAMES = 512  # capacity for results
    FULL = FRAMES // 4  # ready, beyond which there is room for those of one input frame only, which are far fewer


cdef inline void publish(Publisher* publisher, Observer* observer) noexcept nogil:
    """Make frames of all blocks that the samples processed since the last call complete."""
    memory = publisher.memory
    samples = memory.samples
    if samples == 0:
        return
    rates = publisher.values + (publisher.signals - samples)
    while memory.published < observer.memory.positions.processed:
        row = &observer.ring[memory.published & MASK]
        if memory.filled > 0 and (row.broken == BREAK_RESTART or row.index >= memory.block_start + samples):
            flush(publisher)
        if memory.filled == 0:
            memory.block_start = row.index
            memory.block_valid = True
            for k in range(samples):
                rates[k] = NAN
        place = row.index - memory.block_start
        rates[place] = row.injection_rate / 1e-6  # mm3/ms
        memory.block_valid = memory.block_valid and row.valid and place == memory.filled
        memory.filled = place + 1
        memory.block_state = row.state
        memory.published += 1
        if memory.filled == samples:
            flush(publisher)


cdef inline void flush(Publisher* publisher) noexcept nogil:
    """Make a frame of the block under way, if there is one; it is not valid if anything is missing of it."""
    cdef bint is_complete
    memory = publisher.memory
    if memory.filled == 0:
        return
    is_complete = memory.filled == memory.samples
    header = &memory.header
    _put(publisher, header.sample_index, memory.block_start & INDEX_MASK)
    _put(publisher, header.valid, memory.block_valid and is_complete and not memory.contested)
    _put(publisher, header.learning, memory.learning)
    _put(publisher, header.state, STATE_DEGRADED if memory.contested else memory.block_state)
    frame = &publisher.out[memory.frames]
    memset(frame.payload, 0, LONGEST_FRAME)
    frame.length = memory.length
    encode(publisher.values, publisher.table, publisher.signals, frame.payload)
    protect(frame.payload, memory.length, &memory.protection, memory.counter)
    memory.counter += 1
    memory.filled = 0
    memory.frames += 1


cdef inline void _put(Publisher* publisher, int64_t place, double value) noexcept nogil:
    """Write one signal of the header, where the message has it."""
    if place >= 0:
        publisher.values[place] = value
