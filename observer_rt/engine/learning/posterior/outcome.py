"""What follows from an explained event: verdicts, the state carried on, how well its mass is known, the objections.

The event that showed a change was published with what was believed before and is refused; the next one is not.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.scalars import Parameter, Theta
from observer_rt.engine.learning.account import constants as c
from observer_rt.engine.learning.account.account import Account, MassDoubt
from observer_rt.engine.learning.account.hypotheses import (
    BELIEVED,
    FLOWS,
    QUICK,
    SENSOR_CHANGED,
    SETTLED,
    STAYS,
    Velocity,
)
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.interval import resimulated
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.engine.learning.learned_range import UNSEEN, extrapolation_sigma, known_flow
from observer_rt.engine.learning.posterior.believing import Continued, settled_after
from observer_rt.engine.learning.posterior.event import ExplainedEvent
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.look_alikes import look_alikes_in, named
from observer_rt.engine.learning.posterior.masses import EventMass, Shares, mass_of, shares_of
from observer_rt.engine.learning.posterior.reader import ClosedEvent, EventReader
from observer_rt.engine.stream.state import Reason

SHOWN = 0.005  # probability, below which nothing is said


class EventVerdict(NamedTuple):
    """Objections to the state carried on, and to the event's own published mass; change: that it showed, if any."""

    forward: tuple[Objection, ...]
    own: tuple[Objection, ...]
    change: Reason


def posterior_of(continued: Sequence[Continued]) -> tuple[tuple[str, float], ...]:
    """Names of what an event may be, and their probabilities, the largest first."""
    summed: dict[str, float] = {}
    for explanation, _ in continued:
        summed[explanation.kind.name] = summed.get(explanation.kind.name, 0.0) + explanation.weight
    named = sorted(summed.items(), key=lambda each: -each[1])
    return tuple((name, weight) for name, weight in named if weight >= SHOWN)


def verdict_of(
    explained: ExplainedEvent,
    mass: EventMass,
    shares: Shares,
    in_force: Theta,
    contradictions: Sequence[Objection],
    wide: Theta,
) -> EventVerdict:
    """Verdicts; in_force (m,): that the mass was published with; wide: standard deviations (m,) of the prior.

    contradictions: what no theta can hold.
    """
    lead = explained.carried[0]
    is_right = abs(mass.moved_far(in_force)) + c.SURELY * shares.total <= c.WRONG
    agree = own = 0.0
    against: dict[Reason, float] = {}
    for explanation, hypothesis in explained.explanations:
        moved = mass.moved(hypothesis.learned.theta)
        agrees = explanation.is_good and abs(moved) <= shares.agreement
        goes_on = 0.0 if explanation.is_good else 1.0 - STAYS[explanation.kind.mode]
        agree += explanation.weight * (agrees or goes_on)
        own += explanation.weight * (agrees and is_right)
        is_leading = explanation is lead[0] and explanation.kind.reason is not None
        if not agrees or is_leading:
            reason = _reason_of(explanation, hypothesis.learned.theta, wide)
            against[reason] = against.get(reason, 0.0) + explanation.weight
    most = max(against, key=lambda reason: against[reason], default=Reason.SUDDEN_CHANGE)
    forward = tuple(contradictions)
    if agree < c.AGREED or not lead[0].is_good:
        forward += (Objection(most),)
    is_change = lead[0].is_good and lead[0].kind not in BELIEVED
    change = _reason_of(lead[0], lead[1].learned.theta, wide) if is_change else Reason.NONE
    return EventVerdict(forward, forward or _own_objections(own, against, shares), change)


def _own_objections(own: float, against: Mapping[Reason, float], shares: Shares) -> tuple[Objection, ...]:
    """Objections to a published mass that hypotheses of a weight `own` find right."""
    if own >= c.AGREED:
        return ()
    reason, weight = max(against.items(), key=lambda each: each[1], default=(Reason.NONE, 0.0))
    if 2.0 * weight > 1.0 - own:
        return (Objection(reason),)
    if c.SURELY * shares.from_belief > c.WRONG:
        return (Objection(Reason.OUTSIDE_LEARNED_RANGE),)
    return (Objection(Reason.MODEL_INADEQUATE if c.SURELY * shares.total > c.WRONG else Reason.REVISED),)


def _reason_of(explanation: Explanation, theta: Theta, wide: Theta) -> Reason:
    """Reason of an event that is what an explanation says, after which theta (m,) is believed."""
    if explanation.kind is SENSOR_CHANGED:
        moved = np.abs(theta - explanation.hypothesis.learned.theta) / wide
        is_lag = moved[Parameter.SENSOR_LAG] > moved[Parameter.LINE_PRESSURE_OFFSET]
        return Reason.SENSOR_LAG if is_lag else Reason.PRESSURE_OFFSET
    return explanation.kind.reason or Reason.SUDDEN_CHANGE


