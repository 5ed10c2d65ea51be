"""From blocks of samples to one gapless stream: which samples are complete, and what follows what.

Messages of one time base are joined by their unwrapped sample index, those of others follow on the same grid
(`following`). Up to two missing samples are interpolated, more are a loss. An index jump is legal only with a
contiguous E2E counter in every message on the grid and a closed needle before and after. Where a block belongs is
as `placing` says.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.input_tables import MAX_INPUTS, ROLES
from observer_rt.bus.mapping.timing import MAX_INTERPOLATED, SLOTS, Following
from observer_rt.config.signals import Role
from observer_rt.foundation.compiled import inner, inner_separate, separate
from observer_rt.foundation.continuity import RECORDED_RING, Break
from observer_rt.foundation.referenced import referenced

STREAM = np.dtype(
    [
        ("on_grid", np.bool_),  # its index is the grid's; else it is a follower
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

# A message with samples between those of the grid, or further apart.
FOLLOWER = np.dtype(
    [
        ("roles", np.int64),  # bit r: carries ROLES[r]
        ("spacing", np.float64),  # samples of the grid between two of its own
        ("reach", np.float64),  # samples of the grid between two of its own that a straight line joins
        ("holds", np.bool_),  # its last value counts for `reach`
        ("early", np.float64),  # samples of the grid by which its values are of before its samples' time
        ("begun", np.bool_),
        ("position", np.float64),  # of its last sample on the grid
        ("values", np.float64, (MAX_INPUTS,)),  # SI
        ("first_index", np.int64),  # of the first sample of the grid that has its values
        ("next_index", np.int64),  # of the first that has not got them yet
        ("lift_row", np.int64),  # index of the sample of the grid that has its last lift
        ("lift_after", np.float64),  # by how much [samples of the grid] it was taken later than that
        ("shut_for", np.int64),  # its samples in a row with a closed needle
        ("stale", np.bool_),  # the others do not wait for it any longer
    ],
    align=True,
)

SLOT = np.dtype(
    [
        ("index", np.int64),
        ("present", np.int64),
        ("interpolated", np.bool_),  # over a gap of a follower
        ("values", np.float64, (MAX_INPUTS,)),
        ("shares", np.float64, (MAX_INPUTS,)),  # 0..1: see `alignment.store`
    ],
    align=True,
)

ALIGNMENT = np.dtype(
    [
        ("streams", STREAM, (MAX_INPUTS,)),
        ("followers", FOLLOWER, (MAX_INPUTS,)),
        ("stream_count", np.int64),
        ("next_index", np.int64),  # of the sample to decide on next
        ("newest", np.int64),  # index beyond the last sample any message sent
        ("begun", np.bool_),
        ("next_break", np.int8),  # of the first sample to come: START or RESTART
        ("last_index", np.int64),  # of the last sample passed on
        ("last_values", np.float64, (MAX_INPUTS,)),
        ("closed_lift", np.float64),  # m, at or below which the needle is closed
        ("decided", np.int64),  # samples written to the ring
        # counters
        ("lost", np.int64),  # samples
        ("repeated", np.int64),  # blocks
        ("old", np.int64),
        ("restarts", np.int64),
        ("jumps", np.int64),
    ],
    align=True,
)


@referenced()
class Alignment(NamedTuple):
    """Alignment as compiled functions see it; `memory[0].decided` samples were written to `recorded`."""

    memory: NDArray[np.void]  # (1,) ALIGNMENT
    slots: NDArray[np.void]  # (SLOTS,) SLOT
    recorded: NDArray[np.void]  # (RECORDED_RING,) RECORDED


def make_alignment(
    following: Sequence[Following | None], closed_lift: float, recorded: NDArray[np.void]
) -> Alignment:
    """Empty alignment of messages on the grid (None, or in part) and others that follow it.

    `closed_lift` [m] bounds the lift of a closed needle; `recorded`: the ring it writes to.
    """
    alignment = Alignment(np.zeros(1, ALIGNMENT), np.zeros(SLOTS, SLOT), recorded)
    memory = alignment.memory[0]
    memory["stream_count"] = len(following)
    for number, follows in enumerate(following):
        memory["streams"][number]["on_grid"] = follows is None or follows.on_grid
        if follows is not None:
            for name in ("roles", "spacing", "reach", "holds", "early"):
                memory["followers"][number][name] = getattr(follows, name)
    memory["closed_lift"] = closed_lift
    memory["next_break"] = int(Break.START)
    alignment.slots["index"] = -1
    return alignment


def progress(alignment: Alignment) -> list[int]:
    """The index on the grid up to which each stream has sent its samples; -1: none yet."""
    memory = alignment.memory[0]
    count = int(memory["stream_count"])
    return [
        int(stream["next_index"] if stream["seen"] else -1)
        if stream["on_grid"]
        else int(follower["next_index"] if follower["begun"] else -1)
        for stream, follower in zip(memory["streams"][:count], memory["followers"][:count], strict=True)
    ]


# What no sensor of an injector can mean [Pa, m, Pa]: a value beyond it, or none at all, is missing.
IMPOSSIBLE = np.array([1e-2 if role is Role.NEEDLE_LIFT else 1e9 for role in ROLES])
PATIENCE = SLOTS // 2  # samples that wait for a message before it counts as stale
NO_FRONTIER = np.iinfo(np.int64).max
_MASK = SLOTS - 1
_RECORDED_MASK = RECORDED_RING - 1
NEEDLE_LIFT = ROLES.index(Role.NEEDLE_LIFT)


@separate
def store(
    alignment: Alignment, index: int, role: int, value: float, interpolated: bool = False, share: float = 0.0
) -> None:
    """Put one value [SI] of a role at its index; NaN and impossible values count as missing.

    share: of a lift, by which share of an interval it was taken later than that; of an interpolated value, that of
    the later one of its two neighbours.
    """
    slot = alignment.slots[index & _MASK]
    if slot.index != index:
        slot.index = index
        slot.present = 0
        slot.interpolated = False
    if abs(value) < IMPOSSIBLE[role]:
        slot.present |= 1 << role
        slot.values[role] = value
        slot.shares[role] = share
        slot.interpolated = slot.interpolated or interpolated


def is_stale(alignment: Alignment) -> bool:
    """Whether a message stays away while others come."""
    memory = alignment.memory[0]
    waiting = memory["newest"] - memory["next_index"]
    return bool(memory["followers"]["stale"].any() or waiting > PATIENCE)


@separate
def decide(alignment: Alignment) -> None:
    """Write to the ring what all messages have passed; a follower that stays away is not waited for long."""
    memory = alignment.memory[0]
    frontier = NO_FRONTIER
    for m in range(memory.stream_count):
        if memory.streams[m].on_grid:
            if not memory.streams[m].seen:
                return
            frontier = min(frontier, memory.streams[m].next_index)
        elif not memory.followers[m].begun:
            return
    for m in range(memory.stream_count):
        if memory.followers[m].roles != 0:
            frontier = min(frontier, _frontier_of(alignment, memory.followers[m], frontier))
    decide_until(alignment, frontier)


@inner_separate
def decide_until(alignment: Alignment, frontier: int) -> None:
    """Write the complete samples before `frontier`; the others are missing."""
    memory = alignment.memory[0]
    complete = (1 << MAX_INPUTS) - 1
    if not memory.begun and not _begin(alignment):
        return
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
            if stream.on_grid and stream.jump_from <= index < stream.jump_to:
                index = min(stream.jump_to, frontier)
        if missing > SLOTS:
            index = max(index, frontier - SLOTS)
    memory.next_index = max(memory.next_index, frontier)


@inner
def _begin(alignment: Alignment) -> bool:
    """The first sample to decide on is the first that every message has; False while one has none."""
    memory = alignment.memory[0]
    for m in range(memory.stream_count):
        stream = memory.streams[m]
        follower = memory.followers[m]
        if not (stream.seen if stream.on_grid else follower.begun):
            return False
        first = stream.first_index if stream.on_grid else follower.first_index
        memory.next_index = max(memory.next_index, first) if m else first
    memory.begun = True
    return True


@inner_separate
def _frontier_of(alignment: Alignment, follower, others: int) -> int:  # type: ignore[no-untyped-def]
    """The index before which a follower has said all it will, when the others have sent what is before `others`."""
    patience = follower.reach if follower.holds else PATIENCE
    if others <= follower.position + patience:
        if (follower.roles >> NEEDLE_LIFT) & 1:
            return int(min(follower.next_index, follower.lift_row + 1))
        return int(follower.next_index)
    if follower.holds:
        while follower.next_index <= follower.position + follower.reach:
            for role in range(MAX_INPUTS):
                if (follower.roles >> role) & 1:
                    store(alignment, follower.next_index, role, follower.values[role], True)
            follower.next_index += 1
    follower.stale = True
    return others


@inner_separate
def _pass_on(alignment: Alignment, slot):  # type: ignore[no-untyped-def]
    """Write a complete sample to the ring, with what its distance from the last one means."""
    memory = alignment.memory[0]
    gap = slot.index - memory.last_index - 1
    broken = Break.NONE.value
    if memory.next_break != Break.NONE:
        broken = memory.next_break
        memory.next_break = Break.NONE
    elif 0 < gap <= MAX_INTERPOLATED:
        memory.lost += gap
        for k in range(1, gap + 1):
            row = _append(alignment, memory.last_index + k)
            row.interpolated = True
            for role in range(MAX_INPUTS):
                row.shares[role] = slot.shares[role]
                last = memory.last_values[role]
                row.values[role] = last + (slot.values[role] - last) * (k / (gap + 1))
    elif gap > 0:
        if _is_legal_jump(alignment, slot):
            broken = Break.JUMP.value
            memory.jumps += 1
        else:
            broken = Break.LOSS.value
            memory.lost += gap
    row = _append(alignment, slot.index)
    row.broken = broken
    row.interpolated = slot.interpolated
    for role in range(MAX_INPUTS):
        row.shares[role] = slot.shares[role]
        row.values[role] = slot.values[role]
        memory.last_values[role] = slot.values[role]
    memory.last_index = slot.index


@inner
def _append(alignment: Alignment, index: int):  # type: ignore[no-untyped-def]
    memory = alignment.memory[0]
    row = alignment.recorded[memory.decided & _RECORDED_MASK]
    memory.decided += 1
    row.index = index
    row.interpolated = False
    row.broken = Break.NONE
    return row


@inner
def _is_legal_jump(alignment: Alignment, slot):  # type: ignore[no-untyped-def]
    """Whether all messages on the grid jumped here, with contiguous counters, the needle closed on both sides.

    The last block before the jump may end in samples that are not available.
    """
    memory = alignment.memory[0]
    for m in range(memory.stream_count):
        stream = memory.streams[m]
        if stream.on_grid and (
            not stream.jump_block <= memory.last_index < stream.jump_from
            or stream.jump_to != slot.index
            or not stream.jump_contiguous
        ):
            return False
    return (
        memory.last_values[NEEDLE_LIFT] <= memory.closed_lift
        and slot.values[NEEDLE_LIFT] <= memory.closed_lift
    )
