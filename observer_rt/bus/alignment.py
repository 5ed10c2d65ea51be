"""Memory by which the compiled core aligns frames to one gapless stream of samples, and keeps their time.

`alignment.pxd` and `placing.pxd` of `core/frames` align by it: messages of one time base join by their unwrapped
sample index, others follow on the same grid (`mapping.timing`). Up to two missing samples are interpolated, more are
a loss. An index jump is legal only with a contiguous E2E counter in every message on the grid and a closed needle
before and after. `frame_numbers.pxd` counts frames without an index; `clock.pxd` finds a device's clock by
stamps, whose delays and drift say how well the time of samples is known.
"""

import math
from collections.abc import Collection, Sequence
from typing import Literal, NamedTuple

import numpy as np

from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.bus.mapping.timing import GridRelation
from observer_rt.core.frames import frames as core
from observer_rt.core.frames.frames import Joining, Numbering
from observer_rt.core.stream.stream import Break
from observer_rt.foundation.units import MICROSECOND, MILLISECOND, NANOSECOND, NANOSECONDS, Ints, Structs

LARGEST_DRIFT = 0.01  # of a clock; beyond it a recording is played at another speed


class Alignment(NamedTuple):
    """Alignment as compiled functions see it; `memory[0].decided` samples were written to `recorded`."""

    memory: Structs  # (1,) ALIGNMENT
    streams: Structs  # (MAX_INPUTS,) STREAM
    followers: Structs  # (MAX_INPUTS,) FOLLOWER
    slots: Structs  # (SLOTS,) SLOT
    recorded: Structs  # (RECORDED_RING,) RECORDED


def make_alignment(
    relations: Sequence[GridRelation | None],
    closed_lift: float,
    ring: Structs,
    spared: Collection[int] = (),
    has_lift: bool = True,
) -> Alignment:
    """Empty alignment of messages by their relations to the grid, None where all of a message is on it.

    closed_lift: largest lift [m] of a closed needle; ring: of the observer, to which samples are written; spared:
    numbers of the messages that nothing waits for; has_lift: samples have a lift that is used.
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
        alignment.streams[number]["spared"] = number in spared
        if relation is not None:
            for name in ("roles", "spacing", "reach", "holds", "early"):
                alignment.followers[number][name] = getattr(relation, name)
    memory["closed_lift"], memory["lacks_lift"] = closed_lift, not has_lift
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
    stale = alignment.followers["stale"] & ~alignment.streams["spared"]
    return bool(stale.any() or memory["newest"] - memory["next_index"] > core.PATIENCE)


class Timekeeping(NamedTuple):
    """Clocks and counts of all messages, one row each."""

    memory: Structs  # (1,) TIMEKEEPING
    timing: Structs  # TIMING
    clocks: Structs  # CLOCK
    counts: Structs  # COUNTING
    shifts: Structs  # SHIFT


def make_timekeeping(timing: Structs, samples: Ints, leading: int) -> Timekeeping:
    """Memory before the first frame, by rows TIMING and samples a frame; leading: number of the grid's message."""
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


class Jitter(NamedTuple):
    """Delays of a message's frames over its shortest one: of how many frames, their scatter and the greatest [s]."""

    frames: int
    sigma: float
    greatest: float


def jitter_of(clock: np.void) -> Jitter:
    """Delays of a message's frames (row of dtype CLOCK) since its clock is known."""
    frames = int(clock["delays"])
    if frames == 0:
        return Jitter(0, math.nan, math.nan)
    mean = float(clock["delay_sum"]) / frames
    variance = max(0.0, float(clock["delay_squares"]) / frames - mean * mean)
    return Jitter(frames, math.sqrt(variance) * NANOSECOND, float(clock["delay_max"]) * NANOSECOND)


class MessageTiming(NamedTuple):
    """Timing of one input message by the receive stamps of its frames."""

    name: str
    jitter: Jitter
    drift: float
    """Of its clock against the receiver's [-]."""
    unknown: float
    """Greatest distance of its samples from their places on the grid [s]: 0 by index, inf: clocks not known yet."""
    lately: float
    """Greatest delay in the last 0.2 s [s]."""

    def as_text(self) -> str:
        """Summary for the screen in one line: delays, drift, and their effect on the samples."""
        if self.jitter.frames == 0:
            return f"{self.name}: too few frames to tell their times"
        drift = f"drift {self.drift * 1e6:+.1f} ppm"
        if abs(self.drift) >= LARGEST_DRIFT:
            drift = f"sent at {1.0 / (1.0 + self.drift):.3g} times sampling.rate_hz"
        placed = f"samples are placed by its clock to {self.unknown / MICROSECOND:.2g} us"
        if self.unknown == 0.0:
            placed = "samples are counted"
        elif math.isinf(self.unknown):
            placed = "its clock is not known yet"
        late, jitter = self.jitter.greatest / MILLISECOND, self.jitter.sigma / MICROSECOND
        return f"{self.name}: frames came late by up to {late:.3g} ms, jitter {jitter:.1f} us, {drift}; {placed}"


def timing_of(bus: BusMap, keeping: Timekeeping) -> tuple[MessageTiming, ...]:
    """Timing of each message by the receive stamps so far."""
    grid = keeping.clocks[int(keeping.memory[0]["leading"])]
    result = []
    for stream, (timing, clock) in enumerate(zip(keeping.timing, keeping.clocks, strict=True)):
        by_clock = timing["joining"] == Joining.CLOCK
        unknown = float(grid["residual"] + clock["residual"]) / NANOSECONDS if by_clock else 0.0
        drift = float(clock["drift"]) / float(clock["interval"])
        name, lately = bus.name_of(layout_of(bus, stream)), float(clock["spread"]) / NANOSECONDS
        result.append(MessageTiming(name, jitter_of(clock), drift, unknown, lately))
    return tuple(result)
