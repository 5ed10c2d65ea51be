# Alignment of blocks of samples to one gapless stream: complete samples, and their order, as bus.alignment says.
#
# Samples of other time bases than the grid's follow on it by `resampling`; the place of a block is found by `placing`.

from libc.stdint cimport INT64_MAX, INT64_MIN, int64_t

from observer_rt.core.frames.records cimport MAX_INPUTS, Alignment, Follower, Slot
from observer_rt.core.stream.state cimport BREAK_JUMP, BREAK_LOSS, BREAK_NONE, LIFT, RECORDED_MASK, Recorded

cdef enum:
    SLOTS = 4096  # samples that may wait for another message
    SLOT_MASK = SLOTS - 1
    MAX_INTERPOLATED = 2  # samples that a gap may have without being a loss
    PATIENCE = SLOTS // 2  # samples that wait for a message, but one that holds, before it counts as stale

cdef extern from *:
    """
    static const double IMPOSSIBLE[3] = {1e9, 1e-2, 1e9};
    """
    # What no sensor of an injector can mean [Pa, m, Pa]: a value beyond it, or none at all, is missing.
    const double[3] IMPOSSIBLE


cdef inline void store(
    Alignment* alignment, int64_t index, int64_t role, double value, bint interpolated, double share
) noexcept nogil:
    """Put one value [SI] of a role at its index; NaN and impossible values count as missing.

    share: of a lift, by which share of an interval it was taken later than that; of an interpolated value, that of
    the later one of its two neighbours.
    """
    slot = &alignment.slots[index & SLOT_MASK]
    if slot.index != index:
        slot.index, slot.present, slot.interpolated = index, 0, False
    if abs(value) < IMPOSSIBLE[role]:
        slot.present |= 1 << role
        slot.values[role] = value
        slot.shares[role] = share
        slot.interpolated = slot.interpolated or interpolated


cdef inline void decide(Alignment* alignment) noexcept nogil:
    """Write to the ring what all messages have passed; a follower that stays away is not waited for long."""
    memory = alignment.memory
    cdef int64_t frontier = INT64_MAX
    for m in range(memory.stream_count):
        if alignment.streams[m].spared:
            continue
        if alignment.streams[m].on_grid:
            if not alignment.streams[m].seen:
                return
            frontier = min(frontier, alignment.streams[m].next_index)
        elif not alignment.followers[m].begun:
            return
    for m in range(memory.stream_count):
        if alignment.followers[m].roles != 0 and not alignment.streams[m].spared:
            frontier = min(frontier, _frontier_of(alignment, &alignment.followers[m], frontier))
    decide_until(alignment, frontier)


cdef inline void decide_until(Alignment* alignment, int64_t frontier) noexcept nogil:
    """Write the complete samples before `frontier`; the others are missing."""
    memory = alignment.memory
    complete, lacking = (1 << MAX_INPUTS) - 1, memory.lacks_lift << LIFT
    if not memory.begun and not _begin_grid(alignment):
        return
    index = memory.next_index
    missing = 0
    while index < frontier:
        slot = &alignment.slots[index & SLOT_MASK]
        if slot.index == index and (slot.present | lacking) == complete:
            if lacking:
                slot.values[LIFT] = slot.shares[LIFT] = 0.0
            _pass_on(alignment, slot)
            missing = 0
            index += 1
            continue
        missing += 1
        index += 1
        for m in range(memory.stream_count):
            stream = &alignment.streams[m]
            if stream.on_grid and not stream.spared and stream.jump_from <= index < stream.jump_to:
                index = min(stream.jump_to, frontier)
        if missing > SLOTS:
            index = max(index, frontier - SLOTS)
    memory.next_index = max(memory.next_index, frontier)


cdef inline bint _begin_grid(Alignment* alignment) noexcept nogil:
    """Decide first on the first sample that every message has; False while a message has sent none."""
    memory = alignment.memory
    cdef int64_t begin = INT64_MIN
    for m in range(memory.stream_count):
        stream = &alignment.streams[m]
        follower = &alignment.followers[m]
        if stream.spared:
            continue
        if not (stream.seen if stream.on_grid else follower.begun):
            return False
        begin = max(begin, stream.first_index if stream.on_grid else follower.first_index)
    memory.next_index, memory.begun = begin, True
    return True


cdef inline int64_t _frontier_of(Alignment* alignment, Follower* follower, int64_t others) noexcept nogil:
    """The index up to which a follower has sent all it will, when the others have sent theirs up to `others`."""
    cdef double patience = follower.reach if follower.holds else <double> PATIENCE
    if others <= follower.position + patience:
        if (follower.roles >> LIFT) & 1:
            return min(follower.next_index, follower.lift_row + 1)
        return follower.next_index
    if follower.holds:
        while follower.next_index <= follower.position + follower.reach:
            for role in range(MAX_INPUTS):
                if (follower.roles >> role) & 1:
                    store(alignment, follower.next_index, role, follower.values[role], True, 0.0)
            follower.next_index += 1
    follower.stale = True
    return others


cdef inline void _pass_on(Alignment* alignment, Slot* slot) noexcept nogil:
    """Write a complete sample to the ring, with the `Break` by its distance from the last one."""
    memory = alignment.memory
    gap = slot.index - memory.last_index - 1
    cdef int64_t broken = BREAK_NONE
    if memory.next_break != BREAK_NONE:
        broken, memory.next_break = memory.next_break, BREAK_NONE
    elif 0 < gap <= MAX_INTERPOLATED:
        memory.lost += gap
        for k in range(1, gap + 1):
            row = _append(alignment, memory.last_index + k)
            row.interpolated = True
            for role in range(MAX_INPUTS):
                row.shares[role] = slot.shares[role]
                last = memory.last_values[role]
                row.values[role] = last + (slot.values[role] - last) * (<double> k / (gap + 1))
    elif gap > 0:
        if _is_legal_jump(alignment, slot):
            broken = BREAK_JUMP
            memory.jumps += 1
        else:
            broken = BREAK_LOSS
            memory.lost += gap
    row = _append(alignment, slot.index)
    row.broken = broken
    row.interpolated = slot.interpolated
    for role in range(MAX_INPUTS):
        row.shares[role] = slot.shares[role]
        row.values[role] = slot.values[role]
        memory.last_values[role] = slot.values[role]
    memory.last_index = slot.index


cdef inline Recorded* _append(Alignment* alignment, int64_t index) noexcept nogil:
    memory = alignment.memory
    row = &alignment.recorded[memory.decided & RECORDED_MASK]
    memory.decided += 1
    row.index, row.interpolated, row.broken = index, False, BREAK_NONE
    return row


cdef inline bint _is_legal_jump(Alignment* alignment, Slot* slot) noexcept nogil:
    """Whether all messages on the grid jumped here, with contiguous counters, the needle closed on both sides.

    The last block before the jump may end in samples that are not available.
    """
    memory = alignment.memory
    for m in range(memory.stream_count):
        stream = &alignment.streams[m]
        if stream.on_grid and not stream.spared and (
            not stream.jump_block <= memory.last_index < stream.jump_from
            or stream.jump_to != slot.index
            or not stream.jump_contiguous
        ):
            return False
    return (
        memory.last_values[LIFT] <= memory.closed_lift
        and slot.values[LIFT] <= memory.closed_lift
    )
