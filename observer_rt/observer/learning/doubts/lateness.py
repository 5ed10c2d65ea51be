"""Whether what was identified as a lag of the line-pressure sensor is one, or its channel is recorded late.

Both move p_L by nearly the same: nozzle and seat terms adapt, mass stays right, but the shape of Q_H does not, and
the innovations stay almost white. What tells them apart is asked for directly; so is what the mistake would make of
the rate. Quiet sensors tell a filter of 10 us from a delay of 10 us, and it does not matter which it is.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.learned import learned_of
from observer_rt.estimation.open_loop import OpenLoop
from observer_rt.estimation.prediction_error import HUBER, EventCost
from observer_rt.estimation.predictor import Setting, Window, innovations
from observer_rt.estimation.scalars import SCALARS, Scalars
from observer_rt.estimation.sensitivity import Parameter
from observer_rt.model.sensor import LAG_UNIT
from observer_rt.observer.learning.fitting import EventFit
from observer_rt.observer.learning.trend import RecentScores

LEAST_LAG = 5e-6  # s, below which the two are the same to the eye
REMEMBERED = 0.85  # weight of the score before this event
SIGNIFICANT = 4.5  # standard deviations: below 1e-5 an event where it is a lag
# Of the rate's peak, root mean square over the injection: what a lag in place of a delay may make of the rate. Of the
# mass it is about a third. Some 25 us of delay do this.
RELEVANT_RATE = 0.01
LEAST_RATE = 0.02  # of the peak, from which on it counts as injection


class LagScore(NamedTuple):
    """Of a lag against a delay as long: standard normal if it is a lag, negative if it is none.

    change: of theta (m,), if it is none.
    """

    score: float
    change: NDArray[np.float64]


class Lateness(NamedTuple):
    """How much an event's lag looks like none (`LagScore`), and what the mistake makes of its rate, if it is one.

    rate_share: of the peak, root mean square over the injection; volume_share: of the volume; change: of theta (m,).
    """

    score: float
    rate_share: float
    volume_share: float
    change: NDArray[np.float64]


def lag_score(
    window: Window,
    setting: Setting,
    fit: EventFit,
    cost: EventCost,
    prior: NDArray[np.float64],
    scalars: Scalars = SCALARS,
) -> LagScore | None:
    """Score test of a fit's lag against a delay as long.

    cost: of the event; prior: standard deviations (m,) of the parameters, wide. The direction in
    which a delay would move the innovations is freed of what other parameters can do, then compared with them. None
    without a lag worth asking.
    """
    theta = fit.linearisation.theta
    lag = float(theta[Parameter.SENSOR_LAG]) * LAG_UNIT
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
        learned_of(delayed, setting.coefficients, scalars),
        other,
    )
    other = cost.whitened(other, masked)
    first = cost.burn_in + late
    direction = (other[first - late : early_enough] - fit.innovations[first:]) / cost.sigma
    slopes = fit.slopes[first:] / cost.sigma
    information = slopes.T @ slopes + np.diag(prior**-2)
    change = -np.linalg.solve(information, slopes.T @ direction)
    direction = direction + slopes @ change
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        return None
    score = float(direction @ np.clip(fit.innovations[first:] / cost.sigma, -HUBER, HUBER)) / length
    return LagScore(score, np.asarray(change, np.float64))


def lateness_of(found: LagScore, run: OpenLoop) -> Lateness:
    """What a score means for the event it is of, run open loop with the theta that was found."""
    moved, peak = run.slopes @ found.change, float(np.max(run.rate))
    injecting = run.rate > LEAST_RATE * peak
    if not injecting.any():
        return Lateness(found.score, 0.0, 0.0, found.change)
    share = math.sqrt(float(np.mean(moved[injecting] ** 2))) / peak
    return Lateness(found.score, share, float(np.sum(moved) / np.sum(run.rate)), found.change)


class LagDoubt:
    """What recent events say together: whether their lag is none, and whether that matters."""

    def __init__(self) -> None:
        self._scores = RecentScores(REMEMBERED, 1)
        self._events, self._rate_squares, self._volume_squares = 0.0, 0.0, 0.0
        self._change_squares: NDArray[np.float64] | float = 0.0

    def take_in(self, event: Lateness | None) -> None:
        """An event more; None: there is no lag, all is forgotten."""
        if event is None:
            self._scores.forget()
            self._events, self._rate_squares, self._volume_squares = 0.0, 0.0, 0.0
            self._change_squares = 0.0
            return
        self._scores.add(np.array([event.score]))
        self._events = REMEMBERED * self._events + 1.0
        self._rate_squares = REMEMBERED * self._rate_squares + event.rate_share**2
        self._volume_squares = REMEMBERED * self._volume_squares + event.volume_share**2
        self._change_squares = REMEMBERED * self._change_squares + event.change**2

    @property
    def is_no_lag(self) -> bool:
        """Whether recent events contradict a lag."""
        return bool(self._scores.beyond(SIGNIFICANT)[0])

    @property
    def is_relevant(self) -> bool:
        """Whether it is no lag, and the rate is wrong by more than may be left."""
        return self.is_no_lag and self._rate_squares > RELEVANT_RATE**2 * self._events

    @property
    def volume_share(self) -> float:
        """By what a volume may be wrong where it is no lag, 0 where it seems to be one."""
        return math.sqrt(self._volume_squares / self._events) if self.is_no_lag else 0.0

    def variance(self, width: int) -> NDArray[np.float64]:
        """The same of theta, as variances (width,)."""
        return np.zeros(width) + (self._change_squares / self._events if self.is_no_lag else 0.0)
