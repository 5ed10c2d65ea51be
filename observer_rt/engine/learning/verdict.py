"""Outcome of an event: its mass and how well that is known, the state carried on, the refusals and their reasons.

The mass is that by the event's own pressures: the mean over all that explains them. A change is reported, and refuses
nothing; what refuses is that nothing explains the event, or that its explanations leave the mass open. Look-alikes of
wear that theta cannot hold (the coil, sensors whose gains differ, an inertance) are each tested by themselves,
whatever the posterior says. What they are followed by moves only while events are explained.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.parameters import FLOWS, Parameter, Theta, learned_of, sensor_lag
from observer_rt.engine.estimation.phases import Phase, no_statistics
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning import adequacy, kinds
from observer_rt.engine.learning.account import Continued, ExplainedEvent, has_lag_for_bounce
from observer_rt.engine.learning.adequacy import Objection, tempering
from observer_rt.engine.learning.event import ClosedEvent, EventReader
from observer_rt.engine.learning.explanations import Explanation
from observer_rt.engine.learning.fit import LEAST_LAG, MOVED_IN_TIME
from observer_rt.engine.learning.kinds import Velocity
from observer_rt.engine.learning.knowledge import (
    Account,
    Adoption,
    Knowledge,
    LearnedInjector,
    LearningState,
    Outcome,
)
from observer_rt.engine.learning.mass import (
    HOLDS,
    UNSEEN,
    EventMass,
    extrapolation_sigma,
    known_flow,
    mass_of,
    nozzle_change,
    opening_points,
    resimulated,
    with_shots,
)
from observer_rt.engine.learning.noise import RestingNoise, resting_segments
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.units import Z_95
from observer_rt.model.effective import LAG_UNIT

OFTEN, CHANGES_REMEMBERED = 2.0, 0.9
AGREED = 0.95  # of the posterior; I
OWN_SHARE = 0.005  # of a mass, within which hypotheses agree whatever their interval; M
STROKE_SHARE = 0.0025  # of a mass, one sigma, that a needle moves unlike its model; M: on lines with waves
WRONG, SURELY = 0.03, 3.0  # of a mass, which the published one is not off by at so many standard deviations; P, I
LEAST_OF_MIXED = 0.25  # of the lead's own variance, that hypotheses between them leave at least; M
LEAST_PART = 0.005  # weight, below which a hypothesis is no part of an interval; I
AHEAD = 2.0  # events by which what is carried is ahead of what was learned: it is carried during the second; P

SHOWN = 0.005  # probability, below which nothing is said
UNEXPLAINED = (Reason.MODEL_INADEQUATE, Reason.CONTRADICTED)
# s, of the lift against the pressures, late or early, that x^ may do without: 1 % of a mass, some tenths of it.
LATEST_LIFT, EARLIEST_LIFT = 6e-6, -25e-6


class Shares(NamedTuple):
    """Standard deviations of a volume, as shares of it: by belief, inputs and model alone, and in all.

    moved: share by which the mean over all explanations is larger than the volume by the leading one.
    """

    from_belief: float
    total: float
    moved: float

    @property
    def remainder(self) -> float:
        """What belief, inputs and model do not explain."""
        return math.sqrt(max(self.total**2 - self.from_belief**2, 0.0))

    @property
    def agreement(self) -> float:
        """Share within which hypotheses agree on a mass."""
        return Z_95 * self.from_belief + OWN_SHARE


def shares_of(mass: EventMass, explained: ExplainedEvent, systematic: float) -> Shares:
    """How well the mass of an event is known.

    systematic: share that the model gets wrong of a healthy injector, or far from where it was learned.
    """
    by_belief = mass.variance(explained.account.learned.gated.covariance)
    by_stated = by_belief + mass.by_inputs + systematic**2
    moved, mixed = _between(mass, by_belief, explained)
    total = max(by_stated + mixed, LEAST_OF_MIXED * by_stated)
    return Shares(math.sqrt(by_stated), math.sqrt(total), moved)


def _between(mass: EventMass, by_belief: float, explained: ExplainedEvent) -> tuple[float, float]:
    """Share by which explanations have another mean than the leading one, and the variance they have beyond its."""
    good = [(each.weight, learned) for each, learned in explained.explanations if each.is_good]
    total = sum(weight for weight, _ in good)
    parts = [(weight / total, learned) for weight, learned in good if weight >= LEAST_PART * total]
    moves = [mass.moved_far(learned.theta) for _, learned in parts]
    mean = sum(weight * moved for (weight, _), moved in zip(parts, moves, strict=True))
    variance = 0.0
    for (weight, learned), moved in zip(parts, moves, strict=True):
        wider = mass.variance(learned.gated.covariance) - by_belief
        variance += weight * (wider + (moved - mean) ** 2)
    return mean, variance


class EventVerdict(NamedTuple):
    """Objections to the state carried on, and to the event's own mass; change: that it showed, if any."""

    forward: tuple[Objection, ...]
    own: tuple[Objection, ...]
    change: Reason


