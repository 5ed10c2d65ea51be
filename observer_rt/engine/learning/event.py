"""The reader of events: gains of x~, cost, linearisation, and line pressure at rest of an event round a belief.

Rest at several pressures, within an event (the rail dips) or over events, tells offset and gain of a sensor apart. It
comes before the noise's colour: that would take a gain's misfit in, and its high pass would hide the offset.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation import parameters, predictor
from observer_rt.engine.estimation.belief import Belief, HeldBelief, Matrix, Vector, held_at
from observer_rt.engine.estimation.phases import PhaseStatistics, phase_statistics
from observer_rt.engine.estimation.predictor import GainSchedule, NoiseLevels, Setting, Window
from observer_rt.engine.learning.adequacy import BURN_IN, CLIP
from observer_rt.engine.learning.fit import Limits, at_fault
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.kinds import Kind
from observer_rt.engine.learning.knowledge import LearnedInjector
from observer_rt.engine.learning.noise import LAGS, SEGMENT, mask_of
from observer_rt.engine.learning.run import EventCost, EventRun
from observer_rt.engine.stream.standstill import RestPoint, Standstill
from observer_rt.engine.stream.state import Constants
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND, Floats
from observer_rt.model.accuracy import EXACT, StatedAccuracy

BLOCK = 1 * MILLISECOND  # of which means are taken: about a period of the line
BLOCK_ERROR = 0.01 * MEGAPASCAL  # of such a mean, whatever the noise
# Of a block over the pressures within an event: the rail recovers alike in every event, which looks like a gain.
SYSTEMATIC = 0.03 * MEGAPASCAL
# Standard deviations beyond a belief, from which on no gain is learned: the sensor is another, or not straight.
SIGNIFICANT = 5.0
_OFFSET, _GAIN = int(parameters.Parameter.LINE_PRESSURE_OFFSET), int(parameters.Parameter.LINE_PRESSURE_GAIN)
_BOTH = [_OFFSET, _GAIN]


@dataclass(frozen=True, eq=False)
class RestingPressure:
    """Means (k,) of innovations over blocks of rest, at theta (m,), with slopes (k, 2) by offset and gain."""

    theta: parameters.Theta
    means: Floats
    slopes: Floats
    noise: float
    pressure_scale: float

    @classmethod
    def of(cls, cost: EventCost, run: EventRun) -> Self:
        """Rest of an event that was run with its slopes."""
        window, setting = cost.window, cost.setting
        length = max(round(BLOCK / setting.interval), 1)
        counts = window.resting & ~mask_of(window)
        counts[: cost.burn_in] = False
        at_rest = np.flatnonzero(counts)
        places = at_rest[at_rest.size % length :].reshape(-1, length)
        means = run.unfiltered[places].mean(axis=1)
        slopes = run.unfiltered_slopes[places][:, :, _BOTH].mean(axis=1)
        scatter = 0.5 * float(np.mean(np.diff(means) ** 2)) if means.size > 1 else 0.0
        noise = max(cost.sigma**2 / length, scatter)
        return cls(run.theta, means, slopes, noise, setting.coefficients.pressure_scale)

    def held(self, belief: Belief) -> HeldBelief:
        """The belief with the gain held at that by the rest; the belief itself where sensors are exact."""
        own = float(belief.covariance[_GAIN, _GAIN])
        if own <= 2.0 * parameters.EXACTLY**2:
            return HeldBelief(belief)
        value, variance = self._gain(belief)
        return held_at(belief, _GAIN, value, min(variance, own))

    def point(self, rail_pressure: float) -> RestPoint:
        """Line over rail pressure by this rest alone, before an event of a rail pressure [p_0]."""
        by_offset, scale = self.slopes[:, 0], self.pressure_scale
        weight, believed = float(by_offset @ by_offset), self.theta[_OFFSET] + self.theta[_GAIN] * rail_pressure
        if weight == 0.0:
            return RestPoint(rail_pressure * scale, 0.0, math.inf)
        own = believed - float(by_offset @ self.means) / weight
        variance = max(float(np.var(self.means)) * self.means.size, self.noise) / weight  # of means that go together
        return RestPoint(rail_pressure * scale, float(own) * scale, variance * scale**2 + BLOCK_ERROR**2)

    def _gain(self, belief: Belief) -> tuple[float, float]:
        before, prior = belief.mean[_BOTH], belief.covariance[np.ix_(_BOTH, _BOTH)]
        if not self.means.size:
            return float(before[1]), float(prior[1, 1])
        means = self.means + self.slopes @ (before - self.theta[_BOTH])
        middle, mean = self.slopes.mean(axis=0), float(means.mean())
        error = (BLOCK_ERROR / self.pressure_scale) ** 2
        of_mean, of_block = self.noise / means.size + error, self.noise + error
        if mean**2 > SIGNIFICANT**2 * (of_mean + middle @ prior @ middle):
            return float(before[1]), float(prior[1, 1])
        by_mean, of_means = _taught(prior, middle[None, :], np.array([mean]), of_mean)
        by_blocks, of_blocks = _taught(prior, self.slopes, means, of_block)
        least = (SYSTEMATIC / self.pressure_scale / max(float(np.ptp(self.slopes[:, 1])), parameters.EXACTLY)) ** 2
        variance = of_means - of_blocks
        share = min(max((of_means - least) / variance, 0.0), 1.0) if variance > 0.0 else 0.0
        gain = before[1] + (1.0 - share) * by_mean + share * by_blocks
        return float(gain), (1.0 - share) * of_means + share * of_blocks


def _taught(prior: Matrix, slopes: Matrix, means: Vector, noise: float) -> tuple[float, float]:
    """Change of the gain by innovations `means` (k,) with slopes (k, 2) and a variance; its variance then."""
    along = prior[1] @ slopes.T
    spread = slopes @ prior @ slopes.T + noise * np.eye(means.size)
    weights = np.linalg.solve(spread, along)
    return float(-weights @ means), float(prior[1, 1] - weights @ along)


class ClosedEvent(NamedTuple):
    """A closed event; standstill: when it ended; in_force (m,), constants: during it."""

    window: Window
    standstill: Standstill
    in_force: parameters.Theta
    constants: Constants


@dataclass(frozen=True, eq=False)
class EventReader:
    """Constants of learning; interval [s] of samples; gains_for: `gain_schedule`, or a cache of it."""

    interval: float
    pressure_scale: float
    limits: Limits
    healthy: Healthy = NOT_FITTED
    calibration: StatedAccuracy = EXACT
    gains_for: Callable[..., GainSchedule] = predictor.gain_schedule
    _widths: dict[Kind, parameters.Theta] = field(default_factory=dict)

    @cached_property
    def burn_in(self) -> int:
        """Samples of an event's window before innovations count."""
        return round(BURN_IN / self.interval)

    @cached_property
    def resting(self) -> int:
        """Fewest samples of rest that tell something of the noise."""
        return max(round(SEGMENT / self.interval), LAGS + 1)

    @cached_property
    def wide(self) -> Floats:
        """Standard deviations (m,) of theta before any event."""
        return parameters.with_gain(parameters.SCALARS.prior(self.pressure_scale), self.calibration.gain)

    @cached_property
    def drift(self) -> Floats:
        """Standard deviations (m,) of the change of theta from event to event."""
        return parameters.with_gain(
            parameters.SCALARS.drift(self.pressure_scale), parameters.GAIN_DRIFT * self.calibration.gain
        )

    def widths(self, kind: Kind) -> parameters.Theta:
        """Standard deviations (m,) by which theta moves where an event is of a kind."""
        if kind not in self._widths:
            self._widths[kind] = kind.widths(self.wide, self.drift)
        return self._widths[kind]

    def gains(
        self, theta: parameters.Theta, noise: NoiseLevels, constants: Constants, rail_smoothing: float = 0.0
    ) -> GainSchedule:
        """Gains of x~ with theta (m,); with those of another theta a line with waves may become unstable."""
        learned = parameters.learned_of(theta, constants.coefficients)
        sensor, rate = constants.sensor, 1.0 / constants.interval
        lag = sensor.lag + float(learned.sensor[0])
        every = constants.rail_every
        return self.gains_for(learned.coefficients, noise, rate, lag, sensor.fraction, every, rail_smoothing)

    def setting_at(self, theta: parameters.Theta, noise: NoiseLevels, constants: Constants) -> tuple[Setting, float]:
        """Setting by which x~ is followed over an event that is learned from, and the sigma of white innovations."""
        schedule, sensor = self.gains(theta, noise, constants, smoothing_in(constants)), constants.sensor
        setting = Setting(
            interval=constants.interval,
            substeps=constants.substeps,
            coefficients=constants.coefficients,
            gain=schedule.gains[-1].copy(),
            late=sensor.fraction,
            lag=sensor.lag,
            offset=sensor.offset,
            program=constants.program,
            rail_share=constants.calibration.rail_share,
        )
        return setting, schedule.innovation_sigma


