"""Explanations of an event, as each kind that it may be, and their weights."""

import math
from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np

from observer_rt.engine.estimation import scales
from observer_rt.engine.estimation.belief import Belief, HeldBelief
from observer_rt.engine.estimation.parameters import PARAMETERS, WEIGHTS, Parameter, Theta
from observer_rt.engine.estimation.scales import Pairs, ScaleChoice
from observer_rt.engine.learning import kinds
from observer_rt.engine.learning.adequacy import is_worn_beyond_limits
from observer_rt.engine.learning.event import EventReader, EventReading
from observer_rt.engine.learning.fit import BEYOND, EventFitter, Fit, Limits, evidence_of, nearly_white
from observer_rt.engine.learning.kinds import BEFORE, FILED, QUICK, Drift, Kind, Mode, drift_of, transitions
from observer_rt.engine.learning.knowledge import Account, LearnedInjector
from observer_rt.engine.learning.run import EventRun
from observer_rt.foundation.units import Floats
from observer_rt.model.effective import LAG_UNIT

LIFT_DELAYS = (-60e-6, -40e-6, -20e-6, 20e-6, 40e-6, 60e-6)  # s, at which a fit of the lift's delay may begin; M
OPENING_DELAYS, CLOSING_DELAYS = (-70e-6, 0.0, 70e-6), (-120e-6, 0.0, 120e-6)  # s, of a needle by commands; M
LINE_SENSOR_LAG = 40e-6  # s, at which a fit of a late line sensor begins; M
NEAR = 0.1  # of the longest step, within which a linearisation is shared; M
FALLS, FALLS_FAR = 20.0, 100.0  # nats by which the cost falls: a fit is needed, and one of many steps; M
REFINED = 12.0  # nats behind the best, from which on nothing is looked at: 6e-6 of its weight; I
LEFT_ALIKE = 1.0  # nats of the cost, within which two fits leave the same innovations; I
FALL_COUNTS = 0.42  # of the fall, by which the closed form may be wrong: .41 at a nozzle that jumped by 43 %; M
SCALE_FITS = 3  # of an explanation, each at the scale of the weights that the one before makes the likeliest; M
FIRST_STEPS, STEPS = 8, 2  # Gauss-Newton iterations: of a fit from far, and of one from near

