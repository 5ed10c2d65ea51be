"""The observer over its stream of samples: what happens, in which order, at every sample."""

from typing import Any

import numpy as np

from observer_rt.foundation.compiled import inlined, inner, inner_separate, separate
from observer_rt.foundation.continuity import RECORDED_RING, Break, Doubt
from observer_rt.observer.stream.events import (
    begin_injection,
    break_event,
    follow_injection,
    judgement_due,
    make_all_due,
    note_closed_late,
    part_events,
)
from observer_rt.observer.stream.front_end import (
    LOWEST,
    STEPPED,
    area_at,
    area_between_lifts,
    is_recorded_shut,
    keep_sinking,
    known,
    leaps_about,
    open_from,
    opens_at,
    shut_area,
    stays_low,
    true_lift,
    true_rail_pressure,
)
from observer_rt.observer.stream.judgement import follow_filling, given_up, judged, look_at_familiarity
from observer_rt.observer.stream.lift_step import come_to_rest, lingers
from observer_rt.observer.stream.lift_zero import (
    follow_lift,
    is_beyond_limit,
    look_at_opening,
    look_at_rest,
    look_at_start,
    take_out_zero,
)
from observer_rt.observer.stream.outliers import inspect
from observer_rt.observer.stream.pair import INJECTIONS_UNSEEN, start_pair, step_pair
from observer_rt.observer.stream.standstill import gather
from observer_rt.observer.stream.state import LIFT, LINE, MAX_EVENT, RAIL, RING, Observer, Reason
from observer_rt.observer.stream.validity import SampleFacts, reason_of_sample, state_of_sample

_MASK = RING - 1
_RECORDED_MASK = RECORDED_RING - 1
_RESTLESS = MAX_EVENT + RING // 8  # samples without standstill; a needle that is open as long is stuck
_NONE = int(Break.NONE)
_JUMP = int(Break.JUMP)
_RESTART = int(Break.RESTART)
_NO_DOUBT = int(Doubt.NONE)
_NO_REASON = int(Reason.NONE)
_NUMERICAL = int(Reason.NUMERICAL)
_NEEDLE_STUCK = int(Reason.NEEDLE_STUCK)
_NO_STANDSTILL = int(Reason.NO_STANDSTILL)
_LIFT_ZERO = int(Reason.LIFT_ZERO)
_FROZEN = int(Doubt.FROZEN)


@inner_separate
def take_recorded(observer: Observer, end: int, doubt: int) -> None:
    """Take in the recorded samples up to the number `end`; `doubt` (Doubt) says why they are not to be trusted."""
    memory = observer.memory[0]
    ahead = observer.constants.undoing.ahead
    while memory.recorded < end:
        number = memory.recorded
        sample = observer.recorded[number & _RECORDED_MASK]
        if sample.broken != _NONE:
            _give_on(observer, number)  # nothing follows what waits
            memory.unbroken_since = number
        sample.doubt = doubt
        memory.recorded += 1
        if doubt != _NO_DOUBT:
            for earlier in range(memory.given_on, number):
                observer.recorded[earlier & _RECORDED_MASK].doubt = doubt
        _give_on(observer, memory.recorded - ahead)


@inner_separate
def _give_on(observer: Observer, end: int) -> None:
    """Append the recorded samples up to the number `end`, with what is stated of their channels undone."""
    memory = observer.memory[0]
    is_stated = observer.constants.undoing.stated
    while memory.given_on < end:
        number = memory.given_on
        sample = observer.recorded[number & _RECORDED_MASK]
        rail_pressure = true_rail_pressure(observer, number) if is_stated else sample.values[RAIL]
        lift = true_lift(observer, number) if is_stated else sample.values[LIFT]
        _append(observer, sample, rail_pressure, lift)
        memory.given_on += 1


