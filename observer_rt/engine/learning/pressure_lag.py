"""Lag of the line-pressure sensor: tested against a channel recorded late, and grown all at once by a fault.

Both move p_L by nearly the same: nozzle and seat terms adapt, mass stays right, but the shape of Q_H does not, and
the innovations stay almost white. The difference is tested directly, with what the mistake would make of the
rate. Quiet sensors distinguish a filter of 10 us from a delay of 10 us, and it does not matter which it is.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import HUBER
from observer_rt.engine.estimation.open_loop import OpenLoop
from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Setting, Window, innovations
from observer_rt.engine.estimation.scalars import Parameter, learned_of, sensor_lag
from observer_rt.engine.learning.fitting import EventFit, freed

LEAST_LAG = 5e-6  # s, below which the two are the same to the eye
REMEMBERED = 0.85  # weight of the score before this event
SIGNIFICANT = 4.5  # standard deviations: below 1e-5 an event where it is a lag
# Of the rate's peak, root mean square over the injection: what a lag in place of a delay may make of the rate. Of the
# mass it is about a third. Some 25 us of delay do this.
RELEVANT_RATE = 0.01
# Standard deviations of an innovation: the model with the delay is not stable, and shows nothing.
DIVERGED = 1e6
LEAST_RATE = 0.02  # of the peak, from which on it counts as injection


class LagScore(NamedTuple):
    """Score of a lag against a delay as long: standard normal if it is a lag, negative if it is a delay.

    change: of theta (m,), if it is a delay.
    """

    score: float
    change: NDArray[np.float64]


class Lateness(NamedTuple):
    """Evidence of an event that a fitted lag is a delay (`LagScore`), and the rate error that makes.

    rate_share: of the peak, root mean square over the injection; volume_share: of the volume; change: of theta (m,).
    """

    score: float
    rate_share: float
    volume_share: float
    change: NDArray[np.float64]


def lag_score(
    window: Window, setting: Setting, fit: EventFit, cost: EventCost, prior: NDArray[np.float64]
) -> LagScore | None:
    """Score test of a fit's lag against a delay as long.

    cost: of the event; prior: standard deviations (m,) of the parameters, wide. The direction in
    which a delay would move the innovations is freed of what other parameters can do, then compared with them. None
    without a lag worth asking.
    """
    theta = fit.linearisation.theta
    lag = sensor_lag(theta)
    if lag < LEAST_LAG:
        return None
    delayed = theta.copy()
    delayed[Parameter.SENSOR_LAG] = 0.0
    samples = setting.late + lag / setting.interval
    late = math.floor(samples)
    early_enough = len(window.output) - late
    output = np.append(window.output[late:], np.full(late, window.output[-1]))
    masked = np.append(window.masked[late:], np.full(min(late, window.masked.size), False))
    other = np.empty(len(output))
    innovations(
        window._replace(output=output, masked=masked),
        setting._replace(late=samples - late),
        learned_of(delayed, setting.coefficients),
        other,
    )
    other = cost.whitened(other, masked)
    first = cost.burn_in + late
    direction = (other[first - late : early_enough] - fit.innovations[first:]) / cost.sigma
    if not np.abs(direction).max() < DIVERGED:
        return None
    direction, change = freed(direction, fit.slopes[first:] / cost.sigma, prior)
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        return None
    score = float(direction @ np.clip(fit.innovations[first:] / cost.sigma, -HUBER, HUBER)) / length
    return LagScore(score, change)


def lateness_of(score: LagScore, run: OpenLoop) -> Lateness:
    """Lateness by the score of an event, run open loop with the theta that was found."""
    moved, peak = run.slopes @ score.change, float(np.max(run.rate))
    injecting = run.rate > LEAST_RATE * peak
    if not injecting.any():
        return Lateness(score.score, 0.0, 0.0, score.change)
    share = math.sqrt(float(np.mean(moved[injecting] ** 2))) / peak
    return Lateness(score.score, share, float(np.sum(moved) / np.sum(run.rate)), score.change)


@dataclass(frozen=True, eq=False)
class LagDoubt:
    """Evidence of recent events that their lag is a delay, and that it matters.

    Sums of scores (and its variance, where it is a lag), and of squares: of the shares of rate and volume, and of the
    change of theta (m,).
    """

    score: float
    variance_of_score: float
    events: float
    rate_squares: float
    volume_squares: float
    change_squares: NDArray[np.float64]

    def after(self, event: Lateness | None) -> "LagDoubt":
        """Adds an event; None: there is no lag, all is forgotten."""
        if event is None:
            return no_doubt(self.change_squares.size)
        return LagDoubt(
            REMEMBERED * self.score + event.score,
            REMEMBERED**2 * self.variance_of_score + 1.0,
            REMEMBERED * self.events + 1.0,
            REMEMBERED * self.rate_squares + event.rate_share**2,
            REMEMBERED * self.volume_squares + event.volume_share**2,
            REMEMBERED * self.change_squares + event.change**2,
        )

    @property
    def is_no_lag(self) -> bool:
        """Whether recent events contradict a lag."""
        return abs(self.score) > SIGNIFICANT * math.sqrt(self.variance_of_score)

    @property
    def is_relevant(self) -> bool:
        """Whether it is no lag, and the rate is wrong by more than may be left."""
        return self.is_no_lag and self.rate_squares > RELEVANT_RATE**2 * self.events

    @property
    def volume_share(self) -> float:
        """Share by which a volume may be wrong where it is no lag, 0 where it seems to be one."""
        return math.sqrt(self.volume_squares / self.events) if self.is_no_lag else 0.0

    @property
    def variance(self) -> NDArray[np.float64]:
        """Variances (width,) of theta by the same."""
        return self.change_squares / self.events if self.is_no_lag else np.zeros_like(self.change_squares)


def no_doubt(width: int) -> LagDoubt:
    """Evidence before any event with a lag; width: columns of theta."""
    return LagDoubt(0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(width))
