"""One sample of the pair, identification system x~ and observer x^: the innovation, and what it says.

Watches the running mean of normalised innovations squared (NIS) against a limit, at every sample.
"""

import math
from typing import Any

from observer_rt.foundation.compiled import compiled, inlined, inner, inner_separate
from observer_rt.foundation.continuity import Doubt
from observer_rt.foundation.referenced import call
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.observer.stream.front_end import known
from observer_rt.observer.stream.outliers import accepted
from observer_rt.observer.stream.state import LINE, RING, Observer
from observer_rt.observer.stream.stepper import Stepping

MEMORY = 16.0  # samples the running mean square remembers; its own standard deviation for white noise is .25
LARGEST = 20.0  # variances a single square counts for: three spikes are no contradiction
LIMIT = 5.0  # of the mean square; no injector of `tools/bench accuracy` that is valid shows more than 3
CALM = 2.5  # of the mean square: noise, four standard deviations at most
_NO_DOUBT = int(Doubt.NONE)


@inlined
def watch(observer: Observer, innovation: float, doubt: int) -> None:
    """Take in an innovation of x~ [p_0]; what contradicts the model stays so until an event after it has passed.

    doubt: `Doubt` of its sample; one that is not to be trusted contradicts nothing. Squares, for the line swings:
    innovations of both signs would make up for each other.
    """
    memory = observer.memory[0]
    if doubt != _NO_DOUBT or memory.doubted != _NO_DOUBT:
        memory.surprise = 0.0
        return
    square = min(innovation * innovation * memory.innovation_weight, LARGEST)
    memory.surprise += (square - memory.surprise) / MEMORY
    if memory.surprise > LIMIT and memory.synchronised and not memory.contradicted:
        memory.contradicted = True
        memory.contradicted_in = memory.event_number if memory.in_event else memory.event_number + 1


@compiled
def end_contradiction(observer: Observer, is_resting: bool, is_new: bool) -> None:
    """A contradiction that came with the needle long shut is a channel's, and over when that is well again.

    is_new: it came with this sample. One that lasts until an opening lasts until an event has passed.
    """
    memory = observer.memory[0]
    if is_new:
        memory.contradicted_at_rest = is_resting
        memory.calm = 0
    memory.contradicted_at_rest = memory.contradicted_at_rest and is_resting
    memory.calm = memory.calm + 1 if memory.surprise < CALM else 0
    if memory.contradicted_at_rest and memory.calm >= observer.constants.timing.good:
        memory.contradicted = False


FALL = 3e6  # Pa by which an injection lets the line pressure fall at least
SWINGS_FOR = 3  # times the gap between events, after the needle has shut
INJECTIONS_UNSEEN = 2  # in a row, from which on the lift is dead


@inlined
def count_falls(observer: Observer, row: Any, is_new: bool) -> None:
    """At a contradiction with the needle long shut: whether the line pressure fell and came back, as by an injection.

    is_new: it came with this sample. Not while the line still swings from an opening.
    """
    memory = observer.memory[0]
    if row.index - memory.shut_since < SWINGS_FOR * observer.constants.timing.event_gap:
        return
    drop = row.line_pressure - row.rail_pressure
    memory.lowest_line = drop if is_new else min(memory.lowest_line, drop)
    if (
        not memory.contradicted
        and -memory.lowest_line * observer.constants.coefficients.pressure_scale > FALL
    ):
        memory.falls += 1


SHORT = (
    2  # times what an opening takes to be one: leaps of the innovation that last longer contradict the model
)
# s of standstill in which the offset of x~ follows its innovations: some samples of a rail pressure of 1 kHz
OFFSET_FOLLOWS = 5e-3
FURTHEST_OFFSET = 1.5 * MEGAPASCAL  # from the learned one: what moves further is no offset of a good sensor
_MASK = RING - 1
_START, _PREDICT, _CORRECT = int(Stepping.START), int(Stepping.PREDICT), int(Stepping.CORRECT)


@inner
def start_pair(observer: Observer, position: int) -> None:
    """x~ (and x^ with it) begins anew: p_L = y, Q_L = 0, empty sac."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    memory.offset = memory.learned_offset
    row.indicated = row.line_pressure - memory.offset
    row.innovation = 0.0
    memory.accepted_innovation = 0.0
    memory.surprise = 0.0
    call(observer.step, _START, position)
    memory.since_start = 0
    memory.closed_since_start = 0


@inner
def _is_measured(observer: Observer, position: int) -> bool:
    """Whether the line pressure that belongs to a sample is in the ring, for it may be recorded late or early.

    And is one: an outlier is none.
    """
    late = observer.constants.sensor.late
    if (observer.ring[(position + late) & _MASK].bridged >> LINE) & 1:
        return False
    if late == 0:
        return True
    if late > 0:
        return bool(known(observer, position) >= late)
    return bool(position + late >= observer.memory[0].segment_start)


@inner_separate
def step_pair(observer: Observer, position: int) -> bool:
    """Both systems from the previous sample to this one; False when a state is no longer finite."""
    constants, memory, row = observer.constants, observer.memory[0], observer.ring[position & _MASK]
    shown = call(observer.step, _PREDICT, position)
    row.innovation = 0.0
    if _is_measured(observer, position):
        y = observer.ring[(position + constants.sensor.late) & _MASK].line_pressure
        innovation = y - memory.offset - shown
        if accepted(memory, min(constants.timing.bridge, SHORT * constants.timing.confirm), innovation):
            row.innovation = innovation
            was_contradicted = memory.contradicted
            watch(observer, innovation, row.doubt)
            if memory.contradicted:
                end_contradiction(observer, row.resting, not was_contradicted)
                count_falls(observer, row, not was_contradicted)
    is_finite = not math.isnan(call(observer.step, _CORRECT, position))
    memory.since_start += 1
    if row.resting:
        _follow_offset(observer, row.innovation)
    return is_finite


@inner
def _follow_offset(observer: Observer, innovation: float) -> None:
    """Between events, too, the offset of x~ is what the standstill shows: sensors drift, or their gains differ.

    Not where the noise is coloured: its slow part has a mean at rest that the next opening does not keep.
    """
    memory = observer.memory[0]
    furthest = FURTHEST_OFFSET / observer.constants.coefficients.pressure_scale
    is_settled = memory.since_start > observer.constants.timing.settle
    if not (memory.offset_moves and is_settled and math.isfinite(innovation)):
        return
    moved = memory.offset - memory.learned_offset + innovation * observer.constants.interval / OFFSET_FOLLOWS
    memory.offset = memory.learned_offset + min(max(moved, -furthest), furthest)
