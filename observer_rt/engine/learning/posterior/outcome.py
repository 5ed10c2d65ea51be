"""What follows from an explained event: the state carried on, how well its mass is known, and the objections."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.account import constants as c
from observer_rt.engine.learning.account.account import Account, MassDoubt
from observer_rt.engine.learning.account.hypotheses import BELIEVED, QUICK, SETTLED
from observer_rt.engine.learning.account.velocity import FLOWS, Velocity
from observer_rt.engine.learning.interval import resimulated
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.engine.learning.learned_range import UNSEEN, extrapolation_sigma, known_flow
from observer_rt.engine.learning.posterior.believing import settled_after
from observer_rt.engine.learning.posterior.event import ExplainedEvent
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.look_alikes import look_alikes_in, named
from observer_rt.engine.learning.posterior.masses import EventMass, mass_of, shares_of
from observer_rt.engine.learning.posterior.reader import ClosedEvent, EventReader
from observer_rt.engine.learning.posterior.verdict import posterior_of, verdict_of


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
        prior=explanation.prior if explanation.is_good else None,
        window=explained.window,
        setting=setting,
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
