"""Learning between events: everything jointly, by prediction error, as a posterior over what an event may be.

The outcome of an event is its mass by its own pressures (the mean over all that explains them), how well that is
known, and the state carried on. Trackers of disturbances move only while events are explained.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from observer_rt.engine.estimation.parameters import FLOWS, Parameter, Theta, learned_of
from observer_rt.engine.estimation.phases import no_statistics
from observer_rt.engine.estimation.predictor import NoiseLevels, Window, gain_schedule
from observer_rt.engine.learning import kinds, knowledge, mass
from observer_rt.engine.learning.account import Continued, ExplainedEvent, explain
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.event import ClosedEvent, EventReader
from observer_rt.engine.learning.explanations import Explanation
from observer_rt.engine.learning.fit import theta_limits
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, LearnedInjector, LearningState, Outcome
from observer_rt.engine.learning.mass import EventMass, Shares
from observer_rt.engine.learning.noise import RestingNoise
from observer_rt.engine.learning.verdict import facts_of, first_objection, look_alikes, named, verdict_of
from observer_rt.engine.stream.standstill import Standstill, offset_between
from observer_rt.engine.stream.state import Constants, Reason
from observer_rt.foundation.units import Floats

STANDSTILL_ENOUGH = 1000  # samples, for the first guess of the offset
OTHER_NOISE = 1.25  # times a level
SCHEDULES = 6  # gains that are kept: those of all hypotheses
OFTEN, CHANGES_REMEMBERED = 2.0, 0.9
LEAST_OF_MIXED = 0.25  # of the lead's own variance, that hypotheses between them leave at least; M
LEAST_PART = 0.005  # weight, below which a hypothesis is no part of an interval; I
AHEAD = 2.0  # events by which what is carried is ahead of what was learned: it is carried during the second; P
SHOWN = 0.005  # probability, below which nothing is said


class Learner:
    """Learns event after event. Pure: no clock, no thread; the caller decides where it runs."""

    def __init__(self, constants: Constants, knowledge: Knowledge, healthy: Healthy = NOT_FITTED) -> None:
        """constants: at the start; healthy: innovations that the model leaves of a healthy injector."""
        gains_for = lru_cache(maxsize=SCHEDULES)(gain_schedule)
        c, interval, calibration = constants.coefficients, constants.interval, constants.calibration
        limits = theta_limits(c, constants.needle, healthy.shape is not None)
        self.reader = EventReader(interval, c.pressure_scale, limits, healthy, calibration, gains_for)
        self._constants = constants
        self.schedule = self.reader.gains(knowledge.in_force, knowledge.state.noise, constants)
        """Gains at the start."""
        state = knowledge.state.begun(constants.interval, healthy.overdispersion)
        self.state = state.map(lambda learned: learned.with_gain(constants.calibration.gain))
        """State after the last event."""

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Go on by one event, during which `in_force` (m,) was carried; constants: its own, None: as at the start.

        A bad event is refused at worst; one that cannot be read changes no more than noise levels and standstill.
        """
        outcome = self.explain(window, standstill, in_force, constants or self._constants)
        self.state = outcome.knowledge.state
        return outcome

    def explain(self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants) -> Outcome:
        """What `learn` would say of an event; nothing is learned from it."""
        event = ClosedEvent(window, standstill, in_force, constants)
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # refused for what it leads to
                return _learned(self.state, event, self.reader)
        except (ArithmeticError, ValueError):  # LinAlgError is one
            return _failed(self.state, event, Objection(Reason.NOT_LEARNED), self.reader)


