"""From blocks of samples to one gapless stream: joining by index, gaps, repeats, restarts, windowed sources.

The rules are those of the design, 4.2 "Time": (1) messages of one time base are joined by their unwrapped sample
index; (5) up to two missing samples are interpolated, more are a loss; a repeated block: the first wins; an older
one is dropped; an index that jumps back or to 0 is a restart of the device; (6) an index jump is legal only with a
contiguous E2E counter in every message and a closed needle before and after.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus.inputs import MAX_INPUTS, ROLES
from observer_rt.config import Role
from observer_rt.continuity import Break

SLOTS = 1 << 12  # samples that may wait for another message
MAX_INTERPOLATED = 2
OLD_BLOCKS_OF_RESTART = (
    3  # consecutive old blocks that mean: the device began anew, its first blocks were lost
)
# What no sensor of an injector can mean [Pa, m, Pa]: a value beyond it, or none at all, is missing.
IMPOSSIBLE = np.array([1e-2 if role is Role.NEEDLE_LIFT else 1e9 for role in ROLES])
_MASK = SLOTS - 1
_NEEDLE_LIFT = ROLES.index(Role.NEEDLE_LIFT)
_NONE = int(Break.NONE)
_START = int(Break.START)
_JUMP = int(Break.JUMP)
_LOSS = int(Break.LOSS)
_RESTART = int(Break.RESTART)

STREAM = np.dtype(
    [
        ("seen", np.bool_),
        ("first_index", np.int64),  # of the first sample, unwrapped
        ("next_index", np.int64),  # of the sample expected next
        ("last_start", np.int64),  # of the last accepted block
        ("jump_block", np.int64),  # start of the last block before the last gap of this message
        ("jump_from", np.int64),  # that gap: [jump_from, jump_to)
        ("jump_to", np.int64),
        ("jump_contiguous", np.bool_),  # by the E2E counter
        ("old_blocks", np.int64),  # consecutive
        ("old_next", np.int64),
    ],
    align=True,
)

SLOT = np.dtype(
    [("index", np.int64), ("present", np.int64), ("values", np.float64, (MAX_INPUTS,))], align=True
)

ALIGNED = np.dtype(
    [
        ("index", np.int64),
        ("values", np.float64, (MAX_INPUTS,)),  # SI, in the order of ROLES
        ("interpolated", np.bool_),
        ("broken", np.int8),  # Break
    ],
    align=True,
)

ALIGNMENT = np.dtype(
    [
        ("streams", STREAM, (MAX_INPUTS,)),
        ("stream_count", np.int64),
        ("next_index", np.int64),  # of the sample to decide on next
        ("begun", np.bool_),
        ("next_break", np.int8),  # of the first sample to come: START or RESTART
        ("last_index", np.int64),  # of the last sample passed on
        ("last_values", np.float64, (MAX_INPUTS,)),
        ("closed_lift", np.float64),  # m, at or below which the needle is closed
        ("ready", np.int64),  # samples in the queue
        # counters
        ("lost", np.int64),  # samples
        ("repeated", np.int64),  # blocks
        ("old", np.int64),
        ("restarts", np.int64),
        ("jumps", np.int64),
    ],
    align=True,
)


class Alignment(NamedTuple):
    """Alignment as compiled functions see it; `queue` holds `memory[0].ready` decided samples for the caller."""

    memory: NDArray[np.void]  # (1,) ALIGNMENT
    slots: NDArray[np.void]  # (SLOTS,) SLOT
    queue: NDArray[np.void]  # (2 SLOTS,) ALIGNED


class Placing(IntEnum):
    """What became of a block."""

    ACCEPTED = 0
    REPEATED = 1
    OLD = 2
    RESTARTED = 3  # accepted, as the first of a new count


_ACCEPTED = int(Placing.ACCEPTED)
_REPEATED = int(Placing.REPEATED)
_OLD = int(Placing.OLD)
_RESTARTED = int(Placing.RESTARTED)


def make_alignment(message_count: int, closed_lift: float) -> Alignment:
    """Empty alignment of `message_count` messages; `closed_lift` [m] bounds the lift of a closed needle."""
    alignment = Alignment(np.zeros(1, ALIGNMENT), np.zeros(SLOTS, SLOT), np.zeros(2 * SLOTS, ALIGNED))
    memory = alignment.memory[0]
    memory["stream_count"] = message_count
    memory["closed_lift"] = closed_lift
    memory["next_break"] = _START
    alignment.slots["index"] = -1
    return alignment


@njit(cache=True, nogil=True)
def place_block(
    alignment: Alignment, message: int, raw_index: int, count: int, contiguous: bool
) -> tuple[int, int]:
    """Where a block of `count` samples belongs: (Placing, unwrapped index of its first sample).

    raw_index: uint32 as sent; contiguous: the E2E counter follows the last one of this message. When accepted,
    the caller stores the samples (`store`) and then lets the stream decide (`decide`).
    """
    memory = alignment.memory[0]
    stream = memory.streams[message]
    start = _unwrapped(alignment, message, raw_index)
    if not stream.seen:
        _begin_stream(stream, start, count)
        return _ACCEPTED, start
    if start < stream.next_index:
        placing = _place_old(alignment, message, start, count, raw_index)
        if placing != _RESTARTED:
            return placing, start
        _begin_anew(alignment)
        _begin_stream(stream, raw_index, count)
        return _RESTARTED, raw_index
    if raw_index == 0 and start > stream.next_index + SLOTS:
        _begin_anew(alignment)  # not lost up to the wrap of the index, but counting from 0 again
        _begin_stream(stream, raw_index, count)
        return _RESTARTED, raw_index
    stream.old_blocks = 0
    if start > stream.next_index:
        stream.jump_block = stream.last_start
        stream.jump_from = stream.next_index
        stream.jump_to = start
        stream.jump_contiguous = contiguous
        _decide_until(alignment, start + count - SLOTS // 2)
    stream.last_start = start
    stream.next_index = start + count
    return _ACCEPTED, start


@njit(cache=True, nogil=True)
def store(alignment: Alignment, index: int, role: int, value: float) -> None:
    """Put one value [SI] of a role at its index; NaN and impossible values count as missing."""
    slot = alignment.slots[index & _MASK]
    if slot.index != index:
        slot.index = index
        slot.present = 0
    if abs(value) < IMPOSSIBLE[role]:
        slot.present |= 1 << role
        slot.values[role] = value


@njit(cache=True, nogil=True)
def decide(alignment: Alignment) -> None:
    """Queue every sample that all messages have passed."""
    memory = alignment.memory[0]
    frontier = memory.streams[0].next_index
    for m in range(memory.stream_count):
        if not memory.streams[m].seen:
            return
        frontier = min(frontier, memory.streams[m].next_index)
    _decide_until(alignment, frontier)


@njit(cache=True, nogil=True)
def _unwrapped(alignment: Alignment, message: int, raw_index: int) -> int:
    """The index nearest to what is expected that equals `raw_index` modulo 2^32."""
    memory = alignment.memory[0]
    stream = memory.streams[message]
    if stream.seen:
        expected = stream.next_index
    elif memory.begun:
        expected = memory.next_index
    else:
        for m in range(memory.stream_count):
            if memory.streams[m].seen:
                expected = memory.streams[m].next_index
                break
        else:
            return int(raw_index)
    ahead = (raw_index - expected) & 0xFFFFFFFF
    if ahead >= 0x80000000:
        ahead -= 0x100000000
    return int(expected + ahead)


@njit(cache=True, nogil=True)
def _begin_stream(stream, start, count):  # type: ignore[no-untyped-def]
    stream.seen = True
    stream.first_index = start
    stream.last_start = start
    stream.next_index = start + count
    stream.jump_block = start
    stream.jump_from = start
    stream.jump_to = start
    stream.jump_contiguous = False
    stream.old_blocks = 0


@njit(cache=True, nogil=True)
def _place_old(alignment: Alignment, message: int, start: int, count: int, raw_index: int) -> int:
    """`Placing` of a block from before the expected index: repeated, old, or the device began anew."""
    memory = alignment.memory[0]
    stream = memory.streams[message]
    if start == stream.last_start:
        memory.repeated += 1
        return _REPEATED
    stream.old_blocks = stream.old_blocks + 1 if start == stream.old_next else 1
    stream.old_next = start + count
    if raw_index == 0 or stream.old_blocks >= OLD_BLOCKS_OF_RESTART:
        return _RESTARTED
    memory.old += 1
    return _OLD


@njit(cache=True, nogil=True)
def _begin_anew(alignment: Alignment) -> None:
    """The device counts from a new index: forget what waits, in every message."""
    memory = alignment.memory[0]
    for m in range(memory.stream_count):
        memory.streams[m].seen = False
    for k in range(SLOTS):
        alignment.slots[k].index = -1
    memory.begun = False
    memory.next_break = _RESTART
    memory.restarts += 1


@njit(cache=True, nogil=True)
def _decide_until(alignment: Alignment, frontier: int) -> None:
    """Queue the complete samples before `frontier`; the others are missing."""
    memory = alignment.memory[0]
    complete = (1 << MAX_INPUTS) - 1
    if not memory.begun:
        for m in range(memory.stream_count):
            if not memory.streams[m].seen:
                return
            first = memory.streams[m].first_index
            memory.next_index = max(memory.next_index, first) if m else first
        memory.begun = True
    index = memory.next_index
    missing = 0
    while index < frontier:
        slot = alignment.slots[index & _MASK]
        if slot.index == index and slot.present == complete:
            _pass_on(alignment, slot)
            missing = 0
            index += 1
            continue
        missing += 1
        index += 1
        for m in range(memory.stream_count):
            stream = memory.streams[m]
            if stream.jump_from <= index < stream.jump_to:
                index = min(stream.jump_to, frontier)
        if missing > SLOTS:
            index = max(index, frontier - SLOTS)
    memory.next_index = max(memory.next_index, frontier)


@njit(cache=True, nogil=True)
def _pass_on(alignment: Alignment, slot):  # type: ignore[no-untyped-def]
    """Queue a complete sample, with what its distance from the last one means."""
    memory = alignment.memory[0]
    gap = slot.index - memory.last_index - 1
    broken = _NONE
    if memory.next_break != _NONE:
        broken = memory.next_break
        memory.next_break = _NONE
    elif 0 < gap <= MAX_INTERPOLATED:
        memory.lost += gap
        for k in range(1, gap + 1):
            row = _append(alignment, memory.last_index + k)
            row.interpolated = True
            for role in range(MAX_INPUTS):
                last = memory.last_values[role]
                row.values[role] = last + (slot.values[role] - last) * (k / (gap + 1))
    elif gap > 0:
        if _is_legal_jump(alignment, slot):
            broken = _JUMP
            memory.jumps += 1
        else:
            broken = _LOSS
            memory.lost += gap
    row = _append(alignment, slot.index)
    row.broken = broken
    for role in range(MAX_INPUTS):
        row.values[role] = slot.values[role]
        memory.last_values[role] = slot.values[role]
    memory.last_index = slot.index


@njit(cache=True, nogil=True)
def _append(alignment: Alignment, index: int):  # type: ignore[no-untyped-def]
    memory = alignment.memory[0]
    row = alignment.queue[memory.ready]
    memory.ready += 1
    row.index = index
    row.interpolated = False
    row.broken = _NONE
    return row


@njit(cache=True, nogil=True)
def _is_legal_jump(alignment: Alignment, slot):  # type: ignore[no-untyped-def]
    """Rule 6: every message jumped here, with a contiguous counter, and the needle is closed on both sides.

    The last block before the jump may end in samples that are not available.
    """
    memory = alignment.memory[0]
    for m in range(memory.stream_count):
        stream = memory.streams[m]
        if (
            not stream.jump_block <= memory.last_index < stream.jump_from
            or stream.jump_to != slot.index
            or not stream.jump_contiguous
        ):
            return False
    return (
        memory.last_values[_NEEDLE_LIFT] <= memory.closed_lift
        and slot.values[_NEEDLE_LIFT] <= memory.closed_lift
    )
