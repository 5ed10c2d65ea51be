"""Whether what was identified as a lag of the line-pressure sensor is one, or its channel is recorded late.

Both move p_L by nearly the same: nozzle and seat terms adapt, mass stays right, but the shape of Q_H does not, and
the innovations stay almost white. What tells them apart is asked for directly.
"""

import math

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.learned import learned_of
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


def lag_score(
    window: Window,
    setting: Setting,
    fit: EventFit,
    cost: EventCost,
    prior: NDArray[np.float64],
    scalars: Scalars = SCALARS,
) -> float | None:
    """Score test of a fit's lag against a delay as long: standard normal if it is a lag, negative if it is none.

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
    direction = direction - slopes @ np.linalg.solve(information, slopes.T @ direction)
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        return None
    return float(direction @ np.clip(fit.innovations[first:] / cost.sigma, -HUBER, HUBER)) / length


class LagDoubt:
    """The scores of recent events together."""

    def __init__(self) -> None:
        self._scores = RecentScores(REMEMBERED, 1)

    def is_no_lag_after(self, score: float | None) -> bool:
        """Take in an event's score; whether recent events contradict a lag. None: there is none, all is forgotten."""
        if score is None:
            self._scores.forget()
            return False
        self._scores.add(np.array([score]))
        return bool(self._scores.beyond(SIGNIFICANT)[0])