def _learned(state: LearningState, event: ClosedEvent, reader: EventReader) -> Outcome:
    """Learn from one event. Raises ArithmeticError, ValueError by impossible numbers."""
    window, standstill = event.window, event.standstill
    if standstill.noise is not None:
        state = _with_noise(state, standstill.noise)
    state = replace(state, held_rail=state.held_rail.after(window, standstill, event.constants.rail_every))
    objection = first_objection(state, event, reader)
    if objection is not None:
        return _failed(state, event, objection, reader)
    offset = offset_between(state.standstill, standstill)
    if standstill.samples >= STANDSTILL_ENOUGH and state.learned.is_prior:
        state = state.map(lambda learned: _with_first_offset(learned, standstill.offset))
    state = replace(state, standstill=standstill)
    return outcome_of(explain(state, event, offset, reader), event, reader)


def _with_noise(state: LearningState, noise: NoiseLevels) -> LearningState:
    """Sets the noise levels from an event on; statistics by very different levels do not count on."""
    before = state.noise
    ratios = (noise.rail_pressure / before.rail_pressure, noise.line_pressure / before.line_pressure)
    if any(abs(math.log(ratio)) > math.log(OTHER_NOISE) for ratio in ratios):
        state = state.map(lambda learned: replace(learned, statistics=no_statistics()))
    return replace(state, noise=noise)


def _with_first_offset(learned: LearnedInjector, offset: float) -> LearnedInjector:
    """Where nothing was learned yet, the first event is explained from the offset at rest [p_0]."""
    mean, theta = learned.belief.mean.copy(), learned.theta.copy()
    mean[Parameter.LINE_PRESSURE_OFFSET] = theta[Parameter.LINE_PRESSURE_OFFSET] = offset
    return replace(learned, belief=replace(learned.belief, mean=mean), theta=theta)


def _failed(state: LearningState, event: ClosedEvent, objection: Objection, reader: EventReader) -> Outcome:
    return Outcome(
        adoption=Adoption.FAILED,
        knowledge=Knowledge(state, event.in_force),
        schedule=reader.gains(event.in_force, state.noise, event.constants),
        forward=(objection,),
        objections=(objection,),
        estimate=state.learned.theta,
        covariance=state.learned.gated.covariance,
    )


def shares_of(mass: EventMass, explained: ExplainedEvent, systematic: float) -> Shares:
    """How well a mass is known; systematic: share that the model gets wrong, as far from where it was learned."""
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


def posterior_of(continued: Sequence[Continued]) -> tuple[tuple[str, float], ...]:
    """Names of what an event may be, and their probabilities, the largest first."""
    summed: dict[str, float] = {}
    for explanation, _ in continued:
        summed[explanation.kind.name] = summed.get(explanation.kind.name, 0.0) + explanation.weight
    ordered = sorted(summed.items(), key=lambda each: -each[1])
    return tuple((name, weight) for name, weight in ordered if weight >= SHOWN)


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
    again = mass.resimulated(window, setting, explained.state.noise, theta, covariance)
    again = again if delays is None else mass.with_shots(again, window, delays)
    event_mass = mass.mass_of(window, setting, theta, again)
    unlike = look_alikes_in(explained, reader)
    systematic = math.hypot(
        reader.healthy.mass_share,
        mass.UNSEEN * mass.extrapolation_sigma(explained.point, explanation.before.learned_at),
        explained.state.sensor_slope.share,
    )
    shares = shares_of(event_mass, explained, systematic)
    verdict = verdict_of(explained, event_mass, shares, unlike.objections, reader.wide)
    state, forward = unlike.state, named(verdict.forward, explained, reader)
    if not unlike.begins_anew:
        changed = sum(each.weight for each, _ in explained.explanations if each.kind in kinds.UNLIKE_BEFORE)
        state = replace(state, account=explained.account, changes=CHANGES_REMEMBERED * state.changes + changed)
    before = explanation.before
    if explanation.is_good:
        holds = abs(event_mass.moved_far(before.theta)) <= mass.HOLDS
        openings = mass.opening_points(explained.window, setting.interval)
        elsewhere = state.elsewhere.after(holds, openings, before.learned_at)
        if before.learned_at and explanation.kind not in kinds.UNLIKE_BEFORE:
            elsewhere = elsewhere.with_flow(mass.flow_off(again, before.theta - theta))
        state = replace(state, elsewhere=elsewhere)
    in_force = theta
    if explanation.kind is kinds.QUICK and velocity is not None:
        in_force = _ahead(theta, explanation, velocity, reader)
    covariance = covariance + _apart(explained, event_mass, shares.agreement) + unlike.state.energizing.current.unsure
    again = replace(
        again,
        covariance=covariance,
        systematic=systematic,
        unknown=shares.remainder,
        moved=shares.moved,
        strokes=tuple(filter(None, window.strokes(learned_of(theta, setting.coefficients), setting))),
        calibration=reader.calibration.of_event(event_mass.controlled),
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
        known_flow=mass.known_flow(again, theta, covariance, explained.point, state.elsewhere),
        change=verdict.change,
        posterior=posterior_of(explained.explanations),
    )


