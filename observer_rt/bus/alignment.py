"""Memory by which the compiled core aligns frames to one gapless stream of samples, and keeps their time.

`alignment.pxi` and `placing.pxi` of `core/frames` align by it: messages of one time base are joined by their
unwrapped sample index, those of others follow on the same grid (`mapping.grid_relation`). Up to two missing
samples are interpolated, more are a loss. An index jump is legal only with a contiguous E2E counter in every message
on the grid and a closed needle before and after.

Frames without an index are counted (`frame_numbers.pxi`), and a device's clock is found by stamps (`clock.pxi`).
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.grid_relation import GridRelation
from observer_rt.core.frames import frames as core
from observer_rt.core.frames.frames import Joining, Numbering
from observer_rt.core.stream.stream import Break
from observer_rt.foundation.units import NANOSECONDS


class Alignment(NamedTuple):
    """Alignment as compiled functions see it; `memory[0].decided` samples were written to `recorded`."""

    memory: NDArray[np.void]  # (1,) ALIGNMENT
    streams: NDArray[np.void]  # (MAX_INPUTS,) STREAM
    followers: NDArray[np.void]  # (MAX_INPUTS,) FOLLOWER
    slots: NDArray[np.void]  # (SLOTS,) SLOT
    recorded: NDArray[np.void]  # (RECORDED_RING,) RECORDED


def make_alignment(relations: Sequence[GridRelation | None], closed_lift: float, ring: NDArray[np.void]) -> Alignment:
    """Empty alignment of messages by their relations to the grid, None where all of a message is on it.

    closed_lift: largest lift [m] of a closed needle; ring: of the observer, to which samples are written.
    """
    alignment = Alignment(
        np.zeros(1, core.ALIGNMENT),
        np.zeros(core.MAX_INPUTS, core.STREAM),
        np.zeros(core.MAX_INPUTS, core.FOLLOWER),
        np.zeros(core.SLOTS, core.SLOT),
        ring,
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


def indices_of(alignment: Alignment, field: Literal["first_index", "next_index"]) -> list[int]:
    """Index on the grid at which each stream began, or up to which it has sent samples; -1: it has sent none."""
    count = int(alignment.memory[0]["stream_count"])
    return [
        int(stream[field] if stream["seen"] else -1)
        if stream["on_grid"]
        else int(follower[field] if follower["begun"] else -1)
        for stream, follower in zip(alignment.streams[:count], alignment.followers[:count], strict=True)
    ]


def is_stale(alignment: Alignment) -> bool:
    """Whether a message stays away while others come."""
    memory = alignment.memory[0]
    waiting = memory["newest"] - memory["next_index"]
    return bool(alignment.followers["stale"].any() or waiting > core.PATIENCE)


class Timekeeping(NamedTuple):
    """Clocks and counts of all messages, one row each."""

    memory: NDArray[np.void]  # (1,) TIMEKEEPING
    timing: NDArray[np.void]  # TIMING
    clocks: NDArray[np.void]  # CLOCK
    counts: NDArray[np.void]  # COUNTING
    shifts: NDArray[np.void]  # SHIFT


def make_timekeeping(timing: NDArray[np.void], samples: NDArray[np.int64], leading: int) -> Timekeeping:
    """Memory of all messages before the first frame.

    timing: rows TIMING; samples: of every role in one frame of each message; leading: number of the grid's message.
    """
    memory = np.zeros(1, core.TIMEKEEPING)
    memory["leading"] = leading
    memory["by_stamps"] = bool(
        np.any(timing["numbering"] != Numbering.INDEX) or np.any(timing["joining"] == Joining.CLOCK)
    )
    clocks, counts = np.zeros(len(timing), core.CLOCK), np.zeros(len(timing), core.COUNTING)
    clocks["interval"], clocks["shortest"] = timing["interval"] * NANOSECONDS, timing["shortest"] * NANOSECONDS
    clocks["samples"], clocks["residual"] = samples, math.inf
    counts["modulus"] = timing["modulus"]
    return Timekeeping(memory, timing, clocks, counts, np.zeros(len(timing), core.SHIFT))
