"""Evaluation in two passes: learning goes forward, then every injection is evaluated with the knowledge from all.

So the first injections are known as well as the last. A live run cannot do that.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.desk.evaluation.curves import InjectionResult, RateCurves
from observer_rt.desk.evaluation.evaluate import Evaluation
from observer_rt.desk.evaluation.smoothing import TaughtEvent, smoothed
from observer_rt.desk.evaluation.spool import Spool
from observer_rt.engine.estimation.gain import GainSchedule, NoiseLevels
from observer_rt.engine.estimation.gating import Belief, GatedBelief, best_subset
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.fitting import theta_limits
from observer_rt.engine.learning.indicators import indicators_of
from observer_rt.engine.learning.interval import (
    Resimulation,
    rate_sigma,
    resimulated,
    volume_budget,
    volume_in,
    volume_interval,
)
from observer_rt.engine.learning.knowledge import EventLearner, Knowledge, Outcome
from observer_rt.engine.learning.learned_injector import shrink
from observer_rt.engine.learning.learned_range import (
    FLOW_KNOWN,
    UNSEEN,
    EventPoint,
    extrapolation_sigma,
    operating_point,
)
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.injector import EVENTS_REQUIRED, make_learner
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.engine.stream.state import Constants, Reason, State
from observer_rt.foundation.units import Z_95
from observer_rt.model.accuracy import StatedAccuracy

Matrix = NDArray[np.float64]
_LIFTED = frozenset({Reason.TOO_FEW_EVENTS, Reason.OUTSIDE_LEARNED_RANGE, Reason.REVISED})
"""Reasons of the moment: what later injections taught may lift them."""
_MOST_POINTS = 64  # operating points among which a place is near


class _Run(NamedTuple):
    """What an event is run again with."""

    window: Window
    setting: Setting


@dataclass(frozen=True, eq=False)
class _Event:
    """An event that was learned from, as it is run again.

    taught: beliefs about it; start: position of its first sample; systematic: share of a volume that the model gets
    wrong, but for places far from all learned at; unknown: more of it; unseen: variances (m,) by a doubtful lag;
    passed: without objections.
    """

    taught: TaughtEvent
    start: int
    samples: int
    point: EventPoint
    noise: NoiseLevels
    by_coil: Matrix | float
    systematic: float
    unknown: float
    calibration: StatedAccuracy
    unseen: Theta
    passed: bool


@dataclass(frozen=True, eq=False)
class _Again:
    """An event run again with theta (m,), which has an error of this covariance (m, m); rails: of events [p_0]."""

    event: Resimulation
    theta: Theta
    covariance: Matrix
    rails: Sequence[float]


class SecondLook:
    """Keeps what a learner makes of every event, and revises the results of all when the last one is there."""

    def __init__(self) -> None:
        self._events: list[_Event] = []
        self._runs: Spool[_Run] = Spool()
        self._active: frozenset[int] = frozenset()

    def learner(self, fitted: BenchInjector, constants: Constants, knowledge: Knowledge) -> EventLearner:
        """Learner of an injector that is listened to, as of `LearnerFactory`."""
        return _EventListener(make_learner(fitted, constants, knowledge), self)

    def take(self, outcome: Outcome, interval: float) -> None:
        """Keep an event from which something was learned; interval: of its samples [s]."""
        state = outcome.knowledge.state
        again, window, setting = outcome.resimulated, outcome.window, outcome.setting
        if outcome.prior is None or again is None or window is None or setting is None:
            return
        point = operating_point(window, interval)
        far = UNSEEN * extrapolation_sigma(point, state.learned.learned_at[:-1])
        self._runs.append(_Run(window, setting))
        self._events.append(
            _Event(
                TaughtEvent(outcome.prior, state.learned.belief),
                round(window.clock.time / interval),
                window.output.size,
                point,
                state.noise,
                state.energizing.current.unsure,
                math.sqrt(max(again.systematic**2 - far**2, 0.0)),
                again.unknown,
                again.calibration,
                state.lag_doubt.variance,
                not outcome.forward,
            )
        )
        self._active = state.learned.active

    def revise(self, evaluations: Sequence[Evaluation]) -> None:
        """Give every injection of the evaluations the rate, mass and indicators that all events together teach."""
        if sum(event.passed for event in self._events) <= EVENTS_REQUIRED:
            return
        beliefs = smoothed([event.taught for event in self._events])
        starts = [event.start for event in self._events]
        chosen = np.unique(np.linspace(0, len(starts) - 1, _MOST_POINTS).round().astype(int))
        learned_at = [self._events[number].point for number in chosen]
        for evaluation in evaluations:
            pairs = list(zip(evaluation.injections, evaluation.curves, strict=True))
            evaluation.revise(self._revised(*pair, starts, beliefs, learned_at) for pair in pairs)

    def _revised(
        self,
        result: InjectionResult,
        curves: RateCurves,
        starts: Sequence[int],
        beliefs: Sequence[Belief],
        learned_at: Sequence[EventPoint],
    ) -> tuple[InjectionResult, RateCurves]:
        """An injection by its event run again; as it was where that is not known."""
        report = result.report
        number = bisect_right(starts, report.start_position) - 1
        if number < 0 or report.end_position >= starts[number] + self._events[number].samples:
            return result, curves
        again = self._again(number, beliefs[number], learned_at)
        window = slice(report.start_position - starts[number], report.end_position - starts[number] + 1)
        if curves.estimated.size != window.stop - window.start:
            return result, curves
        return _by_event(result, curves, again, window, self._events[number].passed)

    def _again(self, number: int, belief: Belief, learned_at: Sequence[EventPoint]) -> _Again:
        """An event run with what all events teach of it."""
        event, run = self._events[number], self._runs[number]
        gate = theta_limits(run.setting.coefficients).gate
        belief = shrink(belief)
        theta, active = best_subset(belief.mean, belief.covariance, gate, self._active)
        gated = GatedBelief(belief, gate, active)
        carried = gated.carried(theta) + event.by_coil
        again = resimulated(run.window, run.setting, event.noise, theta, carried, carried)
        far = UNSEEN * extrapolation_sigma(event.point, learned_at)
        unknown = min(event.unknown, self._events[-1].unknown)  # later events told
        systematic = math.hypot(event.systematic, far)
        again = replace(again, systematic=systematic, unknown=unknown, calibration=event.calibration)
        rails = [point.rail_pressure for point in learned_at]
        return _Again(again, theta, gated.covariance + np.diag(event.unseen), rails)


class _EventListener:
    """A learner whose outcomes a second look keeps."""

    def __init__(self, learner: Learner, look: SecondLook) -> None:
        self._learner, self._look = learner, look

    @property
    def schedule(self) -> GainSchedule:
        """Gains of the live x~."""
        return self._learner.schedule

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Learn from one event, during which `in_force` (m,) was carried, and have the outcome kept."""
        outcome = self._learner.learn(window, standstill, in_force, constants)
        self._look.take(outcome, self._learner.state.interval)
        return outcome


