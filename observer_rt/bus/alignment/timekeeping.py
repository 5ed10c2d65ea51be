"""When samples were taken: which number a frame has, where its samples lie on the grid, how well that is known."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.clock import (
    CLOCK,
    ENOUGH_POINTS,
    forget,
    index_at,
    make_clock,
    take_stamp,
    time_of,
)
from observer_rt.bus.alignment.counting import (
    COUNTING,
    Count,
    count_frame,
    has_slipped,
    is_sure,
    make_counting,
)
from observer_rt.bus.mapping.timing import Joining, Numbering
from observer_rt.foundation.compiled import compiled, inner, inner_separate
from observer_rt.foundation.continuity import Doubt
from observer_rt.foundation.referenced import referenced

UNSURE = 0.25  # samples from the nearest of the grid, beyond which it may be the wrong one

SHIFT = np.dtype(
    [
        ("known", np.bool_),
        ("samples", np.int64),  # from the number of a sample to its index on the grid
        ("off", np.float64),  # samples that the clocks place it beside that index
    ],
    align=True,
)

TIMEKEEPING = np.dtype(
    [
        ("leading", np.int64),  # message whose samples are the grid
        ("by_stamps", np.bool_),  # whether any message needs them
    ],
    align=True,
)


@referenced()
class Timekeeping(NamedTuple):
    """Clocks and counts of all messages, one row each."""

    memory: NDArray[np.void]  # (1,) TIMEKEEPING
    timing: NDArray[np.void]  # TIMING
    clocks: NDArray[np.void]  # CLOCK
    counts: NDArray[np.void]  # COUNTING
    shifts: NDArray[np.void]  # SHIFT


def make_timekeeping(timing: NDArray[np.void], samples: NDArray[np.int64], leading: int) -> Timekeeping:
    """Nothing seen yet; `samples` of every role in one frame of each message."""
    memory = np.zeros(1, TIMEKEEPING)
    memory["leading"] = leading
    memory["by_stamps"] = bool(
        np.any(timing["numbering"] != Numbering.INDEX) or np.any(timing["joining"] == Joining.CLOCK)
    )
    count = len(timing)
    clocks, counts = np.zeros(count, CLOCK), np.zeros(count, COUNTING)
    for number, row in enumerate(timing):
        clocks[number] = make_clock(float(row["interval"]), int(samples[number]), float(row["shortest"]))[0]
        counts[number] = make_counting(int(row["modulus"]))[0]
    return Timekeeping(memory, timing, clocks, counts, np.zeros(count, SHIFT))


@inner
def number_frame(keeping: Timekeeping, message: int, sequence: int, stamp: int) -> int:
    """`Count` of a frame without index, whose number is then in `counts`; `sequence`: its counter."""
    outcome: int = count_frame(keeping.counts[message], keeping.clocks[message], sequence, stamp)
    if outcome == Count.ANEW:
        forget(keeping.clocks[message])
        keeping.shifts[message].known = False
    return outcome


@inner_separate
def note_frame(keeping: Timekeeping, message: int, last: int, stamp: int) -> None:
    """A frame that ends in the sample `last`, by the message's own index or number, was received at `stamp`."""
    clock = keeping.clocks[message]
    if not take_stamp(clock, last, stamp):
        return
    if keeping.timing[message].numbering != Numbering.INDEX and has_slipped(clock):
        keeping.counts[message].begun = False
        forget(clock)
    if keeping.timing[message].joining == Joining.NEAREST:
        _find_nearest(keeping, message, last)


@inner
def begin_anew(keeping: Timekeeping, message: int) -> None:
    """A message begins a new index: when that is the grid's, what was tied to the old grid is free again."""
    forget(keeping.clocks[message])
    keeping.shifts[message].known = False
    if keeping.timing[message].joining != Joining.INDEX:
        return
    for m in range(keeping.timing.size):
        keeping.shifts[m].known = False
        if keeping.timing[m].joining == Joining.INDEX:
            forget(keeping.clocks[m])


@inner
def has_place(keeping: Timekeeping, message: int) -> bool:
    """Whether it is known where the message's samples lie on the grid."""
    joining = keeping.timing[message].joining
    if joining == Joining.NEAREST:
        return bool(keeping.shifts[message].known)
    leading = keeping.clocks[keeping.memory[0].leading]
    return bool(joining != Joining.CLOCK or (leading.points > 0 and keeping.clocks[message].points > 0))


@inner
def place_of(keeping: Timekeeping, message: int, index: int) -> float:
    """Where on the grid a sample lies that has `index` by the message's own index or number."""
    timing = keeping.timing[message]
    if timing.joining == Joining.RATIO:
        return float(index * timing.steps)
    leading = keeping.memory[0].leading
    grid = keeping.clocks[leading]
    sampled = time_of(keeping.clocks[message], index, grid.first_stamp) - 1e9 * timing.delay
    return float(index_at(grid, sampled + 1e9 * keeping.timing[leading].delay, grid.first_stamp))


@compiled
def place_at(keeping: Timekeeping, time: int) -> float:
    """Where on the grid a sample lies that was taken at `time` [ns], by the clock of the stamps; nan: not known."""
    leading = keeping.memory[0].leading
    grid = keeping.clocks[leading]
    if not grid.begun:
        return math.nan
    return float(
        index_at(grid, time - grid.first_stamp + 1e9 * keeping.timing[leading].delay, grid.first_stamp)
    )


@compiled
def is_prompt(keeping: Timekeeping, tolerance: float) -> bool:
    """Whether the frames of the grid came when its clock says, to `tolerance` [s], as far as was seen lately."""
    grid = keeping.clocks[keeping.memory[0].leading]
    early = grid.offset + grid.drift * grid.lowest_at - grid.lowest
    return bool(max(early, grid.latest) < 1e9 * tolerance)


@inner_separate
def doubt_of(keeping: Timekeeping) -> int:
    """`Doubt` in the times of samples that come together now."""
    if not keeping.memory[0].by_stamps:
        return Doubt.NONE
    grid = keeping.clocks[keeping.memory[0].leading]
    for m in range(keeping.timing.size):
        timing = keeping.timing[m]
        if timing.numbering != Numbering.INDEX and not is_sure(keeping.counts[m], keeping.clocks[m]):
            return Doubt.TIME_BASE
        if timing.joining == Joining.NEAREST and not abs(keeping.shifts[m].off) < UNSURE:
            return Doubt.TIME_BASE
        if timing.joining == Joining.CLOCK:
            unknown = grid.residual + keeping.clocks[m].residual
            if not unknown <= 1e9 * timing.tolerance:
                return Doubt.TIME_BASE
    return Doubt.NONE


@inner
def _find_nearest(keeping: Timekeeping, message: int, last: int) -> None:
    """Where the clocks place the sample `last`: the nearest sample of the grid is its own."""
    shift = keeping.shifts[message]
    leading = keeping.clocks[keeping.memory[0].leading]
    if leading.points < ENOUGH_POINTS or keeping.clocks[message].points < ENOUGH_POINTS:
        return
    ahead = place_of(keeping, message, last) - last
    if not shift.known:
        shift.known = True
        shift.samples = math.floor(ahead + 0.5)
    shift.off = ahead - shift.samples
