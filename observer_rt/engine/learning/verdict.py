"""Verdict on an event: all that speaks against it, as lists of rules.

Before any fit: pressures that are not of rail and line, or beyond laws in force. After it: look-alikes of wear (coil,
sensors, inertance), whatever the posterior says, and what the account leaves open. A change is reported, and refuses
nothing; events are refused that nothing explains, or whose explanations leave the mass open.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from observer_rt.engine.estimation.parameters import Parameter, Theta, sensor_lag
from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.learning import adequacy, kinds
from observer_rt.engine.learning.account import ExplainedEvent, has_lag_for_bounce
from observer_rt.engine.learning.adequacy import Objection, tempering
from observer_rt.engine.learning.event import ClosedEvent, EventReader
from observer_rt.engine.learning.explanations import Explanation
from observer_rt.engine.learning.fit import LEAST_LAG, MOVED_IN_TIME
from observer_rt.engine.learning.knowledge import LearningState
from observer_rt.engine.learning.mass import EventMass, Shares, flow_change
from observer_rt.engine.learning.noise import median
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.units import MEGAPASCAL, Z_95
from observer_rt.model.effective import LAG_UNIT

AGREED = 0.95  # of the posterior; I
WRONG, SURELY = 0.03, 3.0  # of a mass, which the published one is not off by at so many standard deviations; P, I
UNEXPLAINED = (Reason.MODEL_INADEQUATE, Reason.CONTRADICTED)
# s, of the lift against the pressures, late or early, that x^ may do without: 1 % of a mass, some tenths of it.
LATEST_LIFT, EARLIEST_LIFT = 6e-6, -25e-6
IMPLAUSIBLE = 15 * MEGAPASCAL  # Between rail and line at rest: another unit, or no sensor; nothing to be learned.
SWINGS, SWAPPED = 2 * MEGAPASCAL, 3.0  # Of the rail pressure in an event, and more than the line's by this factor.
_ENDS = (0.01, 0.99)  # of the samples of an event, that are no outliers


class Rule(NamedTuple):
    """Reason against an event, where its test of some facts holds, and the phase in which it shows."""

    reason: Reason
    holds: Callable[..., bool]
    phase: Callable[..., Phase | None] = lambda *_: None


def _objections(rules: Sequence[Rule], *facts: Any) -> Iterator[Objection]:
    return (Objection(rule.reason, rule.phase(*facts)) for rule in rules if rule.holds(*facts))


def first_objection(state: LearningState, event: ClosedEvent, reader: EventReader) -> Objection | None:
    """Objection to an event before any fit; state: with its standstill."""
    return next(_objections(BEFORE_A_FIT, state, event, reader), None)


def _is_far(_: LearningState, event: ClosedEvent, reader: EventReader) -> bool:
    """Whether the pressures at rest are too far apart to be those of rail and line."""
    window, before = event.window, slice(0, max(event.window.opening, 1))
    return abs(median(window.output[before] - window.inputs[before, 0])) * reader.pressure_scale > IMPLAUSIBLE


def _are_swapped(_: LearningState, event: ClosedEvent, reader: EventReader) -> bool:
    """Whether the rail moves where the line does not: it hardly does when the needle opens, the line does."""
    rail, line = float(np.std(event.window.inputs[:, 0])), float(np.std(event.window.output))
    return rail * reader.pressure_scale > SWINGS and rail > SWAPPED * line


def _is_unseen(_: LearningState, event: ClosedEvent, reader: EventReader) -> bool:
    """True if line pressures lie beyond those at which laws in force were seen, but for single samples."""
    lowest, highest = reader.healthy.seen
    if lowest == -highest:  # anywhere
        return False
    chamber = event.constants.coefficients.chamber_pressure
    low, high = (chamber + reader.pressure_scale * end for end in np.quantile(event.window.output, _ENDS))
    return not (lowest <= low and high <= highest)


BEFORE_A_FIT = (
    Rule(Reason.INPUT_FROZEN, lambda state, *_: state.held_rail.is_held),
    Rule(Reason.PRESSURE_OFFSET, _is_far, lambda *_: Phase.STANDSTILL),
    Rule(Reason.CONTRADICTED, _are_swapped),
    Rule(Reason.OUTSIDE_LEARNED_RANGE, _is_unseen),
)


class LearnedFacts(NamedTuple):
    """Facts learned with an event, in SI, and of its innovations."""

    is_disturbed: bool  # by the coil
    offset: float  # inf: of a gain that is not as stated
    untold: float  # standard deviation of what the gain may be of it
    bent: float  # share by which a flow may be off, as a sensor is not straight
    lag: float
    lift_delay: float
    flow: float  # change of a steady one through seat and nozzle, at the highest lift
    stiffness: float
    line: float  # share by which the line's inertance is known
    phase: Phase | None  # in which recent events leave too much
    is_adequate: bool  # whether the model fits anybody


LOOK_ALIKES = (
    Rule(Reason.COIL_CURRENT, lambda f: f.is_disturbed),
    Rule(Reason.PRESSURE_OFFSET, lambda f: adequacy.is_offset(f.offset, f.untold) or SURELY * f.bent > WRONG),
    Rule(Reason.SENSOR_LAG, lambda f: f.lag > adequacy.LARGEST_LAG),
    Rule(Reason.LIFT_SENSOR_LAG, lambda f: f.lift_delay > LATEST_LIFT),
    Rule(Reason.TIME_BASE, lambda f: f.lift_delay < EARLIEST_LIFT),
    Rule(Reason.AMBIGUOUS_SCALE, lambda f: adequacy.looks_like_inertance(f.flow, f.stiffness, f.line)),
    Rule(Reason.MODEL_INADEQUATE, lambda f: f.phase is not None or not f.is_adequate, lambda f: f.phase),
)


def facts_of(explained: ExplainedEvent, is_disturbed: bool, reader: EventReader) -> LearnedFacts:
    """Facts of an event that was explained.

    Innovations a little too loud or coloured in recent events speak against the model together: each by itself is no
    more likely than noise, for an event at fault pays for its loudness anew.
    """
    window, learned, scale = explained.window, explained.account.learned, reader.pressure_scale
    theta = learned.theta
    gain, untold = float(theta[Parameter.LINE_PRESSURE_GAIN]), learned.belief.sigma[Parameter.LINE_PRESSURE_GAIN]
    is_other = abs(gain) > Z_95 * reader.calibration.gain > 0.0
    opened = window.inputs[int(np.argmax(window.inputs[:, 1]))]
    phase = adequacy.inadequate_phase(learned.statistics, window.needle is not None)
    # of a needle that answers commands a lag is one with its delays
    if phase is None and window.needle is None and adequacy.is_no_law(theta, reader.wide):
        phase = Phase.OPENING
    return LearnedFacts(
        is_disturbed,
        math.inf if is_other else float(theta[Parameter.LINE_PRESSURE_OFFSET]) * scale,
        untold * float(window.inputs[:, 0].mean()) * scale,
        explained.state.sensor_slope.share,
        sensor_lag(theta),
        float(theta[Parameter.LIFT_DELAY]) * LAG_UNIT,
        flow_change(theta, opened, explained.lead.reading.cost.setting.coefficients.sac),
        float(theta[Parameter.BULK_MODULUS]),
        reader.calibration.line,
        phase,
        reader.healthy.adequate,
    )


def look_alikes(facts: LearnedFacts) -> tuple[Objection, ...]:
    """Objections by look-alikes of wear; those that name a cause come first."""
    return tuple(_objections(LOOK_ALIKES, facts))


class EventVerdict(NamedTuple):
    """Objections to the state carried on, and to the event's own mass; change: that it showed, if any."""

    forward: tuple[Objection, ...]
    own: tuple[Objection, ...]
    change: Reason


