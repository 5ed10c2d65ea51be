"""Alignment of blocks of samples to one gapless stream: complete samples, and their order.

Messages of one time base are joined by their unwrapped sample index, those of others follow on the same grid
(`mapping.timing.GridRelation`). Up to two missing samples are interpolated, more are a loss. An index jump is legal
only with a contiguous E2E counter in every message on the grid and a closed needle before and after. Of a repeated
block the first wins; an older one is dropped; an index that jumps back or to 0 is a restart of the device.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.input_tables import MAX_INPUTS
from observer_rt.bus.mapping.timing import SLOTS, GridRelation
from observer_rt.core.frames.frames import PATIENCE, RECORDS
from observer_rt.core.stream.stream import RECORDED_RING
from observer_rt.core.stream.stream import RECORDS as OF_STREAM
from observer_rt.foundation.continuity import Break
from observer_rt.foundation.records import dtype_of

RECORDED = dtype_of(OF_STREAM["Recorded"])

STREAM = dtype_of(RECORDS["GridStream"])

# A message with samples between those of the grid, or further apart.
FOLLOWER = dtype_of(RECORDS["Follower"])

SLOT = dtype_of(RECORDS["Slot"])

ALIGNMENT = dtype_of(RECORDS["AlignmentMemory"])


class Alignment(NamedTuple):
    """Alignment as compiled functions see it; `memory[0].decided` samples were written to `recorded`."""

    memory: NDArray[np.void]  # (1,) ALIGNMENT
    streams: NDArray[np.void]  # (MAX_INPUTS,) STREAM
    followers: NDArray[np.void]  # (MAX_INPUTS,) FOLLOWER
    slots: NDArray[np.void]  # (SLOTS,) SLOT
    recorded: NDArray[np.void]  # (RECORDED_RING,) RECORDED


def make_recorded() -> NDArray[np.void]:
    """An empty ring of recorded samples, which the alignment writes and the observer takes."""
    return np.zeros(RECORDED_RING, RECORDED)


def make_alignment(
    relations: Sequence[GridRelation | None], closed_lift: float, recorded: NDArray[np.void]
) -> Alignment:
    """Empty alignment of messages on the grid (None, or in part) and others that follow it.

    `closed_lift` [m] bounds the lift of a closed needle; `recorded`: the ring it writes to.
    """
    alignment = Alignment(
        np.zeros(1, ALIGNMENT),
        np.zeros(MAX_INPUTS, STREAM),
        np.zeros(MAX_INPUTS, FOLLOWER),
        np.zeros(SLOTS, SLOT),
        recorded,
    )
    memory = alignment.memory[0]
    memory["stream_count"] = len(relations)
    for number, relation in enumerate(relations):
        alignment.streams[number]["on_grid"] = relation is None or relation.on_grid
        if relation is not None:
            for name in ("roles", "spacing", "reach", "holds", "early"):
                alignment.followers[number][name] = getattr(relation, name)
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
        for stream, follower in zip(alignment.streams[:count], alignment.followers[:count], strict=True)
    ]


def begun_at(alignment: Alignment) -> list[int]:
    """The index on the grid at which each stream began; -1: it has not."""
    count = int(alignment.memory[0]["stream_count"])
    return [
        int(stream["first_index"] if stream["seen"] else -1)
        if stream["on_grid"]
        else int(follower["first_index"] if follower["begun"] else -1)
        for stream, follower in zip(alignment.streams[:count], alignment.followers[:count], strict=True)
    ]


def is_stale(alignment: Alignment) -> bool:
    """Whether a message stays away while others come."""
    memory = alignment.memory[0]
    waiting = memory["newest"] - memory["next_index"]
    return bool(alignment.followers["stale"].any() or waiting > PATIENCE)
