"""When samples were taken: which number a frame has, where its samples lie on the grid, how well that is known.

Frames without an index are counted: by a counter where they carry one, and by a loop locked on their stamps.

The n-th frame of a cyclic message was sent at t0 + n x cycle; its stamp lies later by a delay that is never
negative. So a frame that comes late is late, not one of the next cycle: frames are lost only when the delay reaches
the time in which the counter comes round (one cycle where there is no counter) and delays like that do not occur
otherwise.

How regularly the input messages come, and how well the time of their samples is known.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.clock import (
    CLOCK,
    ENOUGH_POINTS,
    Jitter,
    delay_of,
    forget,
    index_at,
    jitter_of,
    make_clock,
    take_stamp,
    time_of,
)
from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.bus.mapping.timing import Joining, Numbering
from observer_rt.foundation.compiled import compiled, inner, inner_separate, separate
from observer_rt.foundation.continuity import Doubt
from observer_rt.foundation.referenced import referenced
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLISECOND

SURE = 0.75  # cycles short of a whole turn of the counter, up to which a delay is surely no loss
DECIDED = 0.5  # the same, from which on frames are lost
UNUSUAL = 2.0  # times the usual greatest delay, and SURE of a cycle less than one, a delay means trouble
SLIPPED = (
    0.5  # cycles beyond what is not known, by which all delays of a window grew: frames were lost unseen
)
OLD_FRAMES_OF_RESTART = 3  # consecutive old frames that mean: the device began anew

COUNTING = np.dtype(
    [
        ("modulus", np.int64),  # of the counter; 1 without one
        ("begun", np.bool_),
        ("number", np.int64),  # of the last frame
        ("sequence", np.int64),  # its counter
        ("old", np.int64),  # frames older than the last, consecutive
    ],
    align=True,
)


class Count(IntEnum):
    """What a frame is to the ones before it."""

    NEXT = 0
    REPEATED = 1
    OLD = 2  # overtaken by a later one
    ANEW = 3  # it fits nothing counted so far


def make_counting(modulus: int) -> NDArray[np.void]:
    """Memory (1,) for one message that no frame has come of; `modulus` of its counter, 1 without one."""
    counting = np.zeros(1, COUNTING)
    counting["modulus"] = modulus
    return counting


@separate
def count_frame(counting, clock, sequence: int, stamp: int) -> int:  # type: ignore[no-untyped-def]
    """Give a frame its `number`; `Count`. `sequence`: its counter; the clock counts in samples."""
    if not counting.begun:
        _count_anew(counting, sequence)
        return Count.NEXT
    cycle = clock.samples * clock.interval
    turn = counting.modulus * cycle
    step = (sequence - counting.sequence) % counting.modulus if counting.modulus > 1 else 1
    number = counting.number + step
    delay = delay_of(clock, (number + 1) * clock.samples - 1, stamp)
    if delay >= turn - DECIDED * cycle and sees_losses(counting, clock):
        number += counting.modulus * math.floor((delay + DECIDED * cycle) / turn)
    elif step == 0:
        return Count.REPEATED
    elif delay < -DECIDED * cycle - clock.residual:
        # it cannot have come before it was sent
        counting.old += 1
        if counting.modulus == 1 or counting.old >= OLD_FRAMES_OF_RESTART or delay + turn < -DECIDED * cycle:
            _count_anew(counting, sequence)
            return Count.ANEW
        return Count.OLD
    counting.number = number
    counting.sequence = sequence
    counting.old = 0
    return Count.NEXT


@inner
def sees_losses(counting, clock) -> bool:  # type: ignore[no-untyped-def]
    """Whether delays like those of the last window leave no doubt of how many frames were lost."""
    cycle = clock.samples * clock.interval
    return bool(clock.points >= ENOUGH_POINTS and clock.spread < (counting.modulus - SURE) * cycle)


@compiled
def is_sure(counting, clock) -> bool:  # type: ignore[no-untyped-def]
    """Whether the frames of this window and the last are numbered without doubt."""
    cycle = clock.samples * clock.interval
    latest = max(clock.spread, clock.latest)
    return bool(
        clock.residual < math.inf
        and latest < (counting.modulus - SURE) * cycle
        and latest < UNUSUAL * clock.usual + (1.0 - SURE) * cycle
    )


@compiled
def has_slipped(clock) -> bool:  # type: ignore[no-untyped-def]
    """Whether the window just ended shows that frames were lost before it, unseen among their delays."""
    return bool(clock.raised > SLIPPED * clock.samples * clock.interval + clock.residual)


@inner
def _count_anew(counting, sequence: int) -> None:  # type: ignore[no-untyped-def]
    counting.begun = True
    counting.number = 0
    counting.sequence = sequence
    counting.old = 0


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
    sent = time - grid.first_stamp + 1e9 * keeping.timing[leading].delay
    return float(index_at(grid, sent, grid.first_stamp))


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


LINE_SLOPE = 0.125 * MEGAPASCAL / MICROSECOND  # Pa/s, steepest of the line pressure when the needle opens
SECOND = 1e9  # ns
LARGEST_DRIFT = 0.01  # of a clock; beyond it a recording is played at another speed


@dataclass(frozen=True)
class MessageTiming:
    """One input message: delays of its frames, drift of its clock against the receiver's [-].

    unknown [s]: what its samples may lie beside their place on the grid; 0 where an index joins them, infinite
    while the clocks are not known.
    """

    name: str
    jitter: Jitter
    drift: float
    unknown: float
    lately: float
    """Greatest delay in the last 0.2 s [s]."""

    @property
    def pressure_error(self) -> float:
        """Line pressure [Pa] that `unknown` is worth."""
        return self.unknown * LINE_SLOPE

    def as_text(self) -> str:
        """One line for the screen: delays, drift, and what they do to the samples."""
        if self.jitter.frames == 0:
            return f"{self.name}: too few frames to tell their times"
        drift = f"drift {self.drift * 1e6:+.1f} ppm"
        if abs(self.drift) >= LARGEST_DRIFT:
            drift = f"sent at {1.0 / (1.0 + self.drift):.3g} times its rate"
        placed = f"by its clock, its samples are placed to {self.unknown / MICROSECOND:.2g} us"
        if self.unknown == 0.0:
            placed = "no effect, samples are counted"
            if abs(self.drift) >= LARGEST_DRIFT:
                placed = "right if a recording is replayed at that speed, else correct sampling.rate_hz"
        elif math.isinf(self.unknown):
            placed = "its samples cannot be placed: its clock is not known yet"
        late, jitter = _time_text(self.jitter.greatest), _time_text(self.jitter.sigma)
        return f"{self.name}: frames came late by up to {late}, their jitter is {jitter}, {drift}; {placed}"


def _time_text(seconds: float) -> str:
    """In the unit that suits it."""
    if seconds >= 1.0:
        return f"{seconds:.6g} s"
    if seconds >= 1 * MILLISECOND:
        return f"{seconds / MILLISECOND:.3g} ms"
    return f"{seconds / MICROSECOND:.1f} us"


def timing_of(bus: BusMap, keeping: Timekeeping) -> tuple[MessageTiming, ...]:
    """What the stamps have shown so far, message by message."""
    grid = keeping.clocks[int(keeping.memory[0]["leading"])]
    result = []
    for stream, (timing, clock) in enumerate(zip(keeping.timing, keeping.clocks, strict=True)):
        unknown = 0.0
        if timing["joining"] == Joining.CLOCK:
            unknown = float(grid["residual"] + clock["residual"]) / SECOND
        drift = float(clock["drift"]) / float(clock["interval"])
        name, lately = bus.name_of(layout_of(bus, stream)), float(clock["spread"]) / SECOND
        result.append(MessageTiming(name, jitter_of(clock), drift, unknown, lately))
    return tuple(result)