def outcome_of(explained: ExplainedEvent, event: ClosedEvent, reader: EventReader) -> Outcome:
    """Outcome of an event that was explained. Raises numpy.linalg.LinAlgError when singular."""
    explanation, lead = explained.carried[0]
    learned, setting = lead.learned, explanation.reading.follows.setting
    # before anything was learned the best explanation is carried, though it is not believed
    theta = explanation.theta if learned.is_prior else learned.theta
    covariance = learned.gated.covariance
    again = resimulated(explained.window, setting, explained.state.noise, theta, covariance, covariance)
    mass = mass_of(explained.window, setting, theta, again)
    look_alikes = look_alikes_in(explained, again, reader)
    account = explained.state.account
    if explanation.is_good:
        account = _compared(account, explained, mass, reader)
    systematic = math.hypot(
        reader.healthy.mass_share,
        UNSEEN * extrapolation_sigma(explained.point, explanation.hypothesis.learned.learned_at),
    )
    shares = shares_of(mass, account, explained, systematic)
    verdict = verdict_of(explained, mass, shares, event.in_force, look_alikes.objections, reader.wide)
    state, forward = named(look_alikes.state, verdict.forward, look_alikes.is_ending, explained, reader)
    if not look_alikes.begins_anew:
        account = settled_after(account, learned, explanation.kind in BELIEVED and not forward)
        state = replace(
            state, account=replace(account, hypotheses=tuple(one for _, one in explained.carried))
        )
    in_force = theta if lead.velocity is None else _ahead(theta, explanation, lead.velocity, reader)
    by_coil = look_alikes.state.energizing.current.unsure
    covariance = covariance + _apart(explained, mass, shares.agreement) + by_coil
    again = replace(
        again,
        covariance=covariance,
        carried_covariance=learned.gated.carried(event.in_force) + by_coil,
        systematic=math.hypot(systematic, state.lag_doubt.volume_share),
        unknown=shares.remainder,
        calibration=reader.calibration.of_event(mass.controlled),
    )
    return Outcome(
        adoption=Adoption.REJECTED if np.array_equal(in_force, event.in_force) else Adoption.ADOPTED,
        knowledge=Knowledge(state, in_force),
        schedule=reader.gains(theta, state.noise, event.constants),
        forward=forward,
        objections=forward or verdict.own,
        estimate=theta,
        covariance=covariance + np.diag(state.lag_doubt.variance),
        resimulated=again,
        outliers=int(explained.window.masked.sum()) - int(explained.unmasked.masked.sum()),
        loudest=state.jitter.loudest(explained.window, explanation.reading.follows.sigmas.innovation),
        known_flow=known_flow(again, theta, covariance, explained.point),
        change=verdict.change,
        posterior=posterior_of(explained.explanations),
    )


def _compared(account: Account, explained: ExplainedEvent, mass: EventMass, reader: EventReader) -> Account:
    """Account after an explained event was compared with what was believed and carried before it.

    One that is as when settled is compared with nothing: the doubt of what came after is forgotten, too.
    """
    (explanation, _), carried, point = explained.carried[0], account.lead, explained.point
    doubt = account.settled_doubt if explanation.kind is SETTLED else account.doubt
    unexplained = doubt.unexplained.after(explained.window, mass.setting, mass.theta, reader.burn_in)
    wander, scatter = doubt.wander.at(point), doubt.scatter
    if explanation.kind in BELIEVED and explanation.kind is not SETTLED and not carried.learned.is_prior:
        theta = carried.learned.theta.copy()
        if carried.velocity is not None:
            theta[list(FLOWS)] += carried.velocity.mean
        belief = carried.learned.gated.belief.drifted(reader.drift)
        if explanation.kind is QUICK:
            belief = belief.widened(reader.widths(QUICK))
        variance = mass.variance(replace(carried.learned.gated, belief=belief).covariance)
        wander = doubt.wander.after(1.0 / mass.ratio(theta) - 1.0, variance, point)
    if explanation.score_as_believed is not None:
        scatter = scatter.after(explanation.score_as_believed)
    return replace(account, doubt=MassDoubt(wander, unexplained, scatter))


def _apart(explained: ExplainedEvent, mass: EventMass, within: float) -> NDArray[np.float64]:
    """Covariance (m, m) by hypotheses that agree on the mass with another theta."""
    total = np.zeros((mass.theta.size, mass.theta.size))
    for explanation, belief in explained.explanations:
        away = belief.learned.theta - mass.theta
        if explanation.is_good and abs(mass.moved(belief.learned.theta)) <= within:
            total += explanation.weight * np.outer(away, away)
    return total


def _ahead(theta: Theta, explanation: Explanation, velocity: Velocity, reader: EventReader) -> Theta:
    """Theta (m,) to carry where wear moves on: ahead of what was learned, for it is carried later."""
    theta = theta.copy()
    theta[list(FLOWS)] += c.AHEAD * explanation.weight * velocity.mean
    return np.clip(theta, reader.limits.lowest, reader.limits.highest)