def _apart(explained: ExplainedEvent, mass: EventMass, within: float) -> Floats:
    """Covariance (m, m) by hypotheses that agree on the mass with another theta."""
    total = np.zeros((mass.theta.size, mass.theta.size))
    for explanation, learned in explained.explanations:
        away = learned.theta - mass.theta
        if explanation.is_good and abs(mass.moved(learned.theta)) <= within:
            total += explanation.weight * np.outer(away, away)
    return total


def _ahead(theta: Theta, explanation: Explanation, velocity: kinds.Velocity, reader: EventReader) -> Theta:
    """Theta (m,) to carry where wear moves on: ahead of the theta learned, for it is carried later."""
    theta = theta.copy()
    theta[list(FLOWS)] += AHEAD * explanation.weight * velocity.mean
    return np.clip(theta, reader.limits.lowest, reader.limits.highest)


class LookAlikes(NamedTuple):
    """Findings of one event beside its posterior."""

    state: LearningState  # after it, but for the account
    objections: tuple[Objection, ...]  # whatever the posterior says
    begins_anew: bool  # all that was believed was of other line pressures than those that come


def look_alikes_in(explained: ExplainedEvent, reader: EventReader) -> LookAlikes:
    """Look-alikes in an event that was explained."""
    state = explained.state
    if not explained.lead.is_good or explained.lead.fit is None:
        return LookAlikes(state, (), begins_anew=False)
    if explained.fault_weight < 0.5:
        overdispersion, score = state.overdispersion, explained.lead.score_as_believed
        if score is not None:
            overdispersion = overdispersion.after(score)
        state = replace(state, events=state.events + 1, overdispersion=overdispersion)
    state, is_disturbed, begins_anew = _with_coil(state, explained, reader)
    return LookAlikes(state, look_alikes(facts_of(explained, is_disturbed, reader)), begins_anew)


def _with_coil(
    state: LearningState, explained: ExplainedEvent, reader: EventReader
) -> tuple[LearningState, bool, bool]:
    """State after an event; True if the coil's pulse shows in it; True if learning begins anew without it."""
    explanation, reading = explained.lead, explained.lead.reading
    energizing, is_disturbed = state.energizing.after(
        explained.window._replace(output=explained.recorded.output),
        explanation.run,
        reading.cost.sigma * math.sqrt(reading.cost.temper),
        replace(reading.cost, offset=None),
        reader.wide,
        reader.interval,
        learned_of(explanation.theta, reading.cost.setting.coefficients).coefficients.line.control_flow > 0.0,
    )
    begins_anew = energizing.is_known and not state.energizing.is_known
    state = replace(state, energizing=energizing)
    if begins_anew:
        learned = explained.account.learned
        belief, at_rest = learned.belief.widened(reader.wide), RestingNoise()
        learned = replace(learned, belief=belief, statistics=no_statistics(), colour=None, at_rest=at_rest)
        state = replace(state, account=knowledge.Account(learned))
    return state, is_disturbed, begins_anew
