"""The run of an event with a theta: its innovations, whitened and robustly weighted, and its cost."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.learning.whitening import robust_cost, weigh
from observer_rt.core.model.needle import NEEDLE_JITTER, NEEDLE_NUMBERS
from observer_rt.engine.estimation import predictor
from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.engine.estimation.parameters import EVERY, NEEDLE_LAW, Parameter, learned_of
from observer_rt.engine.learning.healthy import expected_in, needle_course
from observer_rt.engine.learning.noise import Colour, Whitening
from observer_rt.foundation.units import MEGAPASCAL, Floats, Ints
from observer_rt.model.baseline import HealthyShape
from observer_rt.model.effective import LAG_UNIT

JITTER_SIZE = NEEDLE_JITTER / LAG_UNIT  # standard deviation of a shot's delay, as theta counts delays
MOST_RUNS = 4  # of an event, until its shots are as late as explains most
MOST_JITTER, NEAR_JITTER = 3.0, 0.3  # standard deviations: largest move between two runs, and largest linear one
OFFSET_SIGMA = 0.2 * MEGAPASCAL  # of the mean difference at rest between line and rail pressure
INFORMED = 1e-2  # share of the belief's information, below which an event says nothing in a direction
_OFFSET, _GAIN = int(Parameter.LINE_PRESSURE_OFFSET), int(Parameter.LINE_PRESSURE_GAIN)


class ShotDelays(NamedTuple):
    """Two delays of each shot of an event, k in all, in units of `JITTER_SIZE`; the cost is marginal over them."""

    slopes: Matrix  # (n, k) of the whitened innovations by the delays
    solved: Matrix  # (k, n) slopes of the likeliest delays by the innovations
    covariance: Matrix  # (k, k) of the delays with theta held
    theta: Vector = predictor.NO_RATE  # (m,) where J is linearised
    likeliest: Vector = predictor.NO_RATE  # (k,) delays with this theta
    by_theta: Matrix = predictor.NO_SLOPES  # (k, m) slopes of the likeliest delays

    @classmethod
    def of(cls, slopes: Matrix, burn_in: int, sigma: float) -> "ShotDelays":
        """Delays by slopes (n, k) of innovations of `sigma` from sample `burn_in` on; before it, each has sigma 1."""
        counted = slopes / sigma**2
        counted[:burn_in] = 0.0
        covariance, _ = inverse_of(counted.T @ slopes + np.eye(slopes.shape[1]))
        return cls(slopes, -covariance @ counted.T, covariance)

    def seconds(self, theta: Vector) -> Vector:
        """The likeliest delays (k,) [s] with another theta (m,)."""
        return np.asarray(NEEDLE_JITTER * (self.likeliest + self.by_theta @ (theta - self.theta)))


@dataclass(frozen=True, eq=False)
class EventRun:
    """An event run with theta (m,): the innovations, and the cost as a parabola round theta.

    gradient (m,), information (m, m): by Gauss and Newton; innovations (n,): whitened; unfiltered (n,): with their
    colour; slopes, unfiltered_slopes (n, m); jitter (2 shots,): delays beyond theta's, in standard deviations, that
    explain most; delays: where the parabola touches, None where the lift is recorded, or the cost is not finite.
    """

    theta: Floats
    value: float
    gradient: Floats
    information: Floats
    innovations: Floats = field(default_factory=lambda: predictor.NO_RATE)
    unfiltered: Floats = field(default_factory=lambda: predictor.NO_RATE)
    slopes: Floats = field(default_factory=lambda: predictor.NO_SLOPES)
    unfiltered_slopes: Floats = field(default_factory=lambda: predictor.NO_SLOPES)
    jitter: Floats = field(default_factory=lambda: predictor.NO_RATE)
    delays: ShotDelays | None = None

    @property
    def vector(self) -> Floats:
        """information @ (the minimum of the parabola), (m,)."""
        return self.information @ self.theta - self.gradient

    def expected(self, theta: Floats) -> float:
        """The cost at another theta (m,) by the parabola."""
        step = theta - self.theta
        return self.value + float(self.gradient @ step) + 0.5 * float(step @ self.information @ step)

    def gradient_at(self, theta: Floats) -> Floats:
        """The gradient at another theta (m,) by the parabola."""
        return self.gradient + self.information @ (theta - self.theta)

    def centred(self, theta: Floats) -> "EventRun":
        """The parabola round another theta (m,)."""
        if theta is self.theta:
            return self
        return EventRun(theta, self.expected(theta), self.gradient_at(theta), self.information)

    def to_first_order(self, theta: Floats) -> "EventRun":
        """The run at another theta (m,), with innovations along their slopes and no shot late."""
        innovations = self.innovations + self.slopes @ (theta - self.theta)
        return replace(self, theta=theta, value=self.expected(theta), innovations=innovations, delays=None)

    def tempered(self, factor: float) -> "EventRun":
        """The run with its cost divided by a factor."""
        value, gradient, information = self.value / factor, self.gradient / factor, self.information / factor
        return replace(self, value=value, gradient=gradient, information=information)

    def score(self, covariance: Floats) -> float:
        """Score test of a belief with covariance (m, m) and its mean here: chi2 over degrees of freedom, 1 if right.

        Only directions the event informs count as degrees of freedom; the sensor's gain, held, is left out.
        """
        tested = np.flatnonzero(np.arange(covariance.shape[0]) != _GAIN)
        before, _ = inverse_of(covariance.take(tested, 0).take(tested, 1))
        information, gradient = self.information.take(tested, 0).take(tested, 1), self.gradient[tested]
        weights, _ = inverse_of(information + INFORMED * before)
        after, _ = inverse_of(information + before)
        chi2 = float((gradient @ weights) @ before @ (after @ gradient))
        return float(chi2 / max(gradient.size - INFORMED * float(np.vdot(weights, before)), 1.0))


class _Innovations(NamedTuple):
    """Innovations (n,) of x~ over an event, with the noise's colour and whitened, and delays of the shots."""

    unfiltered: Floats
    innovations: Floats
    jitter: Floats


