"""Beliefs after an event, given its explanation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import best_subset
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.account import constants as c
from observer_rt.engine.learning.account.account import Account
from observer_rt.engine.learning.account.hypotheses import Mode, Possibility, is_alike, is_compatible
from observer_rt.engine.learning.adequacy import pooled
from observer_rt.engine.learning.disturbances.colour import Colour, RestingNoise, is_same, resting_segments
from observer_rt.engine.learning.knowledge import LearningState
from observer_rt.engine.learning.learned_injector import LearnedInjector, shrink
from observer_rt.engine.learning.learned_range import EventPoint, remembered
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.reader import EventReader, Follows


class Noise(NamedTuple):
    """Noise while the needle is shut, and its colour."""

    at_rest: RestingNoise
    colour: Colour | None


Continued = tuple[Explanation, Possibility]
"""An explanation of an event, and the hypothesis that goes on from it."""


@dataclass(frozen=True, eq=False)
class Believing:
    """Learns from one event; state: before it, point: of the event."""

    reader: EventReader
    state: LearningState
    point: EventPoint
    _noises: dict[tuple[int, int], Noise] = field(default_factory=dict)

    def after(self, explanation: Explanation) -> Possibility:
        """The hypothesis that goes on from an explanation. Raises numpy.linalg.LinAlgError when singular."""
        hypothesis, kind = explanation.hypothesis, explanation.kind
        log_weight = math.log(explanation.weight)
        if kind.mode.is_good:
            learned = self._learned(explanation)
            velocity = None if explanation.moving is None else explanation.moving.after(learned.belief)
            return Possibility(log_weight, learned, kind.mode, velocity)
        learned = hypothesis.learned
        if not learned.is_prior:
            learned = replace(learned, belief=explanation.prior)
        elif kind.mode is Mode.LASTING:  # else a wrong ring-down is taken for the colour of the noise
            learned = self._with_noise(learned, explanation)
        return Possibility(log_weight, learned, kind.mode)

    def _learned(self, explanation: Explanation) -> LearnedInjector:
        before, cost, limits = explanation.hypothesis.learned, explanation.cost, self.reader.limits
        held, reading, fit = explanation.held, explanation.reading, explanation.fit
        statistics = reading.healthy.relative(reading.leaves(explanation.theta, fit))
        temper = self.reader.temper_in(self.state, before, statistics, reading.cost.temper)
        information = cost.information / temper
        belief = held.prior.updated(information, cost.vector / temper)
        likely, active = shrink(belief), before.active if fit is None else fit.active
        theta, active = best_subset(likely.mean, likely.covariance, limits.gate, active)
        learned = LearnedInjector(
            belief=held.considered(belief, information),
            theta=np.clip(theta, limits.lowest, limits.highest),
            statistics=pooled(before.statistics, statistics),
            active=active,
            is_prior=False,
            colour=before.colour,
            at_rest=before.at_rest,
            learned_at=remembered(before.learned_at, self.point),
        )
        return self._with_noise(learned, explanation)

    def _with_noise(self, learned: LearnedInjector, explanation: Explanation) -> LearnedInjector:
        """Adds what the event shows of the noise while the needle is shut."""
        reading, fit = explanation.reading, explanation.fit
        key = id(learned.at_rest), id(reading)
        if key not in self._noises:
            unfiltered = reading.unfiltered if fit is None else fit.unfiltered
            self._noises[key] = noise_after(learned, reading.window, unfiltered, reading.follows, self.reader)
        at_rest, colour = self._noises[key]
        return replace(learned, at_rest=at_rest, colour=colour)


def noise_after(
    learned: LearnedInjector,
    window: Window,
    unfiltered: NDArray[np.float64],
    follows: Follows,
    reader: EventReader,
) -> Noise:
    """Noise by the belief, and by the innovations (n,) of an event."""
    stretches = resting_segments(window, reader.burn_in, reader.resting)
    at_rest = learned.at_rest.after([unfiltered[each] for each in stretches], reader.interval)
    return Noise(at_rest, at_rest.colour(learned.colour, reader.interval, follows.sigmas.innovation))


def carried_on(continued: Sequence[Continued]) -> list[Continued]:
    """Explanations that are carried on, the likeliest first: one belief for each mode, equal ones merged.

    The first of the result is carried by the observer: it explains the event, if one of them does.
    """
    merged: list[Continued] = []
    for explanation, belief in continued:
        for i, (first, other) in enumerate(merged):
            if other.mode is belief.mode and is_alike(other.learned.belief, belief.learned.belief):
                weight = float(np.logaddexp(other.log_weight, belief.log_weight))
                merged[i] = first, replace(other, log_weight=weight)
                break
        else:
            merged.append((explanation, belief))
    merged.sort(key=lambda each: -each[1].log_weight)
    best = merged[0][1].learned
    kept = [
        (explanation, each)
        for explanation, each in merged
        if is_alike(best.belief, each.learned.belief) and is_same(best.colour, each.learned.colour)
    ]
    total = float(np.logaddexp.reduce([each.log_weight for _, each in kept]))
    kept.sort(key=lambda each: not each[0].is_good)
    return [(explanation, replace(each, log_weight=each.log_weight - total)) for explanation, each in kept]


def settled_after(account: Account, learned: LearnedInjector, is_as_believed: bool) -> Account:
    """Account that remembers a belief with which some events came as believed, and without objection."""
    unobjected = account.unobjected + 1 if is_as_believed else 0
    account = replace(account, unobjected=unobjected)
    if unobjected < c.SETTLED_AFTER:
        return account
    others = [each for each in account.settled if not is_compatible(each.belief, learned.belief)]
    return replace(account, settled=(learned, *others)[: c.MOST_SETTLED], settled_doubt=account.doubt)
