# Where a block of samples belongs in its message's stream: next, repeated, old, or the first of a new count.
#
# Of a repeated block the first wins; an older one is dropped; an index that jumps back or to 0 is a restart of the
# device.
#
# Resamples what lies between the samples of the grid, or further apart.
#
# A rail pressure of another time base, or a slower one, has on the grid the value that lies between its two neighbours.
# Neighbours too far apart are not joined: what lies between them is missing.
# What is a mean over the sample period that ends at a sample's time is of half a period before: on the grid, too, it
# follows, as if it were sampled there.
# A lift stays as it was sampled, with the time by which that was later: straight lines would cut off the corners of its
# ramps, which at 20 kHz is worth up to 3 % of the mass.


cdef enum:
    OLD_BLOCKS_OF_RESTART = 3  # consecutive ones that mean: the device began anew, its first blocks were lost
    SHUT = 4  # samples of a closed needle, from which on it is surely at rest


cdef double MISSED = 1.5  # spacings between two samples, from which on some are missing between them
cdef double SLIP = 0.1  # samples by which a lift may drift off the sample it belongs to while the needle moves


cdef int64_t place_block(
    Alignment* alignment, int64_t message, int64_t raw_index, int64_t count, bint contiguous, int64_t* first
) noexcept nogil:
    """Where a block of `count` samples belongs: Placing; first: unwrapped index of its first sample.

    raw_index: uint32 as sent; contiguous: the E2E counter follows the last one of this message. When accepted,
    the caller stores the samples (`store`, `follow`) and then lets the stream decide (`decide`).
    """
    memory = alignment.memory
    stream = &alignment.streams[message]
    cdef int64_t placing
    start = _unwrapped(alignment, message, raw_index)
    if not stream.seen:
        _begin_stream(alignment, message, start, count)
        first[0] = start
        return PLACING_ACCEPTED
    if start < stream.next_index:
        placing = _place_old(alignment, message, start, count, raw_index)
        if placing != PLACING_RESTARTED:
            first[0] = start
            return placing
        _begin_anew(alignment, message)
        _begin_stream(alignment, message, raw_index, count)
        first[0] = raw_index
        return PLACING_RESTARTED
    if raw_index == 0 and start > stream.next_index + SLOTS:
        _begin_anew(alignment, message)  # not lost up to the wrap of the index, but counting from 0 again
        _begin_stream(alignment, message, raw_index, count)
        first[0] = raw_index
        return PLACING_RESTARTED
    stream.old_blocks = 0
    if start > stream.next_index and stream.on_grid:
        stream.jump_block = stream.last_start
        stream.jump_from = stream.next_index
        stream.jump_to = start
        stream.jump_contiguous = contiguous
        decide_until(alignment, start + count - SLOTS // 2)
    _extend(alignment, message, start, count)
    first[0] = start
    return PLACING_ACCEPTED


cdef int64_t _unwrapped(Alignment* alignment, int64_t message, int64_t raw_index) noexcept nogil:
    """The index nearest to what is expected that equals `raw_index` modulo 2^32."""
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


cdef void _extend(Alignment* alignment, int64_t message, int64_t start, int64_t count) noexcept nogil:
    memory = alignment.memory
    stream = &alignment.streams[message]
    stream.last_start = start
    stream.next_index = start + count
    if stream.on_grid:
        memory.newest = max(memory.newest, stream.next_index)


cdef void _begin_stream(
    Alignment* alignment, int64_t message, int64_t start, int64_t count
) noexcept nogil:
    stream = &alignment.streams[message]
    _extend(alignment, message, start, count)
    stream.seen = True
    stream.first_index = start
    stream.jump_block = start
    stream.jump_from = start
    stream.jump_to = start
    stream.jump_contiguous = False
    stream.old_blocks = 0


cdef int64_t _place_old(
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


cdef void _begin_anew(Alignment* alignment, int64_t message) noexcept nogil:
    """The message's device counts from a new index: where that is the grid, forget what waits in every message."""
    memory = alignment.memory
    memory.restarts += 1
    alignment.followers[message].begun = False
    if not alignment.streams[message].on_grid:
        return
    for m in range(memory.stream_count):
        alignment.followers[m].begun = False
        if alignment.streams[m].on_grid:
            alignment.streams[m].seen = False
    for k in range(SLOTS):
        alignment.slots[k].index = -1
    memory.begun = False
    memory.newest = 0
    memory.next_break = BREAK_RESTART


cdef void follow(
    Alignment* alignment, int64_t message, double position, const double* values
) noexcept nogil:
    """Take one sample of a follower: where it lies on the grid, and its values (MAX_INPUTS,) [SI].

    A sample without a value, or not after the last one, is left out.
    """
    cdef bint missed
    memory = alignment.memory
    follower = &alignment.followers[message]
    for role in range(MAX_INPUTS):
        if (follower.roles >> role) & 1 and not abs(values[role]) < IMPOSSIBLE[role]:
            return
    end = _end_of_grid(alignment)
    memory.newest = max(memory.newest, min(<int64_t> position, end + SLOTS // 2 + 1))
    distance = position - follower.position
    if follower.begun and distance <= 0.0:
        return
    if position >= end + SLOTS // 2:
        return  # it would take the place of samples that still wait
    if not follower.begun or distance > follower.reach:
        _begin_follower(follower, position)
    else:
        last = <int64_t> floor(position)
        missed = distance > MISSED * follower.spacing
        first = max(memory.next_index, end - SLOTS + 1)
        for index in range(max(follower.next_index, first), last + 1):
            share = (index - follower.position) / distance
            for role in range(MAX_INPUTS):
                if role != LIFT and (follower.roles >> role) & 1:
                    value = follower.values[role] + share * (values[role] - follower.values[role])
                    store(alignment, index, role, value, missed, share if follower.spacing == 1.0 else 0.0)
        follower.next_index = last + 1
        if (follower.roles >> LIFT) & 1:
            _follow_lift(alignment, follower, position, values[LIFT], first)
    follower.stale = False
    follower.position = position
    for role in range(MAX_INPUTS):
        follower.values[role] = values[role]


cdef void _follow_lift(
    Alignment* alignment, Follower* follower, double position, double lift, int64_t first
) noexcept nogil:
    """The lift [m] of a follower that lies at `position`, with those missed before it, from the index `first` on.

    Two clocks drift: now and then a sample of the grid has two lifts, or none. That is settled while the needle is
    closed, where it means nothing; while it moves, one lift belongs to one sample.
    """
    cdef bint closed
    closed = lift <= alignment.memory.closed_lift
    follower.shut_for = follower.shut_for + 1 if closed else 0
    distance = position - follower.position
    row = follower.lift_row + <int64_t> floor(distance + 0.5)
    if follower.shut_for >= SHUT or not abs(position - row - 0.5) <= 0.5 + SLIP:
        row = <int64_t> floor(position)
    if row <= follower.lift_row:
        return
    after = min(max(position - row, 0.0), 1.0)
    begin = follower.lift_row + follower.lift_after
    for index in range(max(follower.lift_row + 1, first), row + 1):
        share = <double> (index - follower.lift_row) / (row - follower.lift_row)
        value = lift + (1.0 - share) * (follower.values[LIFT] - lift)  # to the last bit its own
        place = min(max(begin + share * (row + after - begin) - index, 0.0), 1.0)
        store(alignment, index, LIFT, value, index < row and distance > MISSED, place)
    follower.lift_row = row
    follower.lift_after = after


cdef int64_t _end_of_grid(Alignment* alignment) noexcept nogil:
    """The index beyond all samples on the grid."""
    memory = alignment.memory
    cdef int64_t end = 0
    for m in range(memory.stream_count):
        if alignment.streams[m].on_grid:
            end = max(end, alignment.streams[m].next_index)
    return end


cdef void _begin_follower(Follower* follower, double position) noexcept nogil:
    """Nothing is known before this sample."""
    if not follower.begun:
        follower.first_index = <int64_t> ceil(position)
    follower.begun = True
    follower.next_index = <int64_t> ceil(position)
    follower.lift_row = <int64_t> ceil(position) - 1
    follower.lift_after = position - follower.lift_row
    follower.shut_for = 0