@dataclass(frozen=True, eq=False)
class EventCost:
    """J(theta) = robust sum of (e~/sigma)^2 / 2 over one event.

    The first `burn_in` innovations do not count: x~ started with another theta. Coloured ones and their slopes are
    whitened first; a high pass hides the sensor's offset, so that at rest counts beside them. On a line of cells
    means over its `resolved` count, as in a fit: else the nozzle would make up for what cells do to shorter waves.

    sigma: of white innovations [p_0]; whitening: of coloured ones, or None; offset: mean of line over rail pressure
    at rest [p_0], or None; temper: divisor of J; shape: mean innovation of the healthy injector, which is taken out;
    columns: of theta whose slopes are computed, the others being 0.
    """

    window: predictor.Window
    setting: predictor.Setting
    sigma: float
    burn_in: int
    whitening: Whitening | None = None
    offset: float | None = None
    temper: float = 1.0
    shape: HealthyShape | None = None
    columns: Ints = field(default_factory=lambda: EVERY)

    def whitened_by(self, colour: Colour | None) -> "EventCost":
        """The same by innovations of a colour, None: as they are."""
        return self if colour is None else replace(self, sigma=colour.sigma, whitening=colour.whitening)

    @property
    def terms(self) -> int:
        """Number of squares that J sums."""
        return (self.window.output.size - self.burn_in) // self._together

    def offset_cost(self, theta: Floats) -> float:
        """Part of J, before it is divided by `temper`, of line over rail pressure at rest by theta (m,)."""
        return 0.5 * self._offset_weight * self._offset_error(theta) ** 2

    def innovations(self, theta: Floats) -> Floats:
        """Innovations (n,) at theta (m,), whitened."""
        return self._follow(theta, None).innovations

    def at(self, theta: Floats, near: EventRun) -> EventRun:
        """The event run with theta (m,), its parabola and slopes those of a run near by; J is inf if not finite."""
        unfiltered, innovations, jitter = self._follow(theta, near)
        return replace(
            near,
            theta=theta,
            value=self._value(theta, innovations, jitter),
            gradient=near.gradient_at(theta),
            innovations=innovations,
            unfiltered=unfiltered,
            jitter=jitter,
        )

    def linearised(self, theta: Floats, near: EventRun | None = None) -> EventRun:
        """The event run with theta (m,) and its slopes; near: a run whose shots are about as late, None: none is."""
        followed, unfiltered_slopes, delays = self._follow_with_slopes(theta, self._jitter(near))
        slopes, by_theta = np.ascontiguousarray(self.whitened(unfiltered_slopes)), predictor.NO_SLOPES
        if delays is not None:
            by_theta = delays.solved @ slopes
            slopes += delays.slopes @ by_theta
        gradient, information = np.zeros(self.columns.size), np.zeros((self.columns.size, self.columns.size))
        weigh(followed.innovations, slopes, self.burn_in, self.sigma, self._together, gradient, information)
        if delays is not None:
            gradient += by_theta.T @ followed.jitter
            information += by_theta.T @ by_theta
            delays = delays._replace(theta=theta, likeliest=followed.jitter, by_theta=self._wide(by_theta))
        gradient, information = self._wide(gradient), self._wide(np.ascontiguousarray(self._wide(information).T))
        by_offset = np.zeros(theta.size)
        by_offset[_OFFSET], by_offset[_GAIN] = 1.0, self._rail_pressure
        gradient += self._offset_weight * self._offset_error(theta) * by_offset
        information += self._offset_weight * np.outer(by_offset, by_offset)
        return EventRun(
            theta,
            self._value(theta, followed.innovations, followed.jitter),
            gradient / self.temper,
            information / self.temper,
            followed.innovations,
            followed.unfiltered,
            self._wide(slopes),
            self._wide(unfiltered_slopes),
            followed.jitter,
            delays,
        )

    def whitened(self, values: Floats) -> Floats:
        """Innovations (n,), or slopes of them (n, m), as they count in J."""
        return values if self.whitening is None else self.whitening.of(values, self.window.masked)

    def _wide(self, values: Floats) -> Floats:
        if self.columns.size == EVERY.size:
            return values
        wide = np.zeros((*values.shape[:-1], EVERY.size))
        wide[..., self.columns] = values
        return wide

    @cached_property
    def _together(self) -> int:
        resolved: float = self.setting.coefficients.line.resolved
        return max(1, round(resolved / self.setting.interval))

    @cached_property
    def _rail_pressure(self) -> float:
        return float(self.window.inputs[:, 0].mean())

    @cached_property
    def _offset_weight(self) -> float:
        is_hidden = self.whitening is not None and self.whitening.forgetting is not None
        if not is_hidden or self.offset is None:
            return 0.0
        return (self.setting.coefficients.pressure_scale / OFFSET_SIGMA) ** 2

    @cached_property
    def _expected(self) -> Floats | None:
        """Mean innovation (n,) of a healthy injector whose lift is recorded; None: 0."""
        if self.shape is None or self.window.needle is not None:
            return None
        return expected_in(self.shape, self.window, self.setting.coefficients, self.setting.interval)

    def _offset_error(self, theta: Floats) -> float:
        """Line over rail pressure at rest by theta (m,), less the measured one [p_0]."""
        return float(theta[_OFFSET] + theta[_GAIN] * self._rail_pressure) - (self.offset or 0.0)

    def _value(self, theta: Floats, innovations: Floats, jitter: Floats) -> float:
        cost = robust_cost(innovations, self.burn_in, self.sigma, self._together)
        cost += self.offset_cost(theta) + 0.5 * float(jitter @ jitter)
        return cost / self.temper if math.isfinite(cost) else math.inf

    def _jitter(self, near: EventRun | None) -> Floats:
        """Delays of the shots from which on they are sought."""
        return np.zeros(self.window.shot_columns) if near is None else near.jitter

    def _as_counted(self, unfiltered: Floats, expected: Floats | None, jitter: Floats) -> _Innovations:
        if expected is not None:
            unfiltered -= expected
        return _Innovations(unfiltered, self.whitened(unfiltered), jitter)

    def _follow(self, theta: Floats, near: EventRun | None) -> _Innovations:
        """Run the event with theta (m,), the shots as late as explains most."""
        jitter = self._jitter(near)
        if jitter.size:
            return self._settle_shots(theta, jitter)
        unfiltered = np.empty(self.window.output.size)
        predictor.innovations(self.window, self.setting, learned_of(theta, self.setting.coefficients), unfiltered)
        return self._as_counted(unfiltered, self._expected, jitter)

    def _follow_with_slopes(self, theta: Floats, jitter: Floats) -> tuple[_Innovations, Floats, ShotDelays | None]:
        """The same, with slopes (n, k) of the innovations by `columns`, not whitened, and delays of the shots."""
        followed, slopes = self._slopes(theta, self.columns, jitter)
        if not jitter.size:
            return followed, slopes, None
        followed, delays, is_near = self._move_shots(followed, slopes[:, self.columns.size :])
        if not is_near:
            followed = self._settle_shots(theta, followed.jitter)
            followed, slopes = self._slopes(theta, self.columns, followed.jitter)
            followed, delays, _ = self._move_shots(followed, slopes[:, self.columns.size :])
        return followed, slopes[:, : self.columns.size], delays

    def _settle_shots(self, theta: Floats, jitter: Floats) -> _Innovations:
        """Run the event with theta (m,) until its shots are as late as explains most, at most `MOST_RUNS` times."""
        for _ in range(MOST_RUNS):
            followed, slopes = self._slopes(theta, NEEDLE_LAW.columns, jitter)
            followed, _, is_near = self._move_shots(followed, slopes[:, NEEDLE_NUMBERS:])
            if is_near:
                break
            jitter = followed.jitter
        return followed

    def _slopes(self, theta: Floats, columns: Ints, jitter: Floats) -> tuple[_Innovations, Floats]:
        setting, unfiltered = self.setting, np.empty(self.window.output.size)
        window = self.window.with_jitter(jitter * NEEDLE_JITTER, setting.interval)
        slopes = np.empty((unfiltered.size, columns.size + jitter.size))
        predictor.innovations_with_sensitivity(window, setting, theta, unfiltered, slopes, columns)
        expected = self._expected
        if self.shape is not None and window.needle is not None:
            course = needle_course(self.shape, window, learned_of(theta, setting.coefficients), setting)
            expected = course.expected
            slopes[:, np.flatnonzero(np.isin(columns, NEEDLE_LAW.columns))] -= course.by_numbers
            slopes[:, columns.size :] -= course.by_shots
        return self._as_counted(unfiltered, expected, jitter), slopes

    def _move_shots(self, followed: _Innovations, by_shots: Floats) -> tuple[_Innovations, ShotDelays | None, bool]:
        """One Gauss-Newton step of the shots' delays, by slopes (n, k) of the innovations.

        Returns the delays (None: an innovation is not finite), and True if so small that the innovations moved along.
        """
        unfiltered, innovations, jitter = followed
        if not np.isfinite(innovations).all():
            return followed, None, True
        by_shots = by_shots * JITTER_SIZE
        delays = ShotDelays.of(self.whitened(by_shots), self.burn_in, self.sigma)
        move = delays.solved @ innovations - delays.covariance @ jitter
        move = np.clip(move, -MOST_JITTER, MOST_JITTER)
        if not np.abs(move).max() < NEAR_JITTER:
            return _Innovations(unfiltered, innovations, jitter + move), delays, False
        return (
            _Innovations(unfiltered + by_shots @ move, innovations + delays.slopes @ move, jitter + move),
            delays,
            True,
        )
