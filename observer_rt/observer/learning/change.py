"""An event fitted from what is believed of it; after a sudden change, where that is much better, from nothing."""

from dataclasses import replace

import numpy as np

from observer_rt.estimation.posterior import Belief
from observer_rt.estimation.prediction_error import EventCost, Linearisation
from observer_rt.estimation.scalars import Scalars
from observer_rt.observer.learning.fitting import EventFit, EventFitter, theta_limits
from observer_rt.observer.learning.trend import Trend

FIRST_ITERATIONS = 8
ITERATIONS = 2
CHANGE_SCORE = 60.0  # of the score test; without change it is 13 +- 5
QUICKER_SCORE = 35.0  # from which on wear is taken to move faster than its usual drift
QUICKER = 30.0  # times the usual drift
CHANGE_GAIN = 20.0  # chi2 by which forgetting must improve the fit


class ChangingFit:
    """Fits event after event; what moves on is seen in what they contradict together."""

    def __init__(self, scalars: Scalars, pressure_scale: float) -> None:
        """pressure_scale: p_0 [Pa]."""
        self._gate = scalars.gate
        self._limits = theta_limits(pressure_scale, scalars)
        self._wide, self._drift = scalars.prior(pressure_scale), scalars.drift(pressure_scale)
        self._trend = Trend()

    def forget(self) -> None:
        """The events before were judged by another measure."""
        self._trend = Trend()

    def fit(
        self, cost: EventCost, first: Linearisation, prior: Belief, active: frozenset[int], iterations: int
    ) -> EventFit | None:
        """The fit of an event that was linearised at `first`; iterations: after a sudden change. None: not finite.

        active: the gated columns in use. Raises numpy.linalg.LinAlgError when singular.
        """
        if not np.isfinite(first.value):
            return None
        fitter = EventFitter(cost, self._gate, active, self._limits)
        score = first.score(prior.covariance)
        if QUICKER_SCORE < score <= CHANGE_SCORE:
            prior = prior.widened(QUICKER * self._drift)
        prior = prior.widened(self._trend.extra_after(first.standard_scores(prior.covariance), self._drift))
        fit = fitter.fit(first, prior, ITERATIONS)
        if score <= CHANGE_SCORE:
            return fit
        other = fitter.fit(fit.linearisation, prior.widened(self._wide), iterations)
        much_better = other.linearisation.value < fit.linearisation.value - 0.5 * CHANGE_GAIN
        return replace(other if much_better else fit, contradicts=True)

    def fit_first(
        self, cost: EventCost, first: Linearisation, prior: Belief, active: frozenset[int]
    ) -> EventFit | None:
        """The same of the first event, which there is nothing to contradict."""
        if not np.isfinite(first.value):
            return None
        return EventFitter(cost, self._gate, active, self._limits).fit(first, prior, FIRST_ITERATIONS)

    def fit_again(self, cost: EventCost, fit: EventFit) -> EventFit:
        """The fit of an event of which less counts than before."""
        fitter = EventFitter(cost, self._gate, fit.active, self._limits)
        start = cost.linearised(fit.linearisation.theta)
        return replace(fitter.fit(start, fit.prior, ITERATIONS), contradicts=fit.contradicts)