NEEDLE_STARTS, LATE_STARTS = np.zeros((9, PARAMETERS)), np.zeros((len(LIFT_DELAYS), PARAMETERS))
NEEDLE_STARTS[:, [Parameter.OPENING_DELAY, Parameter.CLOSING_DELAY]] = [*product(OPENING_DELAYS, CLOSING_DELAYS)]
LATE_STARTS[:, Parameter.LIFT_DELAY] = LIFT_DELAYS
LATE_SENSOR = NEEDLE_STARTS[::4] / LAG_UNIT
LATE_SENSOR[:, Parameter.SENSOR_LAG] = LINE_SENSOR_LAG / LAG_UNIT
"""Moves of theta (k, m) at which a needle may be sought whose line sensor is late."""
STARTED = {kinds.LIFT_LATE: LATE_STARTS / LAG_UNIT, kinds.NEEDLE_CHANGED: NEEDLE_STARTS / LAG_UNIT}
"""Moves of theta (k, m) from which a kind may be sought, for delays have several minima."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """Explanation of an event as one kind: the prior, and the theta that explains it best.

    before: belief before the event; log_weight: logarithm of its weight; weight: normalised over all explanations;
    held: the prior, with the gain as the samples at rest say; scales: likeliest of the network's weights; cost: run
    whose parabola gave theta (m,); fit: None where theta was not fitted; drift: of wear that moves on, if it does.
    """

    before: LearnedInjector
    kind: Kind
    log_weight: float
    reading: EventReading
    prior: Belief
    held: HeldBelief
    scales: ScaleChoice
    cost: EventRun
    theta: Theta
    fit: Fit | None
    drift: Drift | None
    weight: float = 0.0

    @property
    def is_good(self) -> bool:
        return self.kind.mode.is_good

    @cached_property
    def run(self) -> EventRun:
        """The event run with theta, to first order where that was not fitted."""
        return _run_at(self.reading, self.theta, self.fit)

    @cached_property
    def score_as_believed(self) -> float | None:
        """Score of the event before the fit; None if its kind is a change, or nothing was learned before."""
        if self.kind not in kinds.BELIEVED or self.before.is_prior:
            return None
        return self.reading.first.score(self.held.prior.covariance)

    def fitted(self, reader: EventReader) -> "Explanation":
        if self.fit is not None:
            return self
        likeliest = self.scales.of(self.held.prior)
        fit = fitter_of(self.before, self.reading, reader).fit(self.cost, likeliest, STEPS)
        return replace(self, fit=fit, cost=fit.run, theta=fit.run.theta)


def _run_at(reading: EventReading, theta: Theta, fit: Fit | None) -> EventRun:
    return reading.first.to_first_order(theta) if fit is None else fit.run


@dataclass(eq=False)
class _KindEvidence:
    """Evidence of a kind: logarithm, theta, cost there, and a fit if the closed form is not good enough.

    prior: to learn from; held: without pairs not in use; part: of it, in the columns in use; scale_log_priors: log
    priors of the scales over what `held` says; scales: the likeliest after the event.
    """

    prior: Belief
    held: HeldBelief
    part: Belief
    pairs: Pairs
    scale_log_priors: Floats
    log: float = field(init=False)
    cost: EventRun = field(init=False)
    scales: ScaleChoice = field(init=False)
    theta: Theta = field(init=False)
    fit: Fit | None = None

    @property
    def falls(self) -> float:
        """Nats by which the parabola promises that the cost falls."""
        return self.cost.value - self.cost.expected(self.theta)

    def weigh(self, cost: EventRun, limits: Limits) -> None:
        """Evidence by the parabola of a run, over all scales."""
        centred = cost.centred(self.held.held_in(cost.theta))  # else its prior seems to be far from every theta
        by_whole = evidence_of(centred, self.part, limits, scales.columns_in_use(self.pairs))
        logs, self.theta = scales.weigh_choices(*by_whole[1:], self.pairs, self.scale_log_priors)
        self.cost, self.scales = cost, ScaleChoice(int(np.argmax(logs)), self.pairs)
        self.log = by_whole.log + self.held.log + scales.log_sum(logs)

    def refine(self, fitter: EventFitter, start: EventRun, steps: int) -> None:
        """Fit the kind at its likeliest scales, and again if others are; unconfirmed falls count `BEYOND` at most."""
        for _ in range(SCALE_FITS):
            likeliest = self.scales
            self.fit = fitter.fit(start, likeliest.of(self.held.prior), steps)
            start = self.fit.run
            self.weigh(start, fitter.limits)
            if self.scales == likeliest or self.fit.stuck:
                break
        self.log -= max(self.falls - BEYOND, 0.0)
        self.theta = self.cost.theta


def fitter_of(before: LearnedInjector, reading: EventReading, reader: EventReader) -> EventFitter:
    """The fitter of an event that starts from a belief."""
    return EventFitter(
        reading.cost, before.active, reader.limits, scales.other_columns(scales.pairs_in_use(before.belief))
    )


class OfferedKinds:
    """The kinds that an account offers for an event, each with its evidence, and fits of those that may matter."""

    def __init__(self, account: Account, reading: EventReading, reader: EventReader) -> None:
        self._learned, self._reading, self._reader = account.learned, reading, reader
        offers: dict[Kind, float] = {}
        for mode, weight in account.modes.items():
            for kind, rate in transitions(mode, account.learned.is_prior, reading.window.needle is None):
                offers[kind] = offers.get(kind, 0.0) + weight * rate
        self._logs = {kind: math.log(probability) + account.log_odds for kind, probability in offers.items()}
        self._drift, priors = self._priors(account)
        self._evidence = self._weighed(priors)

    @property
    def best(self) -> float:
        """Logarithm of the weight of the likeliest; -inf without any."""
        return max((self._log_of(kind) for kind in self._evidence), default=-math.inf)

    def refine(self, best: float) -> None:
        """Fit the kinds that may matter, the likeliest first; best: logarithm of the best weight so far.

        After each fit the kinds that are left are weighed by its linearisation, too, if it ended at a minimum.
        """
        left = list(self._evidence)
        while left:
            kind = max(left, key=lambda kind: (kind is BEFORE, kind not in STARTED, self._log_of(kind)))
            left.remove(kind)
            evidence, is_new = self._evidence[kind], self._learned.is_prior
            if kind in STARTED:  # after the kinds that look like it
                is_new = self._start(evidence, STARTED[kind]) or is_new
            self._fit(evidence, math.inf if is_new else self._log_of(kind) - max(best, self.best))
            if evidence.fit is not None and not evidence.fit.stuck:
                for other in left:
                    if other is not kinds.SHIFTED:  # what is little shows from where nothing has changed
                        nearer = copy(self._evidence[other])
                        nearer.weigh(evidence.cost, self._reader.limits)
                        self._evidence[other] = max(self._evidence[other], nearer, key=lambda each: each.log)

    def explanations(self, best: float) -> Iterator[Explanation]:
        """Explanations by all kinds that are not far behind the best weight, whose logarithm is given."""
        logs, before = dict[Kind, float](), self._evidence[BEFORE]
        for kind, evidence in self._evidence.items():
            if self._log_of(kind) > best - REFINED:
                logs[kind] = evidence.log + self._nearly_white(evidence)
        if logs and kinds.AT_FAULT in self._logs:  # the cost of its theta is part of it
            at_fault = before.log + before.cost.expected(before.theta)
            at_fault -= self._reading.at_fault(_run_at(self._reading, before.theta, before.fit))
            logs |= dict.fromkeys((kinds.AT_FAULT, kinds.INADEQUATE), at_fault)
        for kind, log in logs.items():
            evidence = self._evidence.get(kind, before)
            if not (kind.mode.is_good and is_worn_beyond_limits(evidence.theta)):
                yield Explanation(
                    self._learned,
                    kind,
                    self._logs[kind] - self._reading.level + log,
                    self._reading,
                    evidence.prior,
                    self._to_learn_from(kind, evidence),
                    evidence.scales,
                    evidence.cost,
                    evidence.theta,
                    evidence.fit,
                    self._drift if kind is QUICK else None,
                )

    def _log_of(self, kind: Kind) -> float:
        return self._logs[kind] - self._reading.level + self._evidence[kind].log

    def _priors(self, account: Account) -> tuple[Drift | None, Mapping[Kind, Belief]]:
        """Drift of the wear, None where it does not move on, and the belief before the event by kind."""
        learned, reader = self._learned, self._reader
        before = learned.belief.drifted(reader.drift)
        if learned.is_prior:
            before = before.narrowed(kinds.STATED, FILED)
        priors = {kind: self._widened(before, kind) for kind in self._logs if kind.mode.is_good}
        if QUICK not in priors:
            return None, priors
        goes_on = account.modes.get(Mode.QUICK, 0.0) * kinds.STAYS[Mode.QUICK] / math.exp(self._logs[QUICK])
        drift = drift_of(priors[QUICK], reader.drift, account.velocity, min(goes_on, 1.0))
        return drift, priors | {QUICK: drift.belief}

    def _weighed(self, priors: Mapping[Kind, Belief]) -> dict[Kind, _KindEvidence]:
        """Evidence of each kind with its prior, by the first linearisation of the cost."""
        belief, evidence = self._learned.belief, dict[Kind, _KindEvidence]()
        pairs = scales.pairs_in_use(belief)
        columns, likely = scales.columns_in_use(pairs), scales.choices_by(belief, pairs)
        likely -= scales.log_sum(likely)
        before = scales.without_others(priors[BEFORE], pairs)
        for kind, prior in priors.items():
            keeps_laws = WEIGHTS[0] not in kind.columns  # its prior of the weights is that of the first kind
            is_wider = keeps_laws and kind is not QUICK  # and nothing else
            in_use = self._widened(before, kind) if is_wider else scales.without_others(prior, pairs)
            held = self._reading.resting.held(in_use)
            part = held.prior.part(columns)
            if evidence and held.column is None and keeps_laws:
                log_priors = evidence[BEFORE].scale_log_priors
            else:
                log_priors = likely - scales.weigh_choices(part.mean, part.covariance, pairs)[0]
            evidence[kind] = _KindEvidence(prior, held, part, pairs, log_priors)
            evidence[kind].weigh(self._reading.first, self._reader.limits)
        return evidence

    def _to_learn_from(self, kind: Kind, evidence: _KindEvidence) -> HeldBelief:
        """The prior to learn from: the first event is explained as the files say, and teaches all of theta."""
        is_first, belief = self._learned.is_prior, self._learned.belief
        return self._reading.resting.held(self._widened(belief, kind) if is_first else evidence.prior)

    def _widened(self, belief: Belief, kind: Kind) -> Belief:
        return belief.widened(self._reader.widths(kind)) if kind.columns else belief

    def _start(self, evidence: _KindEvidence, moves: Theta) -> bool:
        """Linearise a kind at the best of theta moved by `moves` (k, m) if much falls; True if that was done."""
        first, cost = self._reading.first, self._reading.cost
        is_far = first.value - evidence.cost.expected(evidence.theta) > FALLS_FAR
        if not (is_far or self._learned.is_prior):
            return False
        values = [cost.at(first.theta + move, first).value for move in moves]
        best = int(np.argmin(values))
        if values[best] >= first.value:
            return False
        evidence.weigh(cost.linearised(first.theta + moves[best], first), self._reader.limits)
        return True

    def _nearly_white(self, evidence: _KindEvidence) -> float:
        """Nats that a kind gains by nearly white innovations, those of `BEFORE` if both explain the event alike."""
        before, reading = self._evidence[BEFORE], self._reading
        leaves, as_before = (each.cost.expected(each.theta) for each in (evidence, before))
        alike = before if abs(leaves - as_before) < LEFT_ALIKE else evidence
        left = reading.leaves(_run_at(reading, alike.theta, alike.fit))
        return nearly_white(left, reading.cost.temper, self._reader.healthy)

    def _fit(self, evidence: _KindEvidence, behind: float) -> None:
        """Fit a kind if it may matter and its closed form is too coarse; behind: nats to the best one."""
        first, is_new, falls = evidence.cost, self._learned.is_prior, evidence.falls
        if behind <= -REFINED - FALL_COUNTS * max(falls, 0.0):
            return
        far = float((np.abs(evidence.theta - first.theta) / self._reader.limits.longest_step).max())
        if not (far > NEAR or falls > FALLS or is_new):
            return
        steps = FIRST_STEPS if far > 1.0 or falls > FALLS_FAR or is_new else STEPS
        evidence.refine(fitter_of(self._learned, self._reading, self._reader), first, steps)