@inlined
def _append(observer: Observer, sample: Any, rail_pressure: float, needle_lift: float) -> None:
    """Into the ring, normalised."""
    c = observer.constants.coefficients
    inputs = observer.constants.inputs
    memory = observer.memory[0]
    row = observer.ring[memory.received & _MASK]
    row.index = sample.index
    at_rail = inputs.rail_factor * rail_pressure + inputs.rail_shift
    row.rail_pressure = (at_rail - c.chamber_pressure) / c.pressure_scale
    row.needle_lift = needle_lift
    row.line_pressure = (sample.values[LINE] - c.chamber_pressure) / c.pressure_scale
    row.lift_after = sample.shares[LIFT]
    row.rail_share = sample.shares[RAIL]
    row.interpolated = sample.interpolated
    row.broken = sample.broken
    row.bridged = 0
    row.doubt = sample.doubt
    if sample.doubt != _NO_DOUBT:  # it may have begun with samples that still wait for their look-ahead
        first = max(memory.processed, memory.received - observer.constants.timing.lookahead)
        for position in range(first, memory.received):
            observer.ring[position & _MASK].doubt = sample.doubt
    if sample.broken != _NONE:
        memory.newest_break = memory.received
    memory.received += 1
    if sample.interpolated:
        memory.interpolated += 1


@separate
def advance_stream(observer: Observer) -> bool:
    """Process every sample whose look-ahead is complete.

    Returns True when it stopped because an event must be judged first (`memory.waiting`).
    """
    memory = observer.memory[0]
    if memory.draining:
        _give_on(observer, memory.recorded)
    while memory.processed < memory.received:
        position = memory.processed
        if (
            not memory.draining
            and known(observer, position) < observer.constants.timing.lookahead
            and not _cut_short(observer, position)
        ):
            break
        _inspect_ahead(observer, position)
        if not _process(observer, position):
            return True
        memory.processed += 1
    if memory.draining:
        _finish(observer)
    return bool(memory.waiting)


@inlined
def _inspect_ahead(observer: Observer, position: int) -> None:
    """Look for outliers among the samples that must be known at `position`.

    Not among all that are received: what is found depends on what was judged before, and by then more or fewer have
    come as a frame carries more or fewer.
    """
    memory = observer.memory[0]
    for k in range(memory.inspected, position + known(observer, position) + 1):
        row = observer.ring[k & _MASK]
        outlier = inspect(observer, k)
        if row.doubt == _NO_DOUBT:
            row.doubt = outlier
        memory.inspected = k + 1


@inner
def _cut_short(observer: Observer, position: int) -> bool:
    """Whether a break follows within the look-ahead, so that it will never be longer."""
    following = position + known(observer, position) + 1
    return bool(following < observer.memory[0].received)


@inner_separate
def _finish(observer: Observer) -> None:
    """No sample will come: end the event under way and have every closed one judged."""
    memory = observer.memory[0]
    break_event(observer, memory.processed - 1)
    make_all_due(observer)
    while memory.events_taken < memory.events_closed and judged(observer):
        pass
    memory.waiting = memory.events_taken < memory.events_closed


@inner_separate
def _process(observer: Observer, position: int) -> bool:
    """One sample; False, with nothing done, when an event must be judged before it."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    if row.broken != _NONE:
        _end_segment(observer, position)
    take_out_zero(observer, position)
    opens = not memory.needle_open and opens_at(observer, position)
    if opens and stays_low(observer, position, LOWEST):
        opens = False
    while not opens and memory.events_taken < memory.events_closed and judgement_due(observer, row.index):
        if judged(observer):
            continue
        if memory.waits_for_verdicts:
            memory.waiting = True
            return False
        if not given_up(observer):
            break
    if row.broken != _NONE:
        _begin_segment(observer, position)
    _move_needle(observer, position, opens)
    if position == memory.segment_start + observer.constants.timing.good:
        look_at_start(observer, position)
    if memory.needle_open and position == memory.opening + observer.constants.timing.good:
        look_at_opening(observer, position)
    if (position - memory.opening) % observer.constants.timing.settle == 0:
        look_at_rest(observer, position)
    row.resting = not memory.needle_open and row.index - memory.shut_since > observer.constants.timing.settle
    if row.broken != _NONE:
        start_pair(observer, position)
    elif not step_pair(observer, position):
        _recover(observer, position)
    _settle(observer, position)
    _mark(observer, position)
    gather(observer, position)
    follow_lift(observer, position)
    follow_injection(observer, position)
    return True


@inner
def _end_segment(observer: Observer, position: int) -> None:
    """The stream broke before `position`: finish what was under way (harmless when done twice)."""
    row = observer.ring[position & _MASK]
    if position > 0 and observer.memory[0].in_event:
        break_event(observer, position - 1)
        note_closed_late(observer, row.index)
    if row.broken == _RESTART:
        make_all_due(observer)


@inner
def _begin_segment(observer: Observer, position: int) -> None:
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    if row.broken != _JUMP:
        # the needle may have moved meanwhile: nothing is known of the sac
        memory.shut_since = row.index
        memory.needle_open = False
    memory.segment_start = position
    memory.rested = position
    memory.synchronised = False
    memory.unsynchronised_by = row.broken
    memory.breaks += 1


@inner_separate
def _move_needle(observer: Observer, position: int, opens: bool) -> None:
    """Dead band and events; the seat area of a closed needle is 0 or, beside an opening, negative."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    if opens:
        part_events(observer, position)
        memory.needle_open = True
        open_from(observer, position)
        look_at_familiarity(observer, position)
        begin_injection(observer, position)
        if leaps_about(observer, position):
            memory.contradicted, memory.contradicted_at_rest = True, False
            memory.contradicted_in = memory.event_number
        if stays_low(observer, position, STEPPED):
            memory.halted_in = memory.event_number
    elif memory.needle_open:
        if not is_recorded_shut(observer, position):
            memory.fall = 0.0
            if lingers(observer, position):
                come_to_rest(observer, position)
        elif not keep_sinking(observer, position):
            memory.needle_open = False
            memory.shut_since = row.index
    if memory.needle_open:
        row.lift_area = area_at(observer, position)
    else:
        row.lift_area = shut_area(observer, position)
    row.seat_area = area_between_lifts(observer, position)


