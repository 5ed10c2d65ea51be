"""The account of change as it goes from event to event: what may be so, and what a mass is unsure by.

- `Scatter` of events about what was believed: where they differ by more than it says, it is too sure of itself.
- `UnexplainedPressure` that a model leaves, as a share of the mass it would be at the nozzle. With a hum of the
  supply the noise takes its colour, and no test hears it any more; the mass does.

A quasi-likelihood: what an event says of the parameters counts for less by the factor by which such events were seen
to differ (McCullagh, Nelder, Generalized Linear Models, 2nd ed., section 4.5).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.prediction_error import Linearisation
from observer_rt.engine.estimation.predictor import Setting, Window, innovations
from observer_rt.engine.estimation.scalars import Theta, learned_of
from observer_rt.engine.learning import constants as c
from observer_rt.engine.learning.disturbances.colour import resting_segments
from observer_rt.engine.learning.disturbances.masks import mask_of
from observer_rt.engine.learning.hypotheses import Possibility
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.foundation.records import Count

Vector = NDArray[np.float64]
FEWEST = 5  # samples with the needle open

USUAL_SCORE = 1.2  # of events that scatter by noise alone; their mean is 1
REMEMBERED = 0.95  # weight of the scores before an event
PRIOR_EVENTS = 10.0  # for which the factor of the fit counts at first
LARGEST_RATIO = 2.5  # of a score to the usual one, up to which it is scatter and no change of the injector
LARGEST = 8.0  # factor; a model worse than that is inadequate
_ROUNDS = 10  # in which the factor settles


@dataclass(frozen=True)
class Scatter:
    """Running mean of the scores of events that came as believed, over the usual one."""

    events: float = c.SCATTER_PRIOR
    ratios: float = c.SCATTER_PRIOR

    @property
    def factor(self) -> float:
        """Factor on the variances of theta, 1 at least."""
        return max(1.0, self.ratios / self.events)

    def after(self, score: float) -> "Scatter":
        """Adds the score of an event before it was fitted."""
        return Scatter(c.SCATTER_KEPT * self.events + 1.0, c.SCATTER_KEPT * self.ratios + min(score, c.LARGEST_SCORE))


@dataclass(frozen=True)
class UnexplainedPressure:
    """Mean square of the share, over recent events: sum, and of how many stretches."""

    squares: float = 0.0
    count: float = 0.0

    @property
    def variance(self) -> float:
        """Variance of a mass, as a share, by it."""
        return c.UNEXPLAINED_COUNTS * self.squares / self.count if self.count else 0.0

    def after(self, window: Window, setting: Setting, theta: Theta, first: int) -> "UnexplainedPressure":
        """Adds an event explained with theta (m,), from sample `first` on.

        Means of the recorded less the indicated line pressure, with no gain, over the injection and over stretches of
        rest as long: half of it, over the rail pressure, is the share of a flow.
        """
        counts = np.zeros(window.output.size, np.bool_)
        counts[window.opening :] = True
        counts &= (window.inputs[:, 1] > 0.0) & ~mask_of(window)
        length = int(np.count_nonzero(counts))
        if length < FEWEST:
            return self
        left = np.empty(window.output.size)
        setting = setting._replace(gain=np.zeros_like(setting.gain))
        innovations(window, setting, learned_of(theta, setting.coefficients), left)
        if not np.isfinite(left).all():
            return self
        means = [float(left[counts].mean())]
        for segment in resting_segments(window, first, length):
            blocks = left[segment][: (segment.stop - segment.start) // length * length].reshape(-1, length)
            means += blocks.mean(axis=1).tolist()
        shares = np.array(means) / (2.0 * float(window.inputs[window.opening, 0]))
        kept = c.UNEXPLAINED_KEPT
        return UnexplainedPressure(kept * self.squares + float(shares @ shares), kept * self.count + shares.size)


@dataclass(frozen=True, eq=False)
class MassDoubt:
    """What makes a mass less certain than a belief says."""

    unexplained: UnexplainedPressure = field(default_factory=UnexplainedPressure)
    scatter: Scatter = field(default_factory=Scatter)


@dataclass(frozen=True, eq=False)
class Account:
    """Hypotheses, the one that is carried first: one belief in its modes.

    settled: the last beliefs that nothing objected to for some events, which may come back, and with them
    `settled_doubt`; unobjected: events in a row without objection.
    """

    hypotheses: tuple[Possibility, ...]
    settled: tuple[LearnedInjector, ...] = ()
    unobjected: Count = 0
    doubt: MassDoubt = field(default_factory=MassDoubt)
    settled_doubt: MassDoubt = field(default_factory=MassDoubt)

    @classmethod
    def of(cls, learned: LearnedInjector) -> "Account":
        """Account with one hypothesis: it is so."""
        return cls((Possibility(0.0, learned),))

    @property
    def lead(self) -> Possibility:
        """The hypothesis that is carried."""
        return self.hypotheses[0]

    @property
    def beliefs(self) -> tuple[LearnedInjector, ...]:
        """All that is believed, or was."""
        return (*(each.learned for each in self.hypotheses), *self.settled)

    def map(self, change: Callable[[LearnedInjector], LearnedInjector]) -> "Account":
        """Account in which every hypothesis believes what the change makes of it."""
        changed = {id(h.learned): change(h.learned) for h in self.hypotheses}
        return replace(
            self,
            hypotheses=tuple(replace(h, learned=changed[id(h.learned)]) for h in self.hypotheses),
            settled=tuple(changed.get(id(each)) or change(each) for each in self.settled),
        )


def _within(factor: float) -> float:
    return min(max(factor, 1.0), LARGEST)


def _ratio(score: float) -> float:
    """Ratio of a score to the usual one."""
    return min(score / USUAL_SCORE, LARGEST_RATIO)


@dataclass(frozen=True)
class Overdispersion:
    """The factor on the variance of what events say of the parameters, at least 1: a weighted mean over events."""

    sum: float = PRIOR_EVENTS
    weight: float = PRIOR_EVENTS

    @property
    def factor(self) -> float:
        """On the variance; an event's log likelihood is divided by it."""
        return _within(self.sum / self.weight)

    def after(self, score: float) -> "Overdispersion":
        """Adds the score of an event against what was believed, tempered by the factor."""
        return Overdispersion(REMEMBERED * self.sum + _ratio(score) * self.factor, REMEMBERED * self.weight + 1.0)


def of_healthy(factor: float) -> Overdispersion:
    """Overdispersion before any event, by the factor of the healthy injector, 1 of a model that is exact."""
    return Overdispersion(PRIOR_EVENTS * factor)


class TemperedEvent(NamedTuple):
    """The cost of an event round what was believed before it, and how sure that was, (m, m)."""

    cost: Linearisation
    covariance: NDArray[np.float64]

    def ratio(self, factor: float) -> float:
        """Ratio of a score to the usual one, tempered by a factor."""
        return _ratio(self.cost.tempered(factor).score(self.covariance))


def overdispersion_of(events: Sequence[TemperedEvent]) -> float:
    """The factor with which the scores of events are the usual ones on the mean, 1 .. LARGEST."""
    factor = 1.0
    for _ in range(_ROUNDS):
        mean = float(np.mean([event.ratio(factor) for event in events]))
        factor = _within(factor * mean)
    return factor
