"""Test whether a learned lag of the line-pressure sensor is rather a channel that was recorded late.

A lag and a delay move p_L by nearly the same. If one is taken for the other, nozzle and seat terms adapt and the mass
stays right, but the shape of Q_H is wrong while the innovations stay almost white. So the difference is tested
directly, and counts only where it changes the rate: quiet sensors distinguish a lag of 10 us, which does not matter.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import HUBER
from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import OpenLoop, Setting, Window, innovations
from observer_rt.engine.estimation.scalars import Parameter, learned_of, sensor_lag
from observer_rt.engine.learning.fitting import EventFit, freed

LEAST_LAG = 5e-6  # s: a shorter lag and a delay are indistinguishable
REMEMBERED = 0.85  # weight of the score before this event
SIGNIFICANT = 4.5  # standard deviations: a true lag exceeds them in fewer than 1e-5 of the events
# Error of the rate that is tolerated, root mean square over the injection as a share of the peak. The error of the
# mass is about a third of it. A delay of some 25 us taken for a lag reaches it.
RELEVANT_RATE = 0.01
# Standard deviations of an innovation beyond which the model with the delay is unstable, and the test means nothing.
DIVERGED = 1e6
LEAST_RATE = 0.02  # of the peak: a lower rate does not count as injection


class LagScore(NamedTuple):
    """Score of a lag against a delay of the same length: standard normal for a lag, negative for a delay.

    change: of theta (m,), if it is a delay.
    """

    score: float
    change: NDArray[np.float64]


class Lateness(NamedTuple):
    """Evidence of an event that a fitted lag is a delay (`LagScore`), and the error that follows for the rate.

    rate_share: of the peak, root mean square over the injection; volume_share: of the volume; change: of theta (m,).
    """

    score: float
    rate_share: float
    volume_share: float
    change: NDArray[np.float64]


def lag_score(
    window: Window, setting: Setting, fit: EventFit, cost: EventCost, prior: NDArray[np.float64]
) -> LagScore | None:
    """Score test of a fitted lag against a delay of the same length; None for a lag too short to test.

    cost: of the event; prior: standard deviations (m,) of theta, wide. The direction in which a delay would move the
    innovations, less the part that other parameters explain, is compared with the innovations.
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
    """Lateness by the score of an event, and its open-loop run with the fitted theta."""
    moved, peak = run.slopes @ score.change, float(np.max(run.rate))
    injecting = run.rate > LEAST_RATE * peak
    if not injecting.any():
        return Lateness(score.score, 0.0, 0.0, score.change)
    share = math.sqrt(float(np.mean(moved[injecting] ** 2))) / peak
    return Lateness(score.score, share, float(np.sum(moved) / np.sum(run.rate)), score.change)


@dataclass(frozen=True, eq=False)
class LagDoubt:
    """Evidence of recent events that their lag is a delay, and that this matters.

    score: weighted sum, with its variance for a true lag; ..._squares: weighted sums of squared shares of rate and
    volume, and of the squared change of theta (m,); events: sum of the weights.
    """

    score: float
    variance_of_score: float
    events: float
    rate_squares: float
    volume_squares: float
    change_squares: NDArray[np.float64]

    def after(self, event: Lateness | None) -> "LagDoubt":
        """The evidence with another event; None: it has no lag, so the evidence so far is dropped."""
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
        """Whether recent events contradict a lag, and the rate is wrong by more than RELEVANT_RATE."""
        return self.is_no_lag and self.rate_squares > RELEVANT_RATE**2 * self.events

    @property
    def volume_share(self) -> float:
        """Error of a volume as a share (one sigma), if recent events contradict a lag; else 0."""
        return math.sqrt(self.volume_squares / self.events) if self.is_no_lag else 0.0

    @property
    def variance(self) -> NDArray[np.float64]:
        """Variances (m,) of theta, if recent events contradict a lag; else 0."""
        return self.change_squares / self.events if self.is_no_lag else np.zeros_like(self.change_squares)


def no_doubt(width: int) -> LagDoubt:
    """Evidence before any event with a lag; width: number m of columns of theta."""
    return LagDoubt(0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(width))
