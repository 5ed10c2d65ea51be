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

from observer_rt.bus.mapping.input_tables import MAX_INPUTS
from observer_rt.bus.mapping.timing import SLOTS, Following
from observer_rt.core.frames.frames import PATIENCE
from observer_rt.foundation.continuity import Break

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


class Alignment(NamedTuple):
    """Alignment as compiled functions see it; `memory[0].decided` samples were written to `recorded`."""

    memory: NDArray[np.void]  # (1,) ALIGNMENT
    streams: NDArray[np.void]  # (MAX_INPUTS,) STREAM
    followers: NDArray[np.void]  # (MAX_INPUTS,) FOLLOWER
    slots: NDArray[np.void]  # (SLOTS,) SLOT
    recorded: NDArray[np.void]  # (RECORDED_RING,) RECORDED


def make_alignment(
    following: Sequence[Following | None], closed_lift: float, recorded: NDArray[np.void]
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
    memory["stream_count"] = len(following)
    for number, follows in enumerate(following):
        alignment.streams[number]["on_grid"] = follows is None or follows.on_grid
        if follows is not None:
            for name in ("roles", "spacing", "reach", "holds", "early"):
                alignment.followers[number][name] = getattr(follows, name)
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


def is_stale(alignment: Alignment) -> bool:
    """Whether a message stays away while others come."""
    memory = alignment.memory[0]
    waiting = memory["newest"] - memory["next_index"]
    return bool(alignment.followers["stale"].any() or waiting > PATIENCE)