def smoothing_in(constants: Constants) -> float:
    """Kernel width [s] that smooths the rail pressure of an event; 0 on a line without waves.

    Noise of the rail that runs along a line with waves is less with a late sensor, whether that is late or not.
    """
    return predictor.smoothing_of(constants.interval) if constants.coefficients.line.resolved > 0.0 else 0.0


def with_smooth_rail(window: Window, constants: Constants) -> Window:
    """The window as an event is learned from."""
    if smoothing_in(constants) == 0.0:
        return window
    rail, area = window.inputs.T
    return window._replace(inputs=np.column_stack((predictor.smoothed(rail, constants.interval), area)))


@dataclass(frozen=True, eq=False)
class EventReading:
    """An event read round the belief `learned`: its cost, and the run from which fits begin.

    white_sigma: of white innovations [p_0]; resting: line pressure at rest; off: nats of samples left out.
    """

    learned: LearnedInjector
    cost: EventCost
    first: EventRun
    white_sigma: float
    phases: NDArray[np.int8]
    resting: RestingPressure
    off: float = 0.0
    _left: dict[bytes, PhaseStatistics] = field(default_factory=dict)

    @property
    def window(self) -> Window:
        return self.cost.window

    @cached_property
    def level(self) -> float:
        """Nats that noise level and samples left out add to a cost, so that costs of readings can be compared."""
        return (self.cost.terms * math.log(self.cost.sigma) + self.off) / self.cost.temper

    def leaves(self, run: EventRun) -> PhaseStatistics:
        """Statistics of the clipped innovations of a run."""
        key = run.theta.tobytes()
        if key not in self._left:
            self._left[key] = self._statistics(run, CLIP)
        return self._left[key]

    def at_fault(self, run: EventRun) -> float:
        """Cost [nats] of the innovations of a run if the event is at fault, and of the offset at rest."""
        temper = self.cost.temper
        return at_fault(self._statistics(run), temper) + self.cost.offset_cost(run.theta) / temper

    def _statistics(self, run: EventRun, limit: float = math.inf) -> PhaseStatistics:
        cost = self.cost
        mask = mask_of(cost.window)
        return phase_statistics(run.innovations, cost.sigma, self.phases, cost.burn_in, mask, limit)
