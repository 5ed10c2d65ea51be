"""One event explained: fitted without its outliers, in the colour of the noise and at its levels.

Fitted from what is believed of it; after a sudden change, where that is much better, from nothing.
"""

import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief
from observer_rt.engine.estimation.phases import PhaseStatistics
from observer_rt.engine.estimation.prediction_error import EventCost, Linearisation
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import Parameter, Scalars, Theta
from observer_rt.engine.learning.adequacy import BURN_IN, tempering
from observer_rt.engine.learning.disturbances.clipping import EndsOfRange
from observer_rt.engine.learning.disturbances.colour import (
    LAGS,
    SEGMENT,
    Colour,
    RestingNoise,
    SlowRail,
    TimeJitter,
    resting_segments,
)
from observer_rt.engine.learning.disturbances.masks import OutlierSearch
from observer_rt.engine.learning.disturbances.noise_levels import Sigmas, mask_of
from observer_rt.engine.learning.disturbances.pressure_gains import moved, offset_move
from observer_rt.engine.learning.fitting import EventFit, EventFitter, theta_limits
from observer_rt.engine.learning.forgetting import FORGOTTEN, Cause, Forgotten
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.memory import Tracker
from observer_rt.engine.learning.overdispersion import Overdispersion
from observer_rt.engine.learning.trend import Trend

FIRST_ITERATIONS = 8
ITERATIONS = 2
CHANGE_SCORE = 60.0  # of the score test; without change it is 13 +- 5
QUICKER_SCORE = 35.0  # from which on wear is taken to move faster than its usual drift
QUICKER = 30.0  # times the usual drift
CHANGE_GAIN = 20.0  # chi2 by which forgetting must improve the fit


class ChangingFit(Tracker):
    """Fits event after event; what moves on is seen in what they contradict together."""

    _trend: Trend
    _overdispersion: Overdispersion

    def __init__(self, scalars: Scalars, pressure_scale: float, overdispersion: float) -> None:
        """pressure_scale: p_0 [Pa]; overdispersion: of the healthy injector."""
        self._gate = scalars.gate
        self._limits = theta_limits(pressure_scale, scalars)
        self._wide, self._drift = scalars.prior(pressure_scale), scalars.drift(pressure_scale)
        self._trend = Trend()
        self._overdispersion = Overdispersion(overdispersion)

    @property
    def overdispersion(self) -> float:
        """By what an event's cost is to be divided."""
        return self._overdispersion.factor

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
            self._overdispersion.add(score)
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


COLOURED_RAIL = 1.5  # times a sample's noise: so strong where the line hears it, the rail's noise is coloured
RAIL_TEMPER = 2.0


class Believed(NamedTuple):
    """What is known when an event comes.

    offset [p_0]: at rest before it, None without a sample; sigmas: if its noise is white; theta (m,) is where it is
    linearised first; active: the gated columns in use; prior: the belief; is_first: nothing was learned yet; lasts:
    what was learned explains nothing; again: all this was believed before events that did not pass.
    """

    setting: Setting
    sigmas: Sigmas
    offset: float | None
    theta: Theta
    active: frozenset[int]
    prior: Belief
    is_first: bool
    lasts: bool
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


