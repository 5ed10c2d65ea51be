"""One event fitted from a prior, by Gauss-Newton on the prediction error, and its evidence for the prior.

Every step chooses the gated scalars anew. The evidence is the marginal likelihood, in closed form where the cost is a
parabola (MacKay, Information Theory, Inference, and Learning Algorithms, chapter 28). Innovations a little loud or
coloured cost a model nothing; those of an event at fault pay for their loudness by a broad density.
"""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.evidence import integrate_cost
from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.engine.estimation.belief import ENTER, STAY, Belief, Matrix, Vector, best_subset
from observer_rt.engine.estimation.parameters import NEEDLE_LAW, SCALARS, Alike, Gate, Parameter, Theta
from observer_rt.engine.estimation.phases import PHASES, PhaseStatistics
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.engine.learning.run import EventCost, EventRun
from observer_rt.foundation.units import Ints
from observer_rt.model.effective import LAG_UNIT, LIFT_UNIT, Coefficients

LEAST_LAG = 30e-6  # s, of a line sensor, that shows beside a needle by commands; M: else 20 us are found of none
MOVED_IN_TIME = 20e-6  # s, by which a needle moves at another time: some mm3/ms of a rate; M
BEYOND = 2.0  # nats that may lie beyond limits and the reach of a linearisation; I
NEARLY_WHITE, NEARLY_WHITE_BLOCKS = 1.15, 1.6  # as the tests of adequacy; M

FAR = 10.0  # times the limits, that a mean may be beyond them by linear slopes
HALVINGS = 4  # of a step that does not lower the cost
TOLERANCE = 0.02  # a step that lowers the cost by less, in units of chi2 / 2, is the last
ROUNDING = 1e-9  # by which a step of nothing may seem to raise the cost [chi2 / 2]
AGREEMENT = 0.05  # of expected and actual cost [chi2 / 2]: within it a linearisation is not repeated
LOSSES = (Parameter.CONTROL_FLOW, Parameter.LANDING_BOUNCE)  # as far as the file has any
LATE_OR_BOUNCE = Alike(Parameter.SENSOR_LAG, Parameter.LANDING_BOUNCE, MOVED_IN_TIME / LAG_UNIT)
_LAG = int(Parameter.SENSOR_LAG)


@dataclass(frozen=True, eq=False)
class Limits:
    """Bounds, longest step (m,) and gate of theta (m,); below `least_lag` the line sensor only looks late."""

    lowest: Vector
    highest: Vector
    longest_step: Vector
    gate: Gate = SCALARS.gate
    least_lag: float = 0.0

    def gate_of_lag(self, least: float) -> Gate:
        """The gate, through which a lag of the line sensor goes from this one on."""
        return replace(self.gate, lowest={**self.gate.lowest, _LAG: least})

    def refuse_far(self, mean: Vector) -> None:
        """Raises numpy.linalg.LinAlgError for a mean (m,) of a belief that no event could bring back."""
        if not np.all(np.abs(mean) <= FAR * np.maximum(np.abs(self.lowest), np.abs(self.highest))):
            raise np.linalg.LinAlgError("the mean of a belief lies beyond all limits")


def theta_limits(c: Coefficients, needle: NeedleLaw | None = None, is_fitted: bool = False) -> Limits:
    """Limits of theta (m,); a pilot valve may lose all of its flow, a needle by commands its bounce, but not more.

    The needle's own numbers are gated only where it answers commands, which tell of them. There, what a fitted line
    leaves looks like a late sensor, and delays of the needle make up for it.
    """
    lowest, highest = SCALARS.bounds(c.pressure_scale)
    lowest[Parameter.CONTROL_FLOW] = -c.line.control_flow / c.line.a1
    lowest[Parameter.LANDING_BOUNCE] = 0.0 if needle is None else -needle.landing_bounce / LIFT_UNIT
    gated = {
        column: float(lowest[column]) if column in LOSSES else least
        for column, least in SCALARS.gate.lowest.items()
        if needle is not None or column not in NEEDLE_LAW.columns
    }
    gate = replace(SCALARS.gate, lowest=gated, alike=None if needle is None else LATE_OR_BOUNCE)
    least_lag = LEAST_LAG / LAG_UNIT if is_fitted and needle is not None else 0.0
    return Limits(lowest, highest, SCALARS.longest_step(c.pressure_scale), gate, least_lag)


@dataclass(frozen=True, eq=False)
class Fit:
    """An event fitted: run at the estimate, and active columns; if stuck, its parabola is level beside the prior."""

    run: EventRun
    active: frozenset[int]
    stuck: bool = False  # whether no step was short enough to lower what slopes promise to lower, as beside a kink


