# Resamples signals whose samples lie between those of the grid, or further apart.
#
# A rail pressure of another time base, or a slower one, has on the grid the value that lies between its two neighbours.
# Neighbours too far apart are not joined: what lies between them is missing.
# What is a mean over the sample period that ends at a sample's time is of half a period before: on the grid, too, it
# follows, as if it were sampled there.
# A lift stays as it was sampled, with the time by which that was later: straight lines would cut off the corners of its
# ramps, which at 20 kHz is worth up to 3 % of the mass.

from libc.math cimport ceil, floor
from libc.stdint cimport int64_t

from observer_rt.core.frames.alignment cimport IMPOSSIBLE, SLOTS, store
from observer_rt.core.frames.records cimport MAX_INPUTS, Alignment, Follower
from observer_rt.core.stream.state cimport LIFT

cdef enum:
    SHUT = 4  # samples of a closed needle, from which on it is surely at rest

cdef extern from *:
    """
    #define MISSED 1.5
    #define SLIP 0.1
    """
    const double MISSED  # spacings between two samples, from which on some are missing between them
    const double SLIP  # samples by which a lift may drift off the sample it belongs to while the needle moves


cdef inline void follow(Alignment* alignment, int64_t message, double position, const double* values) noexcept nogil:
    """Take a sample of a follower: where it lies on the grid, and its values (MAX_INPUTS,) [SI], if it counts."""
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
    follower.stale, follower.position = False, position
    for role in range(MAX_INPUTS):
        follower.values[role] = values[role]


cdef inline void _follow_lift(
    Alignment* alignment, Follower* follower, double position, double lift, int64_t first
) noexcept nogil:
    """Store the lift [m] of a follower at `position`, and those missed before it, from the index `first` on.

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
    follower.lift_row, follower.lift_after = row, after


cdef inline int64_t _end_of_grid(Alignment* alignment) noexcept nogil:
    """The index beyond all samples on the grid."""
    memory = alignment.memory
    cdef int64_t end = 0
    for m in range(memory.stream_count):
        if alignment.streams[m].on_grid:
            end = max(end, alignment.streams[m].next_index)
    return end


cdef inline void _begin_follower(Follower* follower, double position) noexcept nogil:
    """Begin a follower anew, of which nothing is known before this sample."""
    if not follower.begun:
        follower.first_index = <int64_t> ceil(position)
    follower.begun, follower.shut_for = True, 0
    follower.next_index, follower.lift_row = <int64_t> ceil(position), <int64_t> ceil(position) - 1
    follower.lift_after = position - follower.lift_row
