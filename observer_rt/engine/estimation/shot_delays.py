"""Delays of an event's shots beyond those of theta, estimated by the slopes of the innovations."""

from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.model.needle import NEEDLE_JITTER
from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.engine.estimation.predictor import NO_RATE, NO_SLOPES
from observer_rt.model.effective import LAG_UNIT

JITTER_SIZE = NEEDLE_JITTER / LAG_UNIT  # standard deviation of a shot's delay, as theta counts delays


class ShotDelays(NamedTuple):
    """Two delays of each shot of an event, k in all, in units of `JITTER_SIZE`; the cost is marginal over them."""

    slopes: Matrix  # (n, k) of the whitened innovations by the delays
    solved: Matrix  # (k, n) slopes of the likeliest delays by the innovations
    covariance: Matrix  # (k, k) of the delays with theta held
    theta: Vector = NO_RATE  # (m,) where J is linearised
    likeliest: Vector = NO_RATE  # (k,) delays with this theta
    by_theta: Matrix = NO_SLOPES  # (k, m) slopes of the likeliest delays

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
