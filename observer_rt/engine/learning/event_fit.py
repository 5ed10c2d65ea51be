"""Fit of one event: without its outliers, in the colour of the noise and at its levels.

It starts from the belief before the event; after a sudden change, where that is much better, from nothing.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief
from observer_rt.engine.estimation.phases import PhaseStatistics
from observer_rt.engine.estimation.prediction_error import EventCost, Linearisation
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import SCALARS, Parameter
from observer_rt.engine.learning.adequacy import BURN_IN, tempering
from observer_rt.engine.learning.disturbances.colour import LAGS, SEGMENT, Colour, resting_segments
from observer_rt.engine.learning.disturbances.noise_levels import Sigmas, mask_of
from observer_rt.engine.learning.disturbances.pressure_gains import moved, offset_move
from observer_rt.engine.learning.fitting import EventFit, EventFitter, Limits, theta_limits
from observer_rt.engine.learning.forgetting import Cause, forgotten
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.state import LearningState

FIRST_ITERATIONS = 8
ITERATIONS = 2
CHANGE_SCORE = 60.0  # of the score test; without change it is 13 +- 5
QUICKER_SCORE = 35.0  # from which on wear is taken to move faster than its usual drift
QUICKER = 30.0  # times the usual drift
CHANGE_GAIN = 20.0  # chi2 by which forgetting must improve the fit


COLOURED_RAIL = 1.5  # times a sample's noise: so strong where the line hears it, the rail's noise is coloured
RAIL_TEMPER = 2.0
Fitted = tuple[LearningState, Window, EventCost, EventFit | None]
"""The state after it, the samples of an event that count, its cost and its fit, None: not finite."""


class Believed(NamedTuple):
    """Knowledge before an event.

    offset [p_0]: at rest before it, None without a sample; sigmas: if its noise is white; prior: the belief; again:
    all this was believed before events that did not pass.
    """

    setting: Setting
    sigmas: Sigmas
    offset: float | None
    prior: Belief
    again: bool = False


@dataclass(frozen=True, eq=False)
class Explained:
    """An event as far as it was understood: the samples that count, its fit, and the colour after it.

    is_louder: where the pressure is steep, as was not known before.
    """

    window: Window
    cost: EventCost
    fit: EventFit
    colour: Colour | None
    is_louder: bool


@dataclass(frozen=True, eq=False)
class EventReader:
    """Explains events, by what the state tells of the noise and of the range; all that is fixed for an injector.

    interval: of samples [s]; pressure_scale: p_0 [Pa]; start: the state before any event; healthy: what the model
    leaves unexplained of a healthy injector.
    """

    interval: float
    pressure_scale: float
    start: LearningState
    healthy: Healthy = NOT_FITTED

    @cached_property
    def burn_in(self) -> int:
        """Samples of an event's window before innovations count."""
        return round(BURN_IN / self.interval)

    @cached_property
    def wide(self) -> NDArray[np.float64]:
        """Standard deviations (m,) of theta before any event."""
        return SCALARS.prior(self.pressure_scale)

    @cached_property
    def drift(self) -> NDArray[np.float64]:
        """Standard deviations (m,) of the change of theta from event to event."""
        return SCALARS.drift(self.pressure_scale)

    @cached_property
    def _limits(self) -> Limits:
        return theta_limits(self.pressure_scale)

    def forgotten(self, state: LearningState, cause: Cause) -> LearningState:
        """State without what no longer holds."""
        return forgotten(state, cause, self.start, self.wide)

    def explained(
        self, state: LearningState, window: Window, believed: Believed
    ) -> tuple[LearningState, Explained | None]:
        """Fits an event; None if no fit is finite. Raises numpy.linalg.LinAlgError when singular."""
        lasts = state.mistrust.lasts
        state, counted, cost, fit = self._fitted(state, window, believed, lasts)
        if fit is None:
            return state, None
        state, mask = self._mask(state, counted, fit.innovations, believed)
        if mask is not None:
            counted = counted._replace(masked=mask)
            cost = self.cost_of(state, counted, believed)
            fitter = EventFitter(cost, SCALARS.gate, fit.active, self._limits)
            start = cost.linearised(fit.linearisation.theta)
            fit = replace(fitter.fit(start, fit.prior, ITERATIONS), contradicts=fit.contradicts)
        state, colour = self._colour_after(state, counted, fit, believed)
        if state.learned.colour is None and colour is not None:
            state = self.forgotten(state, Cause.COLOUR)
            state = replace(state, learned=replace(state.learned, colour=colour))
            state, counted, cost, fit = self._fitted(state, counted, believed, lasts)
            if fit is None:
                return state, None
        jitter = state.jitter.after(counted, fit.unfiltered, believed.sigmas.innovation, self.burn_in)
        is_louder = jitter.is_known and not state.jitter.is_known
        state = replace(state, jitter=jitter)
        if is_louder:
            state, counted, cost, fit = self._fitted(state, counted, believed, lasts=False)
            if fit is None:
                return state, None
        return state, Explained(counted, cost, fit, colour, is_louder)

    def cost_of(self, state: LearningState, window: Window, believed: Believed) -> EventCost:
        """Cost of an event with the colour in use."""
        colour = state.learned.colour
        return EventCost(
            window,
            believed.setting,
            _sigmas(state, believed).innovation,
            self.burn_in,
            None if colour is None else colour.whitening,
            believed.offset,
            state.jitter.levels(window, believed.sigmas.innovation),
            state.overdispersion.factor,
            self.healthy.expected(window, believed.setting.coefficients, self.interval),
        )

    def with_range(
        self, state: LearningState, event: Explained, window: Window, believed: Believed
    ) -> tuple[LearningState, bool]:
        """Adds an explained event, whose window was so before; returns whether the line's range ends in it, too.

        Objections to the events in which that showed were to their clipped samples.
        """
        sigmas = _sigmas(state, believed)
        outliers = state.outliers.after(event.window, event.fit.innovations, sigmas, self.burn_in)
        was_known, range_ends = state.range_ends.is_known, state.range_ends.after(window, sigmas)
        state = replace(state, outliers=outliers, range_ends=range_ends)
        is_ending = outliers.is_clipped(sigmas) or range_ends.is_known
        is_new = range_ends.is_known and not was_known
        return self.forgotten(state, Cause.RANGE_ENDS) if is_new else state, is_ending

    def _fitted(self, state: LearningState, window: Window, believed: Believed, lasts: bool) -> Fitted:
        """Fits an event without what stands out by the belief before it; lasts: that explains nothing."""
        cost, prior = self.cost_of(state, window, believed), believed.prior
        first = cost.linearised(state.learned.theta)
        if not np.isfinite(first.value):
            return state, window, cost, None
        if state.learned.is_prior:  # there is nothing to contradict
            return state, window, cost, self._fitter(state, cost).fit(first, prior, FIRST_ITERATIONS)
        state, mask = self._mask(state, window, cost.innovations, believed)
        move = offset_move(window if mask is None else window._replace(masked=mask), cost)
        if move != 0.0:
            prior = moved(prior, move)
            theta = first.theta.copy()
            theta[Parameter.LINE_PRESSURE_OFFSET] += move
            first = cost.linearised(theta)
            state, mask = self._mask(state, window, cost.innovations, believed)
        if mask is not None:
            window = window._replace(masked=mask)
            cost = self.cost_of(state, window, believed)
            first = cost.linearised(first.theta)
        if not np.isfinite(first.value):
            return state, window, cost, None
        # where nothing explained the events before, many steps would be lost on this one
        iterations = ITERATIONS if lasts else FIRST_ITERATIONS
        return self._fit_change(state, window, cost, first, prior, iterations)

    def _fit_change(
        self,
        state: LearningState,
        window: Window,
        cost: EventCost,
        first: Linearisation,
        prior: Belief,
        iterations: int,
    ) -> Fitted:
        """Fits an event that was linearised at `first`; iterations: after a sudden change.

        What moves on is seen in what events contradict together. Raises numpy.linalg.LinAlgError when singular.
        """
        fitter = self._fitter(state, cost)
        score = first.score(prior.covariance)
        if QUICKER_SCORE < score <= CHANGE_SCORE:
            prior = prior.widened(QUICKER * self.drift)
        trend = state.trend.after(first.standard_scores(prior.covariance))
        prior = prior.widened(trend.extra(self.drift))
        fit = fitter.fit(first, prior, ITERATIONS)
        if score <= CHANGE_SCORE:
            overdispersion = state.overdispersion.after(score)
            return replace(state, trend=trend, overdispersion=overdispersion), window, cost, fit
        other = fitter.fit(fit.linearisation, prior.widened(self.wide), iterations)
        much_better = other.linearisation.value < fit.linearisation.value - 0.5 * CHANGE_GAIN
        fit = replace(other if much_better else fit, contradicts=True)
        return replace(state, trend=trend), window, cost, fit

    def _fitter(self, state: LearningState, cost: EventCost) -> EventFitter:
        return EventFitter(cost, SCALARS.gate, state.learned.active, self._limits)

    def _mask(
        self, state: LearningState, window: Window, innovations: NDArray[np.float64], believed: Believed
    ) -> tuple[LearningState, NDArray[np.bool_] | None]:
        sigmas = _sigmas(state, believed)
        range_ends, ended = state.range_ends.masked(window, innovations, sigmas, self.burn_in)
        more = bool((ended & ~mask_of(window)).any())
        window = window._replace(masked=ended) if more else window
        found = state.outliers.masked(window, np.where(ended, 0.0, innovations), sigmas, self.burn_in)
        return replace(state, range_ends=range_ends), ended if found is None and more else found

    def _colour_after(
        self, state: LearningState, window: Window, fit: EventFit, believed: Believed
    ) -> tuple[LearningState, Colour | None]:
        """The colour of the noise, after what a fitted event leaves while the needle is shut."""
        shortest = max(round(SEGMENT / self.interval), LAGS + 1)
        rest = resting_segments(window, self.burn_in, shortest)
        at_rest = state.at_rest.after([fit.unfiltered[part] for part in rest], self.interval)
        slow_rail = state.slow_rail.after([window.inputs[part, 0] for part in rest], self.interval)
        colour = at_rest.colour(state.learned.colour, self.interval, believed.sigmas.innovation)
        return replace(state, at_rest=at_rest, slow_rail=slow_rail), colour


def temper_in(state: LearningState, statistics: PhaseStatistics, rail_noise: float) -> float:
    """Factor on the variance of an event's innovations; rail_noise: of a sample [p_0].

    Coloured noise of the rail pressure drives the model, too: it does not stay an error of its output. A rail
    that really moves is no noise, but then the innovations are white.
    """
    is_rail = state.learned.colour is not None and state.slow_rail.sigma > COLOURED_RAIL * rail_noise
    return max(tempering(statistics), RAIL_TEMPER if is_rail else 1.0)


def _sigmas(state: LearningState, believed: Believed) -> Sigmas:
    """Standard deviations of the innovations as they count."""
    colour = state.learned.colour
    return believed.sigmas if colour is None else replace(believed.sigmas, innovation=colour.sigma)