@inner
def _recover(observer: Observer, position: int) -> None:
    """A state is not finite: start anew here, valid again only after a standstill."""
    memory = observer.memory[0]
    memory.numerical_resets += 1
    memory.synchronised = False
    memory.event_learnable = False
    memory.unsynchronised_by = _NUMERICAL
    start_pair(observer, position)


@inner
def _settle(observer: Observer, position: int) -> None:
    """Re-synchronised once x~ is good and the sac at rest; stays so until the stream breaks."""
    memory = observer.memory[0]
    if not memory.needle_open:
        memory.closed_since_start += 1
    if observer.ring[position & _MASK].resting and (
        memory.closed_since_start >= observer.constants.timing.good
    ):
        memory.synchronised = True
        memory.unsynchronised_by = _NO_REASON
    if observer.ring[position & _MASK].resting:
        memory.rested = position
    is_stuck = memory.needle_open and position - memory.opening > MAX_EVENT
    if is_stuck or position - memory.rested > _RESTLESS:
        memory.synchronised = False
        memory.unsynchronised_by = _NEEDLE_STUCK if is_stuck else _NO_STANDSTILL
        memory.event_learnable = False


@inner
def _is_only_rest_held(observer: Observer, position: int) -> bool:
    """Whether all that is wrong with a sample is that the lift of a needle at rest is held.

    Had the needle moved meanwhile, the lift would leap when it is let go, or the line would ring.
    """
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    timing = observer.constants.timing
    is_at_rest = not memory.needle_open and row.index - memory.shut_since > timing.bounce
    others = max(memory.channels[RAIL].bridged, memory.channels[LINE].bridged)
    return bool(is_at_rest and row.doubt == _FROZEN and others <= timing.bridge)


@inner_separate
def _mark(observer: Observer, position: int) -> None:
    """Validity, reason and state of the processed sample; its rate is not available while not synchronised."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    follow_filling(observer, position)
    facts = SampleFacts(
        memory.unsynchronised_by,
        memory.synchronised,
        row.doubt,
        memory.doubted,
        is_beyond_limit(observer),
        memory.falls >= INJECTIONS_UNSEEN,
        memory.events_judged - memory.doubtful_events,
        observer.constants.events_required,
        memory.familiar,
        memory.judgement,
        memory.contradicted or memory.halted_in > 0,
        memory.phi_version > 0,
    )
    row.reason = reason_of_sample(facts)
    row.valid = row.reason == _NO_REASON
    row.state = state_of_sample(facts, row.reason)
    if not memory.synchronised:
        row.injection_rate = np.nan
        return
    is_doubted = row.doubt == _NO_DOUBT and memory.doubted != _NO_REASON
    if is_doubted or (row.doubt != _NO_DOUBT and not _is_only_rest_held(observer, position)):
        memory.event_learnable = False
        memory.event_doubtful = row.reason
    elif row.reason == _LIFT_ZERO:
        memory.event_doubtful = row.reason
