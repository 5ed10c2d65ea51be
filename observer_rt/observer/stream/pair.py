"""One sample of the pair, identification system x~ and observer x^: the innovation, and what it says."""

import math

from observer_rt.foundation.bound import call
from observer_rt.foundation.compiled import inner, inner_separate
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.observer.stream.front_end import known
from observer_rt.observer.stream.innovation_monitor import end_contradiction, watch
from observer_rt.observer.stream.outliers import accepted
from observer_rt.observer.stream.state import LINE, RING, Observer
from observer_rt.observer.stream.stepper import Stepping

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
