"""What a verdict on an event makes of the samples after it."""

import math

from observer_rt.foundation.compiled import compiled, inner, inner_separate, separate
from observer_rt.foundation.referenced import call
from observer_rt.foundation.small_arrays import copy_matrix, copy_vector
from observer_rt.model.right_hand_side import SAC
from observer_rt.observer.stream.pair import FURTHEST_OFFSET
from observer_rt.observer.stream.state import PENDING_EVENTS, RING, Observer, Reason
from observer_rt.observer.stream.stepper import Stepping
from observer_rt.observer.stream.verdict import SLOTS, Taken

SLOW_PEAK = 5.0  # with the limit of the watch, five standard deviations
_MASK = RING - 1
_PUT = int(Stepping.PUT)
_PASSED = int(Reason.NONE)
_NOT_JUDGED = int(Reason.NOT_JUDGED)
_NOTHING, _EXAMINED, _LEARNED = (int(each) for each in Taken)


@separate
def judged(observer: Observer) -> bool:
    """Judge the oldest closed event by the verdict posted on it; False, with nothing done, where there is none."""
    memory = observer.memory[0]
    number = memory.events_taken
    verdict = observer.verdicts.slots[number % SLOTS]
    event = memory.events[number % PENDING_EVENTS]
    if verdict.learned.number == number + 1:
        event.taken = _LEARNED
        _put_learned_into_force(observer, number % SLOTS, verdict.learned.is_coloured)
        _note(observer, event, verdict.learned)
    elif verdict.examined.number == number + 1:
        event.taken = _EXAMINED
        if verdict.earlier == number + 1:
            _put_learned_into_force(observer, SLOTS + number % SLOTS, verdict.examined.is_coloured)
        _note(observer, event, verdict.examined)
    else:
        return False
    _count(observer)
    look_at_familiarity(observer, memory.processed)
    return True


@inner
def look_at_familiarity(observer: Observer, position: int) -> None:
    """Whether the flow is known at the rail pressure of a sample: looked at when either may have changed."""
    memory = observer.memory[0]
    rail_pressure = observer.ring[position & _MASK].rail_pressure
    memory.familiar = memory.rail_from <= rail_pressure <= memory.rail_to
    memory.sac_flow = memory.line_flow = 0.0


@inner
def follow_filling(observer: Observer, position: int) -> None:
    """Whether what has passed the open needle came from a sac no fuller than known, on the average."""
    memory = observer.memory[0]
    if not memory.needle_open:
        return
    x_hat, rate = observer.x_hat[position & _MASK], max(observer.ring[position & _MASK].injection_rate, 0.0)
    memory.sac_flow += rate * x_hat[SAC]
    memory.line_flow += rate * x_hat[0]
    if memory.sac_flow > memory.filled_to * memory.line_flow:
        memory.familiar = False


@inner
def given_up(observer: Observer) -> bool:
    """Leave the oldest closed event, which is due, not judged; False, with nothing done, if a verdict may still come.

    An event that only the next window of the source showed to be over, long due, has until two more have closed.
    """
    memory = observer.memory[0]
    event = memory.events[memory.events_taken % PENDING_EVENTS]
    if event.closed_index > event.due_index and memory.events_closed - memory.events_taken <= 2:
        return False
    event.taken = _NOTHING
    _note_reason(observer, event, _NOT_JUDGED)
    _count(observer)
    return True


@inner
def _count(observer: Observer) -> None:
    memory = observer.memory[0]
    memory.waiting = False
    memory.events_judged += 1
    memory.events_taken += 1


@inner
def _note(observer: Observer, event, finding) -> None:  # type: ignore[no-untyped-def]
    """What was found of an event."""
    memory = observer.memory[0]
    memory.offset_moves = not finding.is_coloured
    _note_reason(observer, event, finding.reason)
    if not math.isnan(finding.at_rest):
        expect(observer, finding.at_rest)


@inner
def _note_reason(observer: Observer, event, judgement: int) -> None:  # type: ignore[no-untyped-def]
    """Whether an event passed.

    An event with samples that were not to be trusted, or that could not be tested, makes nothing valid; a second in a
    row that could not be tested, though its samples were to be trusted, ends what was known. A contradiction is over
    with an event that passed, or with the one it came in, if that was of samples that were not to be trusted.
    """
    memory = observer.memory[0]
    is_doubtful = event.doubtful != _PASSED
    is_untested = judgement == _NOT_JUDGED
    if is_doubtful or is_untested:
        memory.doubtful_events += 1
    if not is_untested:
        memory.untested = 0
        memory.judgement = judgement
    elif not is_doubtful:
        memory.untested += 1
        if memory.untested > 1:
            memory.judgement = judgement
    is_passed = judgement == _PASSED and event.number >= memory.contradicted_in
    is_explained = is_doubtful and event.number == memory.contradicted_in
    if is_passed or is_explained:
        memory.contradicted = False
    if judgement == _PASSED and event.number >= memory.halted_in:
        memory.halted_in = 0


@inner_separate
def _put_learned_into_force(observer: Observer, slot: int, is_coloured: bool) -> None:
    """What was learned, but for an offset that the standstill has moved meanwhile."""
    memory = observer.memory[0]
    verdict = observer.verdicts.slots[slot]
    memory.innovation_sigma = verdict.innovation_sigma
    expect(observer, 0.0)
    offset = memory.offset
    carry_on(observer, slot)
    furthest = FURTHEST_OFFSET / observer.constants.coefficients.pressure_scale
    has_followed = abs(offset - memory.learned_offset) < furthest
    if has_followed and not is_coloured:
        memory.offset = offset
    call(observer.step, _PUT, slot)
    if verdict.is_adopted:
        memory.phi_version += 1


@separate
def carry_on(observer: Observer, slot: int) -> None:
    """Carry the theta, gains and noise of a slot from here on."""
    memory = observer.memory[0]
    verdict = observer.verdicts.slots[slot]
    copy_vector(verdict.theta, memory.theta)
    copy_matrix(verdict.output, memory.output)
    copy_vector(verdict.bias, memory.bias)
    copy_vector(verdict.back_pressure, memory.back_pressure)
    memory.learned_offset = verdict.learned_offset
    memory.offset = verdict.learned_offset
    memory.lag = verdict.lag
    memory.rail_from, memory.rail_to = verdict.rail_from, verdict.rail_to
    memory.filled_to = verdict.filled_to
    copy_vector(verdict.line, memory.line)
    for channel in range(3):
        memory.channels[channel].noise = verdict.noise[channel]
    copy_matrix(observer.verdicts.gains[slot], observer.gains)


@compiled
def expect(observer: Observer, at_rest: float) -> None:
    """What innovations of a standard deviation are to be like; at_rest: mean square of coloured ones, needle shut.

    What is slow does not average out in the watch's mean of squares: it may be SLOW_PEAK times its own mean.
    """
    memory = observer.memory[0]
    white = memory.innovation_sigma**2 * memory.healthy_variance
    memory.innovation_weight = 1.0 / (white + SLOW_PEAK * max(at_rest - white, 0.0))
