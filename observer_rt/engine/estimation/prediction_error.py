"""The cost of prediction-error learning: innovations of one event, whitened and robustly weighted.

A high pass, which takes their slow part away, and an autoregressive filter make coloured innovations white.
"""

import math
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.learning.whitening import NO_HIGH_PASS, robust_cost, weigh, whiten
from observer_rt.core.model.needle import NEEDLE_JITTER, NEEDLE_NUMBERS
from observer_rt.engine.estimation.healthy_course import expected_in, needle_course
from observer_rt.engine.estimation.predictor import (
    NO_RATE,
    NO_SLOPES,
    Setting,
    Window,
    innovations,
    innovations_with_sensitivity,
)
from observer_rt.engine.estimation.scalars import EVERY, LAWLESS, NEEDLE_LAW, Parameter, learned_of
from observer_rt.engine.estimation.shot_delays import JITTER_SIZE, ShotDelays
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape

MOST_RUNS = 4  # of an event, until its shots are as late as explains most
MOST_JITTER, NEAR_JITTER = 3.0, 0.3  # standard deviations: largest move between two runs, and largest linear one
NONE_MASKED = np.empty(0, np.bool_)
OFFSET_SIGMA = 0.2 * MEGAPASCAL  # of the mean difference at rest between line and rail pressure
INFORMED = 1e-2  # share of the belief's information, below which an event says nothing in a direction
_OFFSET, _GAIN = int(Parameter.LINE_PRESSURE_OFFSET), int(Parameter.LINE_PRESSURE_GAIN)


@dataclass(frozen=True, eq=False)
class Whitening:
    """The filter (1 - z)/(1 - theta z) (1 + a_1 z + .. + a_p z^p), z the delay of one sample."""

    forgetting: float | None  # theta; None: no high pass
    taps: NDArray[np.float64]  # a (p,)

    def of(self, values: NDArray[np.float64], masked: NDArray[np.bool_] = NONE_MASKED) -> NDArray[np.float64]:
        """Innovations (n,) or their slopes (n, m), whitened; the filter is linear, and the same for both.

        The first value becomes 0, as that of innovations is. masked: (n,) where there is no value, or (0,): the value
        that is expected there is taken, and 0 comes out until all taps lie on values again.
        """
        columns = values.reshape(values.shape[0], -1)
        result = np.empty_like(columns)
        forgetting = NO_HIGH_PASS if self.forgetting is None else self.forgetting
        whiten(columns, masked, forgetting, self.taps, result)
        return result.reshape(values.shape)


def forgetting_of(time_constant: float, interval: float) -> float:
    """theta of a high pass with a time constant [s] at a sample interval [s]."""
    return math.exp(-interval / time_constant)


@dataclass(frozen=True)
class Linearisation:
    """Cost of an event round theta: value, gradient (m,) and Gauss-Newton information (m, m).

    slopes (n, m): of the whitened innovations; jitter, delays: as of `EventCost`.
    """

    theta: NDArray[np.float64]
    value: float
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    slopes: NDArray[np.float64] = field(default_factory=lambda: NO_SLOPES)
    jitter: NDArray[np.float64] = field(default_factory=lambda: NO_RATE)
    delays: ShotDelays | None = None

    @property
    def vector(self) -> NDArray[np.float64]:
        """information @ (the minimum of the quadratic approximation), (m,)."""
        return self.information @ self.theta - self.gradient

    def expected(self, theta: NDArray[np.float64]) -> float:
        """The cost at another theta (m,) by the quadratic approximation."""
        step = theta - self.theta
        return self.value + float(self.gradient @ step) + 0.5 * float(step @ self.information @ step)

    def moved(self, theta: NDArray[np.float64], value: float) -> "Linearisation":
        """Quadratic approximation expanded round another theta (m,), where the cost is `value`."""
        gradient = self.gradient + self.information @ (theta - self.theta)
        return replace(self, theta=theta, value=value, gradient=gradient)

    def tempered(self, factor: float) -> "Linearisation":
        """Linearisation of the cost divided by a factor."""
        value, gradient, information = self.value / factor, self.gradient / factor, self.information / factor
        return replace(self, value=value, gradient=gradient, information=information)

    def score(self, covariance: NDArray[np.float64]) -> float:
        """Score test of a belief with this covariance (m, m) and its mean here: chi2 over its degrees of freedom.

        The expected value is 1 when the belief is right. Only directions that the event informs count as degrees of
        freedom: parameters that it cannot separate, or does not touch, add none. The sensor's gain, which is held,
        is left out.
        """
        tested = np.arange(covariance.shape[0]) != _GAIN
        before, _ = inverse_of(covariance[tested][:, tested])
        information, gradient = self.information[tested][:, tested], self.gradient[tested]
        weights, _ = inverse_of(information + INFORMED * before)
        after, _ = inverse_of(information + before)
        chi2 = float((gradient @ weights) @ before @ (after @ gradient))
        return float(chi2 / max(gradient.size - INFORMED * np.vdot(weights, before), 1.0))