def _by_event(
    result: InjectionResult, curves: RateCurves, again: _Again, window: slice, passed: bool
) -> tuple[InjectionResult, RateCurves]:
    """An injection, and its curves, by an event run again, in a window of that; passed: the event."""
    rate, sigma = again.event.run.rate[window], rate_sigma(again.event, window)
    report = _report_by(result.report, again, window, passed and set(result.report.reasons) <= _LIFTED)
    measured = curves.reference
    return replace(
        result,
        report=report,
        rate_rmse=math.nan if measured is None else float(np.sqrt(np.mean((rate - measured) ** 2))),
        rate_ci95_halfwidth=Z_95 * float(np.mean(sigma[rate != 0.0])) if rate.any() else math.nan,
    ), replace(curves, estimated=rate, sigma=sigma)


def _report_by(report: InjectionReport, again: _Again, window: slice, is_judged: bool) -> InjectionReport:
    """A report by an event run again; is_judged: it only lacked knowledge, and is valid by the knowledge of now."""
    volume, budget = volume_in(again.event, window), volume_budget(again.event, window)
    low, high = volume_interval(again.event, window, math.nan)
    report = replace(
        report,
        volume=volume,
        mass=volume * report.density,
        mass_ci95=(low * report.density, high * report.density),
        peak_rate=float(again.event.run.rate[window].max()),
        indicators=indicators_of(
            again.theta,
            again.covariance,
            report.middle_x,
            report.middle_u,
            again.event.calibration,
            again.rails,
        ),
        budget=budget,
    )
    if not is_judged:
        return report
    is_known = budget.parameters <= FLOW_KNOWN * volume
    reason = Reason.NONE if is_known else Reason.OUTSIDE_LEARNED_RANGE
    return replace(report, valid=is_known, reason=reason, further=(), state=State.ADAPTED)
