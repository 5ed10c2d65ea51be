"""Learning between events: everything jointly, by prediction error, as a Bayesian update."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import GainSchedule, NoiseLevels, gain_schedule
from observer_rt.estimation.gating import carried_covariance, gated_covariance
from observer_rt.estimation.learned import learned_of
from observer_rt.estimation.phases import (
    Phase,
    PhaseStatistics,
    no_statistics,
)
from observer_rt.estimation.posterior import Belief
from observer_rt.estimation.prediction_error import EventCost, Linearisation
from observer_rt.estimation.predictor import (
    Setting,
    Window,
)
from observer_rt.estimation.scalars import SCALARS, Scalars, Theta
from observer_rt.estimation.sensitivity import Parameter
from observer_rt.model.sensor import LAG_UNIT
from observer_rt.observer.learning.adoption import Rehearsed, is_better
from observer_rt.observer.learning.disturbances.clipping import EndsOfRange
from observer_rt.observer.learning.disturbances.coil_current import CoilCurrent
from observer_rt.observer.learning.disturbances.colour import (
    SEGMENT,
    Colour,
    OffsetSince,
    RestingNoise,
    SlowRail,
    resting_segments,
)
from observer_rt.observer.learning.disturbances.edges import EdgeSearch, with_step
from observer_rt.observer.learning.disturbances.jitter import TimeJitter
from observer_rt.observer.learning.disturbances.levels import Sigmas, mask_of
from observer_rt.observer.learning.disturbances.masks import OutlierSearch
from observer_rt.observer.learning.disturbances.offset_walk import moved, offset_move
from observer_rt.observer.learning.disturbances.pressure_gains import PressureGains
from observer_rt.observer.learning.doubts.adequacy import (
    BURN_IN,
    Innovations,
    Objection,
    event_statistics,
    is_worn_beyond_limits,
    looks_like_inertance,
    objections,
    of_standstill,
    pooled,
    tempering,
)
from observer_rt.observer.learning.doubts.lateness import LagDoubt, lag_score, lateness_of
from observer_rt.observer.learning.doubts.lift_lateness import LiftLag, LiftLagSearch, lift_lag_of
from observer_rt.observer.learning.doubts.mistrust import Freezer, Mistrust
from observer_rt.observer.learning.familiarity import UNSEEN, operating_point, remembered, unfamiliarity
from observer_rt.observer.learning.fitting import EventFit, EventFitter, theta_limits
from observer_rt.observer.learning.healthy import NOT_FITTED, Healthy
from observer_rt.observer.learning.indicators import nozzle_change
from observer_rt.observer.learning.interval import Resimulated, resimulated
from observer_rt.observer.learning.knowledge import (
    Adoption,
    Knowledge,
    Outcome,
    no_knowledge,
)
from observer_rt.observer.learning.trend import Trend
from observer_rt.observer.stream.phi import StructuredPhi
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import Constants, Reason

FIRST_ITERATIONS = 8
ITERATIONS = 2
STANDSTILL_ENOUGH = 1000  # samples, for the first guess of the offset
OTHER_NOISE = 1.25  # times a level
CHANGE_SCORE = 60.0  # of the score test; without change it is 13 +- 5
QUICKER_SCORE = 35.0  # from which on wear is taken to move faster than its usual drift
QUICKER = 30.0  # times the usual drift
COLOURED_RAIL = 1.5  # times a sample's noise: so strong where the line hears it, the rail's noise is coloured
RAIL_TEMPER = 2.0
CHANGE_GAIN = 20.0  # chi2 by which forgetting must improve the fit


@dataclass(frozen=True, eq=False)
class _Explained:
    """An event as far as it was understood: the samples that count, its fit, and the colour after it.

    offset [p_0]: at rest before it, None without a sample.
    """

    window: Window
    offset: float | None
    cost: EventCost
    fit: EventFit
    colour: Colour | None


class _Past(NamedTuple):
    """An event, the constants during it, and the offset it was found to have [p_0]."""

    window: Window
    constants: Constants
    offset: float


class Learner:
    """Learns event after event. Pure: no clock, no thread; the caller decides where it runs."""

    def __init__(
        self,
        constants: Constants,
        knowledge: Knowledge,
        scalars: Scalars = SCALARS,
        healthy: Healthy = NOT_FITTED,
    ) -> None:
        """healthy: what the model leaves unexplained of a healthy injector."""
        self._constants = constants
        self._healthy = healthy
        self._scalars = scalars
        self._scale = constants.coefficients.pressure_scale
        self._belief = knowledge.belief
        self._theta = knowledge.in_force
        self._active = knowledge.active
        self._noise = knowledge.noise
        self._events = knowledge.events
        self._statistics = knowledge.statistics
        self._learned_at = knowledge.learned_at
        self._colour = knowledge.colour_at(constants.interval)
        self._at_rest = RestingNoise(constants.interval)
        self._slow_rail = SlowRail(constants.interval)
        self._offset_since = OffsetSince()
        self._schedule = self._gains()
        self._previous: _Past | None = None
        self._freezer = Freezer()
        self._mistrust = Mistrust()
        self._lag_doubt = LagDoubt()
        self._lift_lag = LiftLagSearch()
        self._trend = Trend()
        self._outliers = OutlierSearch()
        self._range = EndsOfRange()
        self._edges = EdgeSearch(constants.interval)
        self._current = CoilCurrent(constants.interval)
        self._jitter = TimeJitter()
        self._pressure_gains = PressureGains()

    @property
    def schedule(self) -> GainSchedule:
        """Gains for the noise levels and the sensor lag in use."""
        return self._schedule

    @property
    def phi(self) -> StructuredPhi:
        """x^ carries the network of theta, as x~ does."""
        return StructuredPhi()

    @property
    def belief(self) -> Belief:
        """What is believed after the last event."""
        return self._belief

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Update the belief from one event; decide whether its estimate is adopted in place of `in_force` (m,).

        constants: during the event; None: as they were.
        """
        self._constants = constants or self._constants
        if standstill.noise is not None:
            self._hear(standstill.noise)
        self._schedule = self._gains()
        recorded = window._replace(output=self._pressure_gains.undone(window.output))
        window = self._current.undone(recorded)
        rail_pressure = float(window.inputs[:, 0].mean())
        offset = self._offset_since.after(standstill)
        if offset is not None:
            offset = self._pressure_gains.undone_offset(offset, rail_pressure)
        try:
            event = self._explained(window, self._prior(standstill), offset)
            if event is None:
                return self._outcome(Adoption.FAILED, window, in_force)
            wide = self._scalars.prior(self._scale)
            lag = lag_score(event.window, self._setting(), event.fit, event.cost, wide, self._scalars)
            carried = carried_covariance(in_force, event.fit.prior, self._scalars.gate, self._active)
            self._take_in(event)
        except np.linalg.LinAlgError:
            return self._outcome(Adoption.FAILED, window, in_force)
        found = float(self._theta[Parameter.LINE_PRESSURE_OFFSET])
        self._pressure_gains.add(self._pressure_gains.as_recorded(found, rail_pressure), rail_pressure)
        strange = self._strangeness(event.window)
        is_clipped = self._outliers.is_clipped_after(
            event.window, event.fit.innovations, self._sigmas, event.cost.burn_in
        )
        is_clipped |= self._is_range_ending_in(window)
        is_disturbed = self._is_disturbed_before_openings(event, recorded)
        again = self._resimulated(event.window, carried, strange)
        self._lag_doubt.take_in(None if lag is None else lateness_of(lag, again.run))
        doubts = self._doubts(event)
        now = _Past(event.window, self._constants, found)
        better = self._is_better([now] if self._previous is None else [self._previous, now], in_force)
        self._previous = now
        if self._freezer.is_frozen_after(self._statistics):
            return _because(self._frozen(event.window, in_force), is_clipped, is_disturbed)
        adoption = Adoption.ADOPTED if better else Adoption.REJECTED
        outcome = self._outcome(adoption, event.window, in_force, doubts)
        outcome = _because(outcome, is_clipped, is_disturbed)
        outcome = replace(
            outcome, objections=self._lift_lag.told(outcome.objections, self._lift_lag_in(event))
        )
        because = self._mistrust.after(outcome.objections)
        if because is not None:
            nominal = replace(outcome.knowledge, in_force=np.zeros_like(in_force))
            reasons = outcome.objections or (because,)
            return replace(outcome, adoption=Adoption.SET_ASIDE, knowledge=nominal, objections=reasons)
        again = replace(again, systematic=math.hypot(again.systematic, self._lag_doubt.volume_share))
        masked = int(event.window.masked.sum()) - int(window.masked.sum())
        loudest = self._jitter.loudest(event.window, self._schedule.innovation_sigma)
        return replace(outcome, resimulated=again, outliers=masked, loudest=loudest)

    def _hear(self, noise: NoiseLevels) -> None:
        """Noise levels from an event on: what an event was by others says nothing by these."""
        before = self._noise
        if any(
            abs(math.log(now / then)) > math.log(OTHER_NOISE)
            for now, then in (
                (noise.rail_pressure, before.rail_pressure),
                (noise.line_pressure, before.line_pressure),
            )
        ):
            self._statistics = no_statistics()
        self._noise = noise

    def _explained(self, window: Window, prior: Belief, offset: float | None) -> _Explained | None:
        """An event fitted without its outliers, in the colour of the noise; None if no fit is finite.

        offset [p_0]: at rest before it. Raises numpy.linalg.LinAlgError when singular.
        """
        window, cost, fit = self._fitted(window, prior, offset)
        if fit is None:
            return None
        mask = self._mask(window, fit.innovations)
        if mask is not None:
            window = window._replace(masked=mask)
            cost = self._cost(window, offset)
            fit = self._refit(cost, fit)
        colour = self._colour_after(window, fit)
        if self._colour is None and colour is not None:
            self._colour, self._trend = colour, Trend()
            window, cost, fit = self._fitted(window, prior, offset)
            if fit is None:
                return None
        if self._jitter.is_new_after(window, fit.unfiltered, self._schedule.innovation_sigma, self._burn_in):
            self._statistics, self._mistrust = no_statistics(), Mistrust()
            window, cost, fit = self._fitted(window, prior, offset)
            if fit is None:
                return None
        return _Explained(window, offset, cost, fit, colour)

    def _doubts(self, event: _Explained) -> list[Reason]:
        """What an event brings up beside its innovations."""
        doubts = []
        if self._lag_doubt.is_relevant:
            doubts.append(Reason.TIME_BASE)
        if event.fit.contradicts:
            doubts.append(Reason.SUDDEN_CHANGE)
            self._previous = None  # it belongs to another injector
        return doubts

    def _lift_lag_in(self, event: _Explained) -> Callable[[float], LiftLag]:
        """What finds the lag of the lift that explains an event best, by that which is expected [s]."""

        def cost_of(window: Window) -> EventCost:
            return self._cost(window, event.offset)

        return partial(lift_lag_of, event.window, self._setting(), cost_of, self._scalars)

    def _strangeness(self, window: Window) -> float:
        """How far an event's operating point was from those learned at, of which it is one from now on."""
        point = operating_point(window, self._constants.interval)
        strange = unfamiliarity(point, self._learned_at)
        self._learned_at = remembered(self._learned_at, point)
        return strange

    def _resimulated(self, window: Window, carried: NDArray[np.float64], strange: float) -> Resimulated:
        """An event with what was learned from it; carried (m, m): covariance of the theta in force before."""
        now = carried_covariance(self._theta, self._belief, self._scalars.gate, self._active)
        now, carried = now + self._current.covariance, carried + self._current.covariance
        event = resimulated(window, self._setting(), self._noise, self._theta, now, carried, self._scalars)
        shares = self._healthy.mass_share, UNSEEN * strange, self._pressure_gains.flow_share
        return replace(event, systematic=math.hypot(*shares))

    def _prior(self, standstill: Standstill) -> Belief:
        """The belief before this event; the first one takes its offset from the standstill."""
        if self._events > 0:
            return self._pressure_gains.rescaled(self._belief.drifted(self._scalars.drift(self._scale)))
        if standstill.samples < STANDSTILL_ENOUGH:
            return self._belief
        mean = self._belief.mean.copy()
        mean[Parameter.LINE_PRESSURE_OFFSET] = standstill.offset
        self._theta = self._theta.copy()
        self._theta[Parameter.LINE_PRESSURE_OFFSET] = standstill.offset
        return replace(self._belief, mean=mean)

    def _fitted(
        self, window: Window, prior: Belief, offset: float | None
    ) -> tuple[Window, EventCost, EventFit | None]:
        """An event without what stands out by what is believed before it, its cost, and its fit.

        offset [p_0]: at rest before it.
        """
        cost = self._cost(window, offset)
        first = cost.linearised(self._theta)
        if self._events == 0 or not np.isfinite(first.value):
            return window, cost, self._fit(cost, first, prior)
        mask = self._mask(window, cost.innovations)
        move = offset_move(window if mask is None else window._replace(masked=mask), cost)
        if move != 0.0:
            prior = moved(prior, move)
            theta = first.theta.copy()
            theta[Parameter.LINE_PRESSURE_OFFSET] += move
            first = cost.linearised(theta)
            mask = self._mask(window, cost.innovations)
        if mask is not None:
            window = window._replace(masked=mask)
            cost = self._cost(window, offset)
            first = cost.linearised(first.theta)
        return window, cost, self._fit(cost, first, prior)

    def _cost(self, window: Window, offset: float | None) -> EventCost:
        """An event's cost with the colour in use."""
        whitening = None if self._colour is None else self._colour.whitening
        return EventCost(
            window,
            self._setting(),
            self._sigmas.innovation,
            self._burn_in,
            self._scalars,
            whitening,
            offset,
            self._jitter.levels(window, self._schedule.innovation_sigma),
        )

    def _colour_after(self, window: Window, fit: EventFit) -> Colour | None:
        """The colour of the noise, after what a fitted event leaves while the needle is shut."""
        shortest = round(SEGMENT / self._constants.interval)
        rest = resting_segments(window, self._burn_in, shortest)
        self._at_rest.add([fit.unfiltered[part] for part in rest])
        self._slow_rail.add([window.inputs[part, 0] for part in rest])
        return self._at_rest.colour(self._colour, self._schedule.innovation_sigma)

    def _temper(self, statistics: PhaseStatistics) -> float:
        """Factor on the variance of an event's innovations.

        Coloured noise of the rail pressure drives the model, too: it does not stay an error of its output. A rail
        that really moves is no noise, but then the innovations are white.
        """
        rail_sigma = self._slow_rail.sigma * self._scale
        is_rail = self._colour is not None and rail_sigma > COLOURED_RAIL * self._noise.rail_pressure
        return max(tempering(statistics), RAIL_TEMPER if is_rail else 1.0)

    def _fit(self, cost: EventCost, first: Linearisation, prior: Belief) -> EventFit | None:
        """Fit the event; after a sudden change from a wide prior, if that explains it much better."""
        if not np.isfinite(first.value):
            return None
        fitter = EventFitter(cost, self._scalars.gate, self._active, theta_limits(self._scale, self._scalars))
        if self._events == 0:
            return fitter.fit(first, prior, FIRST_ITERATIONS)
        score = first.score(prior.covariance)
        if QUICKER_SCORE < score <= CHANGE_SCORE:
            prior = prior.widened(QUICKER * self._scalars.drift(self._scale))
        drift = self._scalars.drift(self._scale)
        prior = prior.widened(self._trend.extra_after(first.standard_scores(prior.covariance), drift))
        fit = fitter.fit(first, prior, ITERATIONS)
        if score <= CHANGE_SCORE:
            return fit
        wide = prior.widened(self._scalars.prior(self._scale))
        # where nothing explained the events before, many steps would be lost on this one
        iterations = ITERATIONS if self._mistrust.lasts else FIRST_ITERATIONS
        other = fitter.fit(fit.linearisation, wide, iterations)
        much_better = other.linearisation.value < fit.linearisation.value - 0.5 * CHANGE_GAIN
        return replace(other if much_better else fit, contradicts=True)

    def _mask(self, window: Window, innovations: NDArray[np.float64]) -> NDArray[np.bool_] | None:
        ended = self._range.masked(window, innovations, self._sigmas, self._burn_in)
        more = bool((ended & ~mask_of(window)).any())
        window = window._replace(masked=ended) if more else window
        found = self._outliers.masked(window, np.where(ended, 0.0, innovations), self._sigmas, self._burn_in)
        return ended if found is None and more else found

    def _is_disturbed_before_openings(self, event: _Explained, recorded: Window) -> bool:
        """Whether something couples into the line pressure before the needle opens that was not taken out.

        recorded: the event with all of it.
        """
        first = event.window.opening - self._edges.longest
        if first <= 0:
            return False
        sigma, theta = event.cost.sigma, event.fit.linearisation.theta

        def left(window: Window) -> NDArray[np.float64]:
            """Innovations in standard deviations, at the fit."""
            cost = self._cost(window, None)
            cost.value(theta)
            counts = cost.innovations / sigma
            counts[: event.cost.burn_in] = 0.0
            return counts

        whole = event.window._replace(output=recorded.output)
        before = left(whole)
        response = left(with_step(whole, first, sigma)) - before
        edge = self._edges.found_after(whole, sigma * before, response, sigma)
        was_known = self._current.pulse is not None
        if edge is None:
            self._current.forget()
            return was_known
        self._current.take_in(whole, edge, left, event.fit.slopes / sigma, self._scalars.prior(self._scale))
        if not was_known and self._current.pulse is not None:
            self._unlearn()
        return not was_known

    def _unlearn(self) -> None:
        """What was learned and said so far was of other line pressures than those that come."""
        self._belief = self._belief.widened(self._scalars.prior(self._scale))
        self._statistics, self._mistrust, self._trend = no_statistics(), Mistrust(), Trend()
        self._colour, self._at_rest = None, RestingNoise(self._constants.interval)
        self._previous = None

    def _is_range_ending_in(self, window: Window) -> bool:
        """Whether the line pressure's range is known to end, after an event.

        What was said of the events in which that showed was said of their clipped samples.
        """
        if self._range.is_new_after(window, self._sigmas):
            self._statistics, self._mistrust = of_standstill(self._statistics), Mistrust()
            self._colour, self._at_rest = None, RestingNoise(self._constants.interval)
        return self._range.is_known

    @property
    def _sigmas(self) -> Sigmas:
        colour = self._colour
        sigma = self._schedule.innovation_sigma if colour is None else colour.sigma
        return Sigmas(sigma, self._noise.line_pressure / self._scale)

    def _refit(self, cost: EventCost, fit: EventFit) -> EventFit:
        """The fit of an event of which less counts than before."""
        fitter = EventFitter(cost, self._scalars.gate, fit.active, theta_limits(self._scale, self._scalars))
        start = cost.linearised(fit.linearisation.theta)
        return replace(fitter.fit(start, fit.prior, ITERATIONS), contradicts=fit.contradicts)

    def _take_in(self, event: _Explained) -> None:
        """The fitted event into statistics and belief, there tempered where its innovations are coloured."""
        innovations = Innovations(event.fit.innovations, event.cost.sigma)
        statistics = event_statistics(event.window, innovations, self._constants.interval, self._healthy)
        here, temper = event.fit.linearisation, self._temper(statistics)
        self._belief = event.fit.prior.updated(here.information / temper, here.vector / temper)
        self._theta, self._active = here.theta, event.fit.active
        self._colour = event.colour
        self._events += 1
        self._statistics = pooled(self._statistics, statistics)

    def _is_better(self, events: Sequence[_Past], in_force: NDArray[np.float64]) -> bool:
        """Whether the new theta does better in events than that in force, (m,)."""
        played = [Rehearsed(one.window, self._setting(one.constants), one.offset) for one in events]
        return is_better(played, self._theta, in_force, self._colour, self._scalars)

    def _frozen(self, window: Window, in_force: NDArray[np.float64]) -> Outcome:
        """Fall back to phi = 0 and forget: what was learned belongs to another line. No event is valid meanwhile."""
        outcome = self._outcome(Adoption.FROZEN, window, in_force)
        found = outcome.objections or (Objection(Reason.MODEL_INADEQUATE, Phase.STANDSTILL),)
        fresh = no_knowledge(self._noise, self._scale, self._scalars)
        self._belief, self._theta, self._active = fresh.belief, fresh.in_force, fresh.active
        self._events = 0
        self._learned_at = ()
        self._previous = None
        knowledge = replace(
            fresh, events=outcome.knowledge.events, statistics=self._statistics, colour=self._colour
        )
        return replace(outcome, knowledge=knowledge, objections=found)

    def _outcome(
        self,
        adoption: Adoption,
        window: Window,
        in_force: NDArray[np.float64],
        doubts: Sequence[Reason] = (),
    ) -> Outcome:
        """What to say of an event; `in_force` (m,) was carried during it, `doubts` arose while it was fitted."""
        return Outcome(
            adoption=adoption,
            knowledge=Knowledge(
                belief=self._belief,
                in_force=(self._theta if adoption is Adoption.ADOPTED else in_force).copy(),
                noise=self._noise,
                active=self._active,
                events=self._events,
                statistics=self._statistics,
                colour=self._colour,
                learned_at=self._learned_at,
                scalars=self._scalars,
            ),
            schedule=self._schedule,
            objections=self._objections(adoption, window, doubts),
            estimate=self._theta.copy(),
            covariance=gated_covariance(self._belief, self._scalars.gate, self._active)
            + np.diag(self._pressure_gains.wear_variance(self._scalars.width))
            + np.diag(self._lag_doubt.variance(self._scalars.width)),
        )

    def _objections(
        self, adoption: Adoption, window: Window, doubts: Sequence[Reason]
    ) -> tuple[Objection, ...]:
        if adoption is Adoption.FAILED:
            return (Objection(Reason.NOT_LEARNED),)
        offset = float(self._theta[Parameter.LINE_PRESSURE_OFFSET]) * self._scale
        lag = float(self._theta[Parameter.SENSOR_LAG]) * LAG_UNIT
        result = objections(self._statistics, offset, lag, self._healthy)
        if self._pressure_gains.is_too_large and Objection(Reason.PRESSURE_OFFSET) not in result:
            result.insert(0, Objection(Reason.PRESSURE_OFFSET))
        if is_worn_beyond_limits(self._theta, self._scalars):
            result.append(Objection(Reason.MODEL_INADEQUATE, Phase.OPEN))
        result.extend(Objection(reason) for reason in doubts)
        if looks_like_inertance(self._open_nozzle_change(window), float(self._theta[Parameter.BULK_MODULUS])):
            result.append(Objection(Reason.AMBIGUOUS_SCALE))
        return tuple(result)

    def _open_nozzle_change(self, window: Window) -> float:
        """N_H with the needle as open as it was in this event, at the steady sac pressure of the rail pressure."""
        widest = int(np.argmax(window.inputs[:, 1]))
        rail_pressure, area = (float(value) for value in window.inputs[widest])
        state = (rail_pressure, 0.0, 0.9 * rail_pressure)
        return nozzle_change(self._theta, state, (rail_pressure, area))[0]

    @property
    def _burn_in(self) -> int:
        return round(BURN_IN / self._constants.interval)

    def _gains(self) -> GainSchedule:
        learned = learned_of(self._theta, self._constants.coefficients, self._scalars)
        sensor, rate = self._constants.sensor, 1.0 / self._constants.interval
        lag = sensor.lag + learned.lag
        every = self._constants.rail_every
        return gain_schedule(learned.coefficients, self._noise, rate, lag, sensor.fraction, every)

    def _setting(self, constants: Constants | None = None) -> Setting:
        constants = constants or self._constants
        sensor = constants.sensor
        return Setting(
            interval=constants.interval,
            substeps=constants.substeps,
            coefficients=constants.coefficients,
            gain=self._schedule.gains[-1].copy(),
            late=sensor.fraction,
            lag=sensor.lag,
            offset=sensor.offset,
        )


def _because(outcome: Outcome, is_clipped: bool, is_disturbed: bool) -> Outcome:
    """An outcome with what is known of the line pressure as the first objection: that is why there are others."""
    if is_disturbed:  # though all else may look right
        reason = Reason.CONTRADICTED
    elif is_clipped and outcome.objections:
        reason = Reason.INPUT_CLIPPED
    else:
        return outcome
    return replace(outcome, objections=(Objection(reason), *outcome.objections))