class EventCost:
    """J(theta) = robust sum of (e~/sigma)^2 / 2 over one event.

    Innovations of the first `burn_in` samples do not count: x~ started with another theta. Coloured ones and their
    slopes are whitened first; a high pass hides the sensor's offset, so the offset at rest is counted beside them.
    Innovations of noisier samples are divided by their level. On a line of cells means over its `resolved` count, as
    in a fit: else the nozzle would make up for what cells do to shorter waves.
    """

    def __init__(
        self,
        window: Window,
        setting: Setting,
        sigma: float,
        burn_in: int,
        whitening: Whitening | None = None,
        offset: float | None = None,
        levels: NDArray[np.float64] | None = None,
        temper: float = 1.0,
        shape: HealthyShape | None = None,
    ) -> None:
        """sigma: standard deviation of white innovations [p_0]; whitening: of coloured ones, None if they are white.

        offset: mean of line over rail pressure at rest [p_0], None if no rest was seen; levels: (n,) factors by which
        samples are noisier than sigma, None: 1; temper: divisor of J; shape: mean innovation of the healthy injector,
        which is taken out, None: 0.
        """
        self._window = window
        self._setting = setting
        self._whitening = whitening
        self._levels = levels
        self._offset, self._offset_weight = 0.0, 0.0
        self._rail_pressure = float(window.inputs[:, 0].mean())
        if whitening is not None and whitening.forgetting is not None and offset is not None:
            self._offset = offset
            self._offset_weight = (setting.coefficients.pressure_scale / OFFSET_SIGMA) ** 2
        self.sigma = sigma
        self.burn_in = burn_in
        self.temper = temper
        self._shape = shape
        self._expected: NDArray[np.float64] | None = None
        if shape is not None and window.needle is None:
            self._expected = expected_in(shape, window, setting.coefficients, setting.interval)
        self._together: int = max(1, round(setting.coefficients.line.resolved / setting.interval))
        self.slopes = self.unfiltered_slopes = NO_SLOPES
        """Slopes (n, m) of the innovations, whitened and as they are, where J was last linearised."""
        self.unfiltered = self.innovations = NO_RATE
        self.columns = EVERY
        """Columns of theta by which slopes are computed; the others are 0."""
        self.jitter = np.zeros(window.shot_columns)
        """Delays of the shots beyond those of theta, (2 shots,) in standard deviations, that explain most."""
        self.delays: ShotDelays | None = None
        """Delays of the shots where J was last linearised; None where the lift is recorded, or J is not finite."""

    def without_laws(self) -> "EventCost":
        """A copy of the cost in which slopes by the network's weights are 0, and no shot is late."""
        lawless = copy(self)
        lawless.columns, lawless.jitter = LAWLESS, np.zeros_like(self.jitter)
        return lawless

    @property
    def terms(self) -> int:
        """Number of squares that J sums."""
        return (self._window.output.size - self.burn_in) // self._together

    def offset_cost(self, theta: NDArray[np.float64]) -> float:
        """Part of J, before it is divided by `temper`, of line over rail pressure at rest by theta (m,)."""
        return 0.5 * self._offset_weight * self._offset_error(theta) ** 2

    def value(self, theta: NDArray[np.float64]) -> float:
        """J(theta), inf where the prediction is not finite; leaves the innovations behind."""
        self.unfiltered = np.empty(self._window.output.size)
        if self.jitter.size:
            self._settle_shots(theta)
        else:
            learned = learned_of(theta, self._setting.coefficients)
            innovations(self._window, self._setting, learned, self.unfiltered)
            self._whiten()
        return self._cost(theta)

    def linearised(self, theta: NDArray[np.float64]) -> Linearisation:
        """J round theta (m,); leaves the innovations and their slopes (n, m) behind."""
        gradient = np.zeros(theta.size)
        information = np.zeros((theta.size, theta.size))
        self._follow(theta)
        weigh(self.innovations, self.slopes, self.burn_in, self.sigma, self._together, gradient, information)
        if self.delays is not None:
            gradient += self.delays.by_theta.T @ self.jitter
            information += self.delays.by_theta.T @ self.delays.by_theta
        value = self._cost(theta)
        by_offset = np.zeros(theta.size)
        by_offset[_OFFSET], by_offset[_GAIN] = 1.0, self._rail_pressure
        gradient += self._offset_weight * self._offset_error(theta) * by_offset
        information += self._offset_weight * np.outer(by_offset, by_offset)
        gradient, information = gradient / self.temper, information / self.temper
        return Linearisation(theta, value, gradient, information, self.slopes, self.jitter, self.delays)

    def whitened(self, values: NDArray[np.float64], masked: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
        """Innovations (n,), or slopes of them (n, m), as they count in J; masked: (n,), None: as in the event."""
        if self._whitening is not None:
            values = self._whitening.of(values, self._window.masked if masked is None else masked)
        if self._levels is None:
            return values
        return values / (self._levels if values.ndim == 1 else self._levels[:, None])

    def _offset_error(self, theta: NDArray[np.float64]) -> float:
        """Line over rail pressure at rest by theta (m,), less the measured one [p_0]."""
        return float(theta[_OFFSET] + theta[_GAIN] * self._rail_pressure) - self._offset

    def _cost(self, theta: NDArray[np.float64]) -> float:
        cost = robust_cost(self.innovations, self.burn_in, self.sigma, self._together)
        cost += self.offset_cost(theta) + 0.5 * float(self.jitter @ self.jitter)
        return cost / self.temper if math.isfinite(cost) else math.inf

    def _whiten(self) -> None:
        if self._expected is not None:
            self.unfiltered -= self._expected
        self.innovations = self.whitened(self.unfiltered)

    def _follow(self, theta: NDArray[np.float64]) -> None:
        """Run the event with theta (m,) and its slopes, the shots as late as explains most."""
        self.unfiltered, self.delays = np.empty(self._window.output.size), None
        slopes, is_near = self._slopes(theta, self.columns), True
        if self.jitter.size:
            self.delays, is_near = self._move_shots(slopes[:, self.columns.size :])
        if not is_near:
            self._settle_shots(theta)
            slopes = self._slopes(theta, self.columns)
            self.delays, _ = self._move_shots(slopes[:, self.columns.size :])
        self.unfiltered_slopes = np.zeros((self.unfiltered.size, theta.size))
        self.unfiltered_slopes[:, self.columns] = slopes[:, : self.columns.size]
        self.slopes = self.whitened(self.unfiltered_slopes)
        if self.delays is not None:
            by_theta = self.delays.solved @ self.slopes
            self.slopes = self.slopes + self.delays.slopes @ by_theta
            self.delays = self.delays._replace(theta=theta, likeliest=self.jitter, by_theta=by_theta)

    def _settle_shots(self, theta: NDArray[np.float64]) -> None:
        """Run the event with theta (m,) until its shots are as late as explains most, at most `MOST_RUNS` times."""
        for _ in range(MOST_RUNS):
            slopes = self._slopes(theta, NEEDLE_LAW.columns)
            if self._move_shots(slopes[:, NEEDLE_NUMBERS:])[1]:
                return

    def _slopes(self, theta: NDArray[np.float64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Run the event with theta (m,) and the delays as they are; slopes by columns (k,) of theta and by delays."""
        window = self._window.with_jitter(self.jitter * NEEDLE_JITTER, self._setting.interval)
        slopes = np.empty((self.unfiltered.size, columns.size + self.jitter.size))
        innovations_with_sensitivity(window, self._setting, theta, self.unfiltered, slopes, columns)
        if self._shape is not None and window.needle is not None:
            course = needle_course(self._shape, window, learned_of(theta, self._setting.coefficients), self._setting)
            self._expected = course.expected
            slopes[:, np.flatnonzero(np.isin(columns, NEEDLE_LAW.columns))] -= course.by_numbers
            slopes[:, columns.size :] -= course.by_shots
        self._whiten()
        return slopes

    def _move_shots(self, by_shots: NDArray[np.float64]) -> tuple[ShotDelays | None, bool]:
        """One Gauss-Newton step of the shots' delays, by slopes (n, k) of the innovations.

        Returns the delays, None where an innovation is not finite, and whether the step was small enough to be
        linear: then the innovations have been moved along.
        """
        if not np.isfinite(self.innovations).all():
            return None, True
        by_shots = by_shots * JITTER_SIZE
        delays = ShotDelays.of(self.whitened(by_shots), self.burn_in, self.sigma)
        move = delays.solved @ self.innovations - delays.covariance @ self.jitter
        move = np.clip(move, -MOST_JITTER, MOST_JITTER)
        self.jitter = self.jitter + move
        is_near = bool(np.abs(move).max() < NEAR_JITTER)
        if is_near:
            self.innovations = self.innovations + delays.slopes @ move
            self.unfiltered += by_shots @ move
        return delays, is_near