def verdict_of(
    explained: ExplainedEvent, mass: EventMass, shares: Shares, contradictions: Sequence[Objection], wide: Theta
) -> EventVerdict:
    """Verdicts; contradictions: what no theta can hold; wide: standard deviations (m,) of the prior."""
    lead, learned, agree = explained.lead, explained.account.learned, 0.0
    against: dict[Reason, float] = {}
    for explanation, after in explained.explanations:
        agrees = explanation.is_good and abs(mass.moved(after.theta)) <= shares.agreement
        goes_on = 0.0 if explanation.is_good else 1.0 - kinds.STAYS[explanation.kind.mode]
        agree += explanation.weight * (agrees or goes_on)
        is_leading = explanation is lead and explanation.kind.reason is not None
        if not agrees or is_leading:
            reason = _reason_of(explanation, after.theta, wide)
            against[reason] = against.get(reason, 0.0) + explanation.weight
    most = (Objection(max(against, key=lambda reason: against[reason], default=Reason.OUTSIDE_LEARNED_RANGE)),)
    forward = own = tuple(contradictions)
    is_servo = lead.reading.cost.setting.coefficients.line.control_flow > 0.0  # its valve may be late, too
    is_first_by_commands = is_servo and explained.window.needle is not None and lead.before.is_prior
    if tempering(learned.statistics) == 1.0:  # the delay explains all of a late lift
        own = tuple(each for each in contradictions if each.reason is not Reason.LIFT_SENSOR_LAG)
    if agree < AGREED or not lead.is_good or lead.kind in kinds.UNLIKE_BEFORE:  # the next one is to confirm it
        forward += most
    if explained.fault_weight > 1.0 - AGREED:
        own += most
    elif SURELY * shares.total > WRONG or is_first_by_commands:
        own += most if agree < AGREED else (Objection(Reason.OUTSIDE_LEARNED_RANGE),)
    if _moved_in_time(explained) > 1.0 - AGREED:
        own += (Objection(Reason.TIME_BASE),)
    is_change = lead.is_good and lead.kind not in kinds.BELIEVED
    change = _reason_of(lead, learned.theta, wide) if is_change else Reason.NONE
    return EventVerdict(forward, own, change)


