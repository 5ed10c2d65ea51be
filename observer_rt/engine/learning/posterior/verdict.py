"""Verdicts on an event, from the posterior: on the state carried into the next one, and on its own published mass.

The event that showed a change was published with what was believed before and is refused; the next one is not.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from observer_rt.engine.estimation.scalars import Parameter, Theta
from observer_rt.engine.learning.account import constants as c
from observer_rt.engine.learning.account.hypotheses import BELIEVED, SENSOR_CHANGED, STAYS
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.posterior.believing import Continued
from observer_rt.engine.learning.posterior.event import ExplainedEvent
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.masses import EventMass, Shares
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
