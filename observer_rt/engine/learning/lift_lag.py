"""Lag of the needle lift: asked of events that are refused, and of those that only large laws explain.

A lift behind a slow sensor or a filter shows openings and closings late, against both pressures. No parameter does
the same, but laws of nozzle and seat with the area or in time come near, most of all at few operating points, with a
mass that is wrong. The event is fitted again, from nothing known, with a lift that is so much earlier as explains
most. The lag found is reported, never undone: a lift moved by what another cause has done would be valid and wrong.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import HUBER
from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Setting, Window, innovations
from observer_rt.engine.estimation.scalars import SCALARS, SERVO, WEIGHTS, Theta, learned_of
from observer_rt.engine.learning.adequacy import RELEVANT_VARIANCE, Objection
from observer_rt.engine.learning.fitting import EventFit, EventFitter, freed, theta_limits
from observer_rt.engine.stream.state import Reason
from observer_rt.model.network import GROUPS

UNEXPLAINED = (Reason.MODEL_INADEQUATE, Reason.CONTRADICTED)
STEP = 5e-6  # s, either way, by which the lift is moved for a slope
FARTHEST = 30e-6  # s, by which one step goes at most
USUAL = 20e-6  # s, of an amplifier or a filter ahead of a converter
# Held: a pilot valve, what the needle displaces, and of the network's neurons all but those over the pressure drop.
_HELD = [*SERVO, *WEIGHTS[GROUPS[0].neurons :]]
CLOSE = 1e-6  # s: no more steps
STEPS = 4
SHORTER = 0.4  # a step that explained no more
FIRST_ITERATIONS, ITERATIONS = 8, 3
LEAST = 3e-6  # s, that is reported
ENOUGH = 16.0  # chi2 an event, that a lag must explain: 4 sigma
# Sum of squares of the held over their prior's sigmas: late lifts come to 20 to 150, laws of real injectors to 40.
LARGE = 16.0
# chi2 an event, that a lag must explain instead of laws: those of real injectors are explained by it to 70 at most.
INSTEAD = 100.0
MOST_OF_IT = 0.6  # share of what is beyond noise
NEARLY_ALL = 0.85  # the same, where what is left would still be too much, as on a fitted line
# What one lag for all may leave, chi2 an event, or of what is explained: another injector seems late by more at some
# rail pressures than at others, a sensor does not.
MISSED, MISSED_SHARE = 10.0, 0.015
# Pa, by which the chamber may be at another pressure than the file says: a sac that rests at it fills sooner, or
# later, as if the lift were late, or early.
CHAMBERS = (-4e6, 10e6, 20e6)
# Events that are asked, then one of so many refused, explained: asking takes ten times as long as learning.
SOON, SELDOM, RARELY = 6, 8, 64
REMEMBERED = 0.85  # weight of the sums before this event


@dataclass(frozen=True)
class LiftLag:
    """Lag [s] by which a lift seems late; chi2 of so many innovations beyond noise, without that and with it.

    missed: how much more is left by the lag that was expected; by_chamber: by another chamber pressure instead.
    """

    lag: float
    without: float
    left: float
    samples: int
    missed: float = 0.0
    by_chamber: float = math.inf

    def explains_instead(self, left_by_laws: float) -> bool:
        """Whether it explains an event as well as laws of nozzle and seat, which leave so much chi2 beyond noise."""
        return self.without - self.left > INSTEAD and self.left <= left_by_laws + ENOUGH


def has_large_laws(theta: Theta, sigmas: NDArray[np.float64]) -> bool:
    """Whether laws that a late lift looks like are large, over sigmas of their prior (both by parameter)."""
    return float(np.sum((theta[_HELD] / sigmas[_HELD]) ** 2)) > LARGE


def lift_lag_of(
    window: Window, setting: Setting, cost_of: Callable[[Window], EventCost], expected: float = USUAL
) -> LiftLag:
    """The lag of its lift that explains an event best, all else fitted from the prior.

    But for a pilot valve, what the needle displaces, and laws of nozzle and seat that are others with the area or in
    time, which are the file's: a late lift looks like them.

    cost_of: a window's cost; expected: lag [s] from which it is sought, too, for with a model that is far off the
    slope at 0 leads nowhere. Raises numpy.linalg.LinAlgError when singular.
    """
    scale = setting.coefficients.pressure_scale
    limits, wide = theta_limits(setting.coefficients), SCALARS.prior(scale)
    wide[_HELD] = SCALARS.drift(scale)[_HELD]
    prior = prior_belief(np.zeros(SCALARS.width), np.diag(wide**2))

    def fitted(lag: float, theta: Theta, active: frozenset[int], iterations: int, event: Window = window) -> _LagFit:
        cost = cost_of(_earlier(event, lag, setting.interval))
        fitter = EventFitter(cost, active, limits)
        return _LagFit(lag, cost, fitter.fit(cost.linearised(theta), prior, iterations))

    zero = np.zeros(SCALARS.width)
    first, other = (fitted(lag, zero, frozenset(), FIRST_ITERATIONS) for lag in (0.0, expected))
    best = other if other.excess < first.excess else first
    step = _step(window, setting, best, wide)
    for _ in range(STEPS):
        ahead = fitted(best.lag + step, best.fit.linearisation.theta, best.fit.active, ITERATIONS)
        if ahead.excess < best.excess:
            best, step = ahead, _step(window, setting, ahead, wide)
        else:
            step *= SHORTER
        if abs(step) < CLOSE:
            break
    by_chamber = first.excess
    if setting.coefficients.line.further == 0:  # a line of cells has a small sac
        fits = (_in_chamber(window, rise / scale) for rise in CHAMBERS)
        by_chamber = min(fitted(0.0, zero, frozenset(), FIRST_ITERATIONS, moved).excess for moved in fits)
    missed = other.excess - best.excess
    return LiftLag(best.lag, first.excess, best.excess, best.cost.terms, missed, by_chamber)


@dataclass(frozen=True)
class LiftLagSearch:
    """Evidence of recent events for a lag: sums of the fields of `LiftLag`.

    asked: events in a row that are refused, or, `by_laws`, that only large laws explain.
    """

    asked: int = 0
    by_laws: bool = False
    events: float = 0.0
    samples: float = 0.0
    without: float = 0.0
    left: float = 0.0
    lags: float = 0.0
    missed: float = 0.0
    by_chamber: float = 0.0

    def after(
        self, objections: Sequence[Objection], left_by_laws: float | None, ask: Callable[[float], LiftLag]
    ) -> tuple["LiftLagSearch", tuple[Objection, ...]]:
        """Adds an event, if its turn is to be asked; returns the objections to it, too.

        Objections that a late or early lift explains get that reason. An event that is explained by laws gets one,
        where a lag explains it as well. left_by_laws: chi2 beyond noise, None if they are small; ask: by the lag [s]
        that is expected.
        """
        inadequate = [o for o in objections if o.reason in UNEXPLAINED and o.phase is not None]
        left = None if inadequate else left_by_laws
        if not inadequate and left is None:
            return replace(self, asked=0), tuple(objections)
        by_laws = left is not None
        turn = self.asked + 1 if by_laws is self.by_laws else 1
        search = replace(self, asked=turn, by_laws=by_laws)
        if turn <= SOON or turn % (RARELY if by_laws else SELDOM) == 0:
            try:
                event = ask(search._lag or USUAL)
            except np.linalg.LinAlgError:
                return search, tuple(objections)
            if left is not None and not event.explains_instead(left):
                return LiftLagSearch(turn, by_laws), tuple(objections)
            search = search._with_event(event)
        lag = search.accepted_lag
        if lag is None:
            return search, tuple(objections)
        reason = Reason.LIFT_SENSOR_LAG if lag > 0.0 else Reason.TIME_BASE
        if not inadequate:
            return search, (*objections, Objection(reason))
        return search, tuple(replace(o, reason=reason) if o in inadequate else o for o in objections)

    @property
    def accepted_lag(self) -> float | None:
        """The lag of the lift [s] that explains recent events, negative where it is early; None without."""
        explained, enough = self.without - self.left, ENOUGH * self.events
        if self.without < enough or explained < max(enough, MOST_OF_IT * self.without):
            return None
        is_adequate = self.left <= (RELEVANT_VARIANCE - 1.0) * self.samples
        if not (is_adequate or explained > NEARLY_ALL * self.without):
            return None
        if self.by_chamber <= self.left:
            return None
        is_alike = self.missed <= max(MISSED * self.events, MISSED_SHARE * explained)
        return self._lag if is_alike and abs(self._lag) > LEAST else None

    @property
    def _lag(self) -> float:
        """Lag [s] of recent events, by what it explains in each; 0 without."""
        explained = self.without - self.left
        return self.lags / explained if explained > 0.0 else 0.0

    def _with_event(self, event: LiftLag) -> "LiftLagSearch":
        explained = event.without - event.left
        if not math.isfinite(explained):
            return self
        return LiftLagSearch(
            self.asked,
            self.by_laws,
            REMEMBERED * self.events + 1.0,
            REMEMBERED * self.samples + event.samples,
            REMEMBERED * self.without + event.without,
            REMEMBERED * self.left + event.left,
            REMEMBERED * self.lags + explained * event.lag,
            # what others expected, if there were any
            REMEMBERED * self.missed + (event.missed if self.events else 0.0),
            REMEMBERED * self.by_chamber + event.by_chamber,
        )


@dataclass(frozen=True)
class _LagFit:
    """An event fitted with its lift so much [s] earlier."""

    lag: float
    cost: EventCost
    fit: EventFit

    @property
    def excess(self) -> float:
        """chi2 beyond that of noise."""
        return self.cost.beyond_noise(self.fit.linearisation.value)


def _earlier(window: Window, lag: float, interval: float) -> Window:
    """The event with its lift `lag` [s] earlier, on straight lines between the samples."""
    samples, area = lag / interval, window.inputs[:, 1]
    places = np.arange(area.size)
    moved = np.interp(places + samples, places, area)
    resting = window.resting[np.clip(places + round(samples), 0, area.size - 1)]
    inputs = np.column_stack([window.inputs[:, 0], moved])
    return window._replace(inputs=inputs, resting=resting, knots=np.empty((0, 2)))


def _in_chamber(window: Window, rise: float) -> Window:
    """The event with all pressures over those of a chamber whose pressure is so much higher [p_0]."""
    start = window.start.copy()
    start[[0, -1]] -= rise
    inputs = np.column_stack([window.inputs[:, 0] - rise, window.inputs[:, 1]])
    return window._replace(inputs=inputs, output=window.output - rise, start=start)


def _step(window: Window, setting: Setting, here: _LagFit, prior: NDArray[np.float64]) -> float:
    """Further lag [s] to take off the lift, by the slope of the innovations freed of what theta does."""
    learned = learned_of(here.fit.linearisation.theta, setting.coefficients)
    moved = []
    for step in (STEP, -STEP):
        errors = np.empty(len(window.output))
        innovations(_earlier(window, here.lag + step, setting.interval), setting, learned, errors)
        moved.append(here.cost.whitened(errors))
    first, sigma = here.cost.burn_in, here.cost.sigma
    direction = (moved[0] - moved[1])[first:] / (2.0 * STEP * sigma)
    direction, _ = freed(direction, here.fit.slopes[first:] / sigma, prior)
    length = float(direction @ direction)
    if not length > 0.0:
        return 0.0
    left = np.clip(here.fit.innovations[first:] / sigma, -HUBER, HUBER)
    return float(np.clip(-(direction @ left) / length, -FARTHEST, FARTHEST))