@dataclass(frozen=True)
class EventFitter:
    """Fits one event from any prior; active: the gated columns in use; unused: columns that stay 0."""

    cost: EventCost
    active: frozenset[int]
    limits: Limits
    unused: Ints = field(default_factory=lambda: np.empty(0, np.int64))

    def fit(self, start: EventRun, prior: Belief, iterations: int) -> Fit:
        """Minimise cost and distance from the prior, in at most so many steps from `start`.

        The last step is one that lowers the total as its slopes say. One that does not lower it is halved, and at
        last not taken. A sensor that only looks late counts as in time. Raises LinAlgError when singular.
        """
        fit = self._fit(start, prior, iterations, self.limits.gate)
        if _LAG in fit.active and fit.run.theta[_LAG] < self.limits.least_lag:
            return self._fit(start, prior, iterations, self.limits.gate_of_lag(float(self.limits.highest[_LAG])))
        return fit

    def _fit(self, start: EventRun, prior: Belief, iterations: int, gate: Gate) -> Fit:
        prior_information = prior.information
        prior_vector = prior_information @ prior.mean

        def total(run: EventRun) -> float:
            return run.value + 0.5 * prior.distance(run.theta)

        here, active, stuck = start, self.active, False
        here_total = total(here)
        for _ in range(iterations):
            covariance, _ = inverse_of(prior_information + here.information)
            joint = covariance @ (prior_vector + here.vector)
            best, chosen = best_subset(joint, covariance, gate, active)
            best[self.unused] = 0.0
            target = self._within_reach(here.theta, best)
            trial, promised = self.cost.at(target, here), here.expected(target)
            if abs(trial.value - promised) < AGREEMENT and total(trial) <= here_total + ROUNDING:
                here, active = trial, chosen
                break
            left_out = [column for column in gate.columns if here.theta[column] != 0.0 and column not in chosen]
            saved = 0.5 * sum(STAY if column in active else ENTER for column in left_out)  # so much dearer may it be
            ahead, limit = self.cost.linearised(target, trial), here_total + saved
            for _ in range(HALVINGS):
                if total(ahead) < limit:
                    break
                ahead, limit = self.cost.linearised(0.5 * (here.theta + ahead.theta), ahead), here_total
            before, ahead_total = here_total, total(ahead)
            if not ahead_total < limit:
                stuck = here_total - (promised + 0.5 * prior.distance(target)) >= TOLERANCE
                here = self.cost.linearised(here.theta, here)
                active = frozenset(column for column in gate.columns if here.theta[column] != 0.0)
                break
            here, here_total, active = ahead, ahead_total, chosen
            if abs(before - here_total) < TOLERANCE:
                break
        if stuck:
            here = replace(here, gradient=prior_vector - prior_information @ here.theta)
        return Fit(here, active, stuck)

    def _within_reach(self, here: Vector, target: Vector) -> Vector:
        length = np.max(np.abs(target - here) / self.limits.longest_step)
        reached = here + (target - here) / max(1.0, float(length))
        return np.asarray(np.clip(reached, self.limits.lowest, self.limits.highest), np.float64)


class Evidence(NamedTuple):
    """Logarithm of the marginal likelihood, but for what all priors share; mean (k,), covariance (k, k) after it."""

    log: float
    theta: Theta
    covariance: Matrix


def evidence_of(run: EventRun, prior: Belief, limits: Limits, columns: Ints) -> Evidence:
    """Integrates exp(-cost) over a Gaussian prior of columns (k,), the cost a parabola round where it was run.

    A promise beyond the limits, or further than slopes hold, counts for `BEYOND`. Raises LinAlgError when singular.
    """
    return Evidence(*integrate_cost(run, limits, prior, columns, BEYOND))


def nearly_white(clipped: PhaseStatistics, temper: float, healthy: Healthy) -> float:
    """Nats by which innovations are more likely, being nearly white, by sums over clipped ones; temper: scatter."""
    squares, count = _sums(clipped)
    squares /= temper
    usual = np.concatenate(((NEARLY_WHITE * healthy.variance)[None], NEARLY_WHITE_BLOCKS * healthy.colour.T))
    loud = np.minimum(np.maximum(squares / np.maximum(count, 1e-9), 1.0), usual)
    return float(_gain(squares, loud, count).max(axis=0).sum())


def at_fault(statistics: PhaseStatistics, temper: float) -> float:
    """Cost [nats] of an event at fault, by sums over innovations in standard deviations."""
    squares, count = _sums(statistics)
    squares /= temper
    white = 0.5 * squares[0]
    loud = np.maximum(squares / np.maximum(count, 1e-9), 1.0)
    costs = white - _gain(squares, loud, count) + 0.5 * np.log(np.maximum(count, 1.0))
    loudest = math.log(len(costs)) - np.logaddexp.reduce(-costs, axis=0)
    # as likely white as not in every phase, but not in all
    anyhow = float((math.log(2.0) - np.logaddexp(-white, -loudest)).sum())
    nowhere = float(white.sum()) + PHASES * math.log(2.0)
    return anyhow - math.log(-math.expm1(anyhow - nowhere)) + math.log1p(-(2.0**-PHASES))


def _gain(squares: Matrix, loud: Matrix, count: Matrix) -> Matrix:
    """Nats by which so many squares are likelier if louder than noise; 0 without any."""
    return 0.5 * squares * (1.0 - 1.0 / loud) - 0.5 * count * np.log(loud)


def _sums(statistics: PhaseStatistics) -> tuple[Matrix, Matrix]:
    """Squares and their numbers (1 + len(BLOCKS), PHASES), of samples and of blocks of every length."""
    squares = np.concatenate((statistics.squares[None], statistics.block_squares.T))
    return squares, np.concatenate((statistics.samples[None], statistics.blocks.T))