class EventReader(Tracker):
    """Explains event after event, by what those before have shown of the noise and of the range."""

    _at_rest: RestingNoise
    _slow_rail: SlowRail
    _jitter: TimeJitter
    _outliers: OutlierSearch
    _range: EndsOfRange
    _fit: ChangingFit

    def __init__(
        self,
        interval: float,
        pressure_scale: float,
        scalars: Scalars,
        colour: Colour | None,
        healthy: Healthy = NOT_FITTED,
    ) -> None:
        """interval: of samples [s]; pressure_scale: p_0 [Pa]; colour: that is known.

        healthy: what the model leaves unexplained of a healthy injector.
        """
        self.colour = colour
        """Of the innovations, None while they are white."""
        self.burn_in = round(BURN_IN / interval)
        self._interval, self._scalars = interval, scalars
        self._shortest = max(round(SEGMENT / interval), LAGS + 1)
        self._at_rest = RestingNoise(interval)
        self._slow_rail = SlowRail(interval)
        self._jitter = TimeJitter()
        self._outliers = OutlierSearch()
        self._range = EndsOfRange()
        self._fit = ChangingFit(scalars, pressure_scale, healthy.overdispersion)
        self._healthy = healthy

    def explained(self, window: Window, believed: Believed) -> Explained | None:
        """An event fitted; None if no fit is finite. Raises numpy.linalg.LinAlgError when singular."""
        counted, cost, fit = self._fitted(window, believed)
        if fit is None:
            return None
        mask = self._mask(counted, fit.innovations, believed)
        if mask is not None:
            counted = counted._replace(masked=mask)
            cost = self.cost_of(counted, believed)
            fit = self._fit.fit_again(cost, fit)
        colour = self._colour_after(counted, fit, believed)
        if self.colour is None and colour is not None:
            self.forget(Cause.COLOUR)
            self.colour = colour
            counted, cost, fit = self._fitted(counted, believed)
            if fit is None:
                return None
        is_louder = self._jitter.is_new_after(
            counted, fit.unfiltered, believed.sigmas.innovation, self.burn_in
        )
        if is_louder:
            counted, cost, fit = self._fitted(counted, believed._replace(lasts=False))
            if fit is None:
                return None
        return Explained(counted, cost, fit, colour, is_louder)

    def cost_of(self, window: Window, believed: Believed) -> EventCost:
        """An event's cost with the colour in use."""
        return EventCost(
            window,
            believed.setting,
            self._sigmas(believed).innovation,
            self.burn_in,
            self._scalars,
            None if self.colour is None else self.colour.whitening,
            believed.offset,
            self._jitter.levels(window, believed.sigmas.innovation),
            self._fit.overdispersion,
            self._healthy.expected(window, believed.setting.coefficients, self._interval),
        )

    def temper(self, statistics: PhaseStatistics, rail_noise: float) -> float:
        """Factor on the variance of an event's innovations; rail_noise: of a sample [p_0].

        Coloured noise of the rail pressure drives the model, too: it does not stay an error of its output. A rail
        that really moves is no noise, but then the innovations are white.
        """
        is_rail = self.colour is not None and self._slow_rail.sigma > COLOURED_RAIL * rail_noise
        return max(tempering(statistics), RAIL_TEMPER if is_rail else 1.0)

    def is_clipped_after(self, event: Explained, believed: Believed) -> bool:
        """Take in an explained event; whether its line pressure goes as far as at other rail pressures."""
        return self._outliers.is_clipped_after(
            event.window, event.fit.innovations, self._sigmas(believed), self.burn_in
        )

    def is_range_ending_in(self, window: Window, believed: Believed) -> tuple[bool, bool]:
        """Whether the line pressure's range is known to end, after an event, and whether that is new."""
        is_new = self._range.is_new_after(window, self._sigmas(believed))
        return self._range.is_known, is_new

    def loudest(self, window: Window, believed: Believed) -> float:
        """Mean square of innovations where an event is loudest, over that at rest."""
        return self._jitter.loudest(window, believed.sigmas.innovation)

    @property
    def noise(self) -> tuple[Colour | None, RestingNoise]:
        """The colour of the noise, and what tells it, copied."""
        return self.colour, copy.deepcopy(self._at_rest)

    def with_noise(self, colour: Colour | None, at_rest: RestingNoise) -> "EventReader":
        """A copy by which the noise is another one."""
        other = copy.deepcopy(self)
        other.colour, other._at_rest = colour, copy.deepcopy(at_rest)
        return other

    def forget(self, cause: Cause) -> None:
        """What is forgotten upon a cause, of what is followed here."""
        parts = FORGOTTEN[cause]
        if Forgotten.COLOUR in parts:
            self.colour, self._at_rest = None, RestingNoise(self._interval)
        if Forgotten.TREND in parts:
            self._fit.forget()

    def _fitted(self, window: Window, believed: Believed) -> tuple[Window, EventCost, EventFit | None]:
        """An event without what stands out by what is believed before it, its cost, and its fit."""
        cost, prior, active = self.cost_of(window, believed), believed.prior, believed.active
        first = cost.linearised(believed.theta)
        if believed.is_first or not np.isfinite(first.value):
            return window, cost, self._fit.fit_first(cost, first, prior, active)
        mask = self._mask(window, cost.innovations, believed)
        move = offset_move(window if mask is None else window._replace(masked=mask), cost)
        if move != 0.0:
            prior = moved(prior, move)
            theta = first.theta.copy()
            theta[Parameter.LINE_PRESSURE_OFFSET] += move
            first = cost.linearised(theta)
            mask = self._mask(window, cost.innovations, believed)
        if mask is not None:
            window = window._replace(masked=mask)
            cost = self.cost_of(window, believed)
            first = cost.linearised(first.theta)
        # where nothing explained the events before, many steps would be lost on this one
        iterations = ITERATIONS if believed.lasts else FIRST_ITERATIONS
        return window, cost, self._fit.fit(cost, first, prior, active, iterations)

    def _mask(
        self, window: Window, innovations: NDArray[np.float64], believed: Believed
    ) -> NDArray[np.bool_] | None:
        sigmas = self._sigmas(believed)
        ended = self._range.masked(window, innovations, sigmas, self.burn_in)
        more = bool((ended & ~mask_of(window)).any())
        window = window._replace(masked=ended) if more else window
        found = self._outliers.masked(window, np.where(ended, 0.0, innovations), sigmas, self.burn_in)
        return ended if found is None and more else found

    def _colour_after(self, window: Window, fit: EventFit, believed: Believed) -> Colour | None:
        """The colour of the noise, after what a fitted event leaves while the needle is shut."""
        rest = resting_segments(window, self.burn_in, self._shortest)
        self._at_rest.add([fit.unfiltered[part] for part in rest])
        self._slow_rail.add([window.inputs[part, 0] for part in rest])
        return self._at_rest.colour(self.colour, believed.sigmas.innovation)

    def _sigmas(self, believed: Believed) -> Sigmas:
        """Of the innovations as they count."""
        return (
            believed.sigmas if self.colour is None else replace(believed.sigmas, innovation=self.colour.sigma)
        )