def posterior_of(continued: Sequence[Continued]) -> tuple[tuple[str, float], ...]:
    """Names of what an event may be, and their probabilities, the largest first."""
    summed: dict[str, float] = {}
    for explanation, _ in continued:
        summed[explanation.kind.name] = summed.get(explanation.kind.name, 0.0) + explanation.weight
    ordered = sorted(summed.items(), key=lambda each: -each[1])
    return tuple((name, weight) for name, weight in ordered if weight >= SHOWN)


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
    if tempering(learned.statistics) == 1.0:  # the delay explains all of a late lift
        own = tuple(each for each in contradictions if each.reason is not Reason.LIFT_SENSOR_LAG)
    if agree < AGREED or not lead.is_good or lead.kind in kinds.UNLIKE_BEFORE:  # the next one is to confirm it
        forward += most
    if explained.fault_weight > 1.0 - AGREED:
        own += most
    elif SURELY * shares.total > WRONG:
        own += most if agree < AGREED else (Objection(Reason.OUTSIDE_LEARNED_RANGE),)
    if _moved_in_time(explained) > 1.0 - AGREED:
        own += (Objection(Reason.TIME_BASE),)
    is_change = lead.is_good and lead.kind not in kinds.BELIEVED
    change = _reason_of(lead, learned.theta, wide) if is_change else Reason.NONE
    return EventVerdict(forward, own, change)


