"""Where a block of samples belongs in its message's stream: next, repeated, old, or the first of a new count.

Of a repeated block the first wins; an older one is dropped; an index that jumps back or to 0 is a restart of the
device.

Resamples what lies between the samples of the grid, or further apart.

A rail pressure of another time base, or a slower one, has on the grid the value that lies between its two neighbours.
Neighbours too far apart are not joined: what lies between them is missing.
What is a mean over the sample period that ends at a sample's time is of half a period before: on the grid, too, it
follows, as if it were sampled there.
A lift stays as it was sampled, with the time by which that was later: straight lines would cut off the corners of its
ramps, which at 20 kHz is worth up to 3 % of the mass.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.alignment import IMPOSSIBLE, NEEDLE_LIFT, Alignment, decide_until, store
from observer_rt.bus.mapping.input_tables import MAX_INPUTS
from observer_rt.bus.mapping.timing import SLOTS
from observer_rt.foundation.compiled import inner, separate
from observer_rt.foundation.continuity import Break

OLD_BLOCKS_OF_RESTART = 3  # consecutive ones that mean: the device began anew, its first blocks were lost


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


SHUT = 4  # samples of a closed needle, from which on it is surely at rest
MISSED = 1.5  # spacings between two samples, from which on some are missing between them
SLIP = 0.1  # samples by which a lift may drift off the sample it belongs to while the needle moves


@separate
def follow(alignment: Alignment, message: int, position: float, values: NDArray[np.float64]) -> None:
    """Take one sample of a follower: where it lies on the grid, and its values (MAX_INPUTS,) [SI].

    A sample without a value, or not after the last one, is left out.
    """
    memory = alignment.memory[0]
    follower = memory.followers[message]
    for role in range(MAX_INPUTS):
        if (follower.roles >> role) & 1 and not abs(values[role]) < IMPOSSIBLE[role]:
            return
    end = _end_of_grid(alignment)
    memory.newest = max(memory.newest, min(int(position), end + SLOTS // 2 + 1))
    distance = position - follower.position
    if follower.begun and distance <= 0.0:
        return
    if position >= end + SLOTS // 2:
        return  # it would take the place of samples that still wait
    if not follower.begun or distance > follower.reach:
        _begin(follower, position)
    else:
        last = math.floor(position)
        missed = distance > MISSED * follower.spacing
        first = max(memory.next_index, end - SLOTS + 1)
        for index in range(max(follower.next_index, first), last + 1):
            share = (index - follower.position) / distance
            for role in range(MAX_INPUTS):
                if role != NEEDLE_LIFT and (follower.roles >> role) & 1:
                    value = follower.values[role] + share * (values[role] - follower.values[role])
                    store(alignment, index, role, value, missed, share if follower.spacing == 1.0 else 0.0)
        follower.next_index = last + 1
        if (follower.roles >> NEEDLE_LIFT) & 1:
            _follow_lift(alignment, follower, position, values[NEEDLE_LIFT], first)
    follower.stale = False
    follower.position = position
    for role in range(MAX_INPUTS):  # a copy of slices takes 4 s to compile, with the error of their lengths
        follower.values[role] = values[role]


@inner
def _follow_lift(alignment, follower, position, lift, first):  # type: ignore[no-untyped-def]
    """The lift [m] of a follower that lies at `position`, with those missed before it, from the index `first` on.

    Two clocks drift: now and then a sample of the grid has two lifts, or none. That is settled while the needle is
    closed, where it means nothing; while it moves, one lift belongs to one sample.
    """
    closed = lift <= alignment.memory[0].closed_lift
    follower.shut_for = follower.shut_for + 1 if closed else 0
    distance = position - follower.position
    row = follower.lift_row + math.floor(distance + 0.5)
    if follower.shut_for >= SHUT or not abs(position - row - 0.5) <= 0.5 + SLIP:
        row = math.floor(position)
    if row <= follower.lift_row:
        return
    after = min(max(position - row, 0.0), 1.0)
    begin = follower.lift_row + follower.lift_after
    for index in range(max(follower.lift_row + 1, first), row + 1):
        share = (index - follower.lift_row) / (row - follower.lift_row)
        value = lift + (1.0 - share) * (follower.values[NEEDLE_LIFT] - lift)  # to the last bit its own
        place = min(max(begin + share * (row + after - begin) - index, 0.0), 1.0)
        store(alignment, index, NEEDLE_LIFT, value, index < row and distance > MISSED, place)
    follower.lift_row = row
    follower.lift_after = after


@inner
def _end_of_grid(alignment: Alignment) -> int:
    """The index beyond all samples on the grid."""
    memory = alignment.memory[0]
    end = 0
    for m in range(memory.stream_count):
        if memory.streams[m].on_grid:
            end = max(end, memory.streams[m].next_index)
    return end


@inner
def _begin(follower, position: float) -> None:  # type: ignore[no-untyped-def]
    """Nothing is known before this sample."""
    if not follower.begun:
        follower.first_index = math.ceil(position)
    follower.begun = True
    follower.next_index = math.ceil(position)
    follower.lift_row = math.ceil(position) - 1
    follower.lift_after = position - follower.lift_row
    follower.shut_for = 0