def _moved_in_time(explained: ExplainedEvent) -> float:
    """Probability that a needle by commands moves at other times than the belief has it, as with a late sensor.

    After the first event a small lag is as likely none, and a bounce that a lag could replace as likely a lag; a
    needle that does bounce differs at once.
    """
    learned, rival = explained.account.learned, explained.account.rival
    is_later = explained.window.needle is not None and not explained.lead.before.is_prior
    if is_later and 0.0 < learned.theta[Parameter.SENSOR_LAG] * LAG_UNIT < LEAST_LAG:
        return 1.0
    if rival is None:
        return 0.0
    if is_later and has_lag_for_bounce(rival.learned, learned):
        return 1.0
    delays = [Parameter.OPENING_DELAY, Parameter.CLOSING_DELAY]
    apart = np.abs(rival.learned.theta - learned.theta)[delays].max() * LAG_UNIT
    return 1.0 / (1.0 + math.exp(-rival.log_odds)) if apart > MOVED_IN_TIME else 0.0


def _reason_of(explanation: Explanation, theta: Theta, wide: Theta) -> Reason:
    """Reason of an event explained so, after which theta (m,) is believed."""
    if explanation.kind is kinds.SENSOR_CHANGED:
        moved = np.abs(theta - explanation.before.theta) / wide
        is_lag = moved[Parameter.SENSOR_LAG] > moved[Parameter.LINE_PRESSURE_OFFSET]
        return Reason.SENSOR_LAG if is_lag else Reason.PRESSURE_OFFSET
    return explanation.kind.reason or Reason.SUDDEN_CHANGE


def named(against: Sequence[Objection], explained: ExplainedEvent, reader: EventReader) -> tuple[Objection, ...]:
    """Objections to an event; those to one that is not explained with the phase in which that shows."""
    if not against:
        return ()
    leaves = reader.healthy.relative(explained.lead.reading.leaves(explained.lead.run))
    phase = adequacy.inadequate_phase(leaves, explained.window.needle is not None)
    return tuple(
        replace(each, phase=phase) if each.reason in UNEXPLAINED and each.phase is None else each for each in against
    )