def _moved_in_time(explained: ExplainedEvent) -> float:
    """Probability that the needle, by commands, moves at other times than the belief has it: a late line sensor's.

    After the first event a small lag is as likely none, and a bounce that a lag could still replace is as likely a
    lag: a needle that does bounce differs from it at once.
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
    """Reason of an event that is what an explanation says, after which theta (m,) is believed."""
    if explanation.kind is kinds.SENSOR_CHANGED:
        moved = np.abs(theta - explanation.before.theta) / wide
        is_lag = moved[Parameter.SENSOR_LAG] > moved[Parameter.LINE_PRESSURE_OFFSET]
        return Reason.SENSOR_LAG if is_lag else Reason.PRESSURE_OFFSET
    return explanation.kind.reason or Reason.SUDDEN_CHANGE


def outcome_of(explained: ExplainedEvent, event: ClosedEvent, reader: EventReader) -> Outcome:
    """Outcome of an event that was explained. Raises numpy.linalg.LinAlgError when singular."""
    explanation, learned, velocity = explained.lead, explained.account.learned, explained.account.velocity
    setting = explanation.reading.cost.setting
    # before anything was learned the best explanation is carried, though it is not believed
    theta = explanation.theta if learned.is_prior else learned.theta
    covariance = learned.gated.covariance
    window, delays = explained.window, explanation.run.delays
    if delays is not None:
        window = window.with_jitter(delays.seconds(theta), setting.interval)
    again = resimulated(window, setting, explained.state.noise, theta, covariance)
    again = again if delays is None else with_shots(again, window, delays)
    mass = mass_of(window, setting, theta, again)
    look_alikes = look_alikes_in(explained, reader)
    systematic = math.hypot(
        reader.healthy.mass_share,
        UNSEEN * extrapolation_sigma(explained.point, explanation.before.learned_at),
        0.0 if window.needle is None else STROKE_SHARE,
    )
    shares = shares_of(mass, explained, systematic)
    verdict = verdict_of(explained, mass, shares, look_alikes.objections, reader.wide)
    state, forward = look_alikes.state, named(verdict.forward, explained, reader)
    if not look_alikes.begins_anew:
        changed = sum(each.weight for each, _ in explained.explanations if each.kind in kinds.UNLIKE_BEFORE)
        changes = CHANGES_REMEMBERED * state.changes + changed
        state = replace(state, account=explained.account, changes=changes)
    before = explanation.before
    if explanation.is_good:
        holds = abs(mass.moved_far(before.theta)) <= HOLDS
        openings = opening_points(explained.window, setting.interval)
        state = replace(state, elsewhere=state.elsewhere.after(holds, openings, before.learned_at))
    in_force = theta
    if explanation.kind is kinds.QUICK and velocity is not None:
        in_force = _ahead(theta, explanation, velocity, reader)
    by_coil = look_alikes.state.energizing.current.unsure
    covariance = covariance + _apart(explained, mass, shares.agreement) + by_coil
    again = replace(
        again,
        covariance=covariance,
        systematic=systematic,
        unknown=shares.remainder,
        moved=shares.moved,
        strokes=tuple(filter(None, window.strokes(learned_of(theta, setting.coefficients), setting))),
        calibration=reader.calibration.of_event(mass.controlled),
    )
    return Outcome(
        adoption=Adoption.REJECTED if np.array_equal(in_force, event.in_force) else Adoption.ADOPTED,
        knowledge=Knowledge(state, in_force),
        schedule=reader.gains(theta, state.noise, event.constants),
        forward=forward,
        objections=named(verdict.own, explained, reader),
        estimate=theta,
        covariance=covariance,
        resimulated=again,
        outliers=int(explained.window.masked.sum()) - int(explained.unmasked.masked.sum()),
        loudest=state.jitter.loudest(explained.window, explanation.reading.white_sigma),
        known_flow=known_flow(again, theta, covariance, explained.point, state.elsewhere),
        change=verdict.change,
        posterior=posterior_of(explained.explanations),
    )


def _apart(explained: ExplainedEvent, mass: EventMass, within: float) -> NDArray[np.float64]:
    """Covariance (m, m) by hypotheses that agree on the mass with another theta."""
    total = np.zeros((mass.theta.size, mass.theta.size))
    for explanation, learned in explained.explanations:
        away = learned.theta - mass.theta
        if explanation.is_good and abs(mass.moved(learned.theta)) <= within:
            total += explanation.weight * np.outer(away, away)
    return total


def _ahead(theta: Theta, explanation: Explanation, velocity: Velocity, reader: EventReader) -> Theta:
    """Theta (m,) to carry where wear moves on: ahead of what was learned, for it is carried later."""
    theta = theta.copy()
    theta[list(FLOWS)] += AHEAD * explanation.weight * velocity.mean
    return np.clip(theta, reader.limits.lowest, reader.limits.highest)


@dataclass(frozen=True, eq=False)
class LookAlikes:
    """Findings of one event beside its posterior.

    state: after it, but for the account; objections: whatever the posterior says; begins_anew: all that was believed
    was of other line pressures than those that come.
    """

    state: LearningState
    objections: tuple[adequacy.Objection, ...]
    begins_anew: bool


def look_alikes_in(explained: ExplainedEvent, reader: EventReader) -> LookAlikes:
    """Look-alikes in an event that was explained."""
    explanation, state = explained.lead, explained.state
    if not explanation.is_good or explanation.fit is None:
        return LookAlikes(state, (), begins_anew=False)
    if explained.fault_weight < 0.5:
        state = _followed(state, explained, explanation, reader)
    state, is_disturbed, begins_anew = _with_coil(state, explained, explanation, reader)
    objections = _objections(state, explained.window, explained.account.learned, is_disturbed, reader)
    return LookAlikes(state, objections, begins_anew)


def named(
    against: Sequence[adequacy.Objection], explained: ExplainedEvent, reader: EventReader
) -> tuple[adequacy.Objection, ...]:
    """Objections to an event, with phases."""
    return tuple(_with_phase(each, explained, reader) for each in against)


def _with_phase(objection: adequacy.Objection, explained: ExplainedEvent, reader: EventReader) -> adequacy.Objection:
    """An objection to an event that is not explained, with the phase in which that shows."""
    if objection.reason not in UNEXPLAINED or objection.phase is not None:
        return objection
    left = reader.healthy.relative(explained.lead.reading.leaves(explained.lead.run))
    return replace(objection, phase=adequacy.inadequate_phase(left))


def _followed(
    state: LearningState, explained: ExplainedEvent, explanation: Explanation, reader: EventReader
) -> LearningState:
    """Adds an explained event to the state that is followed."""
    sigma, first = explanation.reading.white_sigma, reader.burn_in
    segments = resting_segments(explained.window, first, reader.resting)
    overdispersion = state.overdispersion
    if explanation.score_as_believed is not None:
        overdispersion = overdispersion.after(explanation.score_as_believed)
    return replace(
        state,
        events=state.events + 1,
        overdispersion=overdispersion,
        jitter=state.jitter.after(explained.window, explanation.run.unfiltered, sigma, first),
        slow_rail=state.slow_rail.after([explained.window.inputs[part, 0] for part in segments], reader.interval),
    )


def _with_coil(
    state: LearningState, explained: ExplainedEvent, explanation: Explanation, reader: EventReader
) -> tuple[LearningState, bool, bool]:
    """Whether energizing the coil shows in an event that had all of it, and whether it is taken out from now on.

    Then what was learned so far was of other line pressures than those that come.
    """
    reading, white_sigma = explanation.reading, explanation.reading.white_sigma
    unaware = replace(reading.cost, offset=None)
    energizing, is_disturbed = state.energizing.after(
        explained.window._replace(output=explained.recorded.output),
        explanation.run,
        reading.cost.sigma * math.sqrt(reading.cost.temper),
        lambda window: replace(unaware, window=window, levels=explained.state.jitter.levels(window, white_sigma)),
        reader.wide,
        reader.interval,
        learned_of(explanation.theta, reading.cost.setting.coefficients).coefficients.line.control_flow > 0.0,
    )
    begins_anew = energizing.is_known and not state.energizing.is_known
    state = replace(state, energizing=energizing)
    if begins_anew:
        believed = explained.account.learned
        believed = replace(
            believed,
            belief=believed.belief.widened(reader.wide),
            statistics=no_statistics(),
            colour=None,
            at_rest=RestingNoise(),
        )
        state = replace(state, account=Account(believed))
    return state, is_disturbed, begins_anew


def _objections(
    state: LearningState, window: Window, learned: LearnedInjector, is_disturbed: bool, reader: EventReader
) -> tuple[adequacy.Objection, ...]:
    """Objections to an event, after which `learned` is believed; what names a cause first.

    Innovations that recent events leave alike, a little too loud or coloured, speak against the model together: in
    each by itself that is no more likely than noise, for an event at fault pays for its loudness anew.
    """
    theta = learned.theta
    reasons = [Reason.COIL_CURRENT] if is_disturbed else []
    offset = float(theta[Parameter.LINE_PRESSURE_OFFSET]) * reader.pressure_scale
    gain, untold = (float(theta[Parameter.LINE_PRESSURE_GAIN]), learned.belief.sigma[Parameter.LINE_PRESSURE_GAIN])
    pressure = float(window.inputs[:, 0].mean()) * reader.pressure_scale
    if abs(gain) > Z_95 * reader.calibration.gain > 0.0:
        offset = math.inf
    reasons += adequacy.sensor_objections(offset, sensor_lag(theta), untold * pressure)
    delay = float(theta[Parameter.LIFT_DELAY]) * LAG_UNIT
    if not EARLIEST_LIFT <= delay <= LATEST_LIFT:
        reasons.append(Reason.LIFT_SENSOR_LAG if delay > 0.0 else Reason.TIME_BASE)
    nozzle, stiffness = _open_nozzle_change(theta, window), float(theta[Parameter.BULK_MODULUS])
    if adequacy.looks_like_inertance(nozzle, stiffness, reader.calibration.line):
        reasons.append(Reason.AMBIGUOUS_SCALE)
    objections = tuple(adequacy.Objection(reason) for reason in reasons)
    phase = adequacy.inadequate_phase(learned.statistics)
    # of a needle that answers commands a lag is one with its delays
    if phase is None and window.needle is None and adequacy.is_no_law(theta, reader.wide):
        phase = Phase.OPENING
    if phase is not None or not reader.healthy.adequate:
        return (*objections, adequacy.Objection(Reason.MODEL_INADEQUATE, phase))
    return objections


def _open_nozzle_change(theta: Theta, window: Window) -> float:
    """N_H with the needle as open as it was in an event, at the steady sac pressure of the rail pressure."""
    widest = int(np.argmax(window.inputs[:, 1]))
    u = window.inputs[widest]
    return float(nozzle_change(theta, np.array([u[0], 0.0, 0.9 * u[0]]), u)[0])
