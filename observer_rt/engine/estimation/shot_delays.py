"""How late the shots of an event are beyond what theta says, by the innovations' slopes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.model.needle import NEEDLE_JITTER
from observer_rt.engine.estimation.predictor import NO_RATE, NO_SLOPES
from observer_rt.model.effective import LAG_UNIT

JITTER_SIZE = NEEDLE_JITTER / LAG_UNIT


class ShotDelays(NamedTuple):
    """Delays of an event's shots beyond what theta says, both of each, in `JITTER_SIZE`; they are marginalised."""

    slopes: NDArray[np.float64]  # (n, k) of the whitened innovations
    solved: NDArray[np.float64]  # (k, n) changes of the likeliest by innovations
    covariance: NDArray[np.float64]  # (k, k) theta held
    theta: NDArray[np.float64] = NO_RATE  # (m,) where J is linearised
    likeliest: NDArray[np.float64] = NO_RATE  # (k,) with this theta
    by_theta: NDArray[np.float64] = NO_SLOPES  # (k, m) of the likeliest

    @classmethod
    def of(cls, slopes: NDArray[np.float64], burn_in: int, sigma: float) -> "ShotDelays":
        """By slopes (n, k); each anew, with a standard deviation of 1."""
        counted = slopes / sigma**2
        counted[:burn_in] = 0.0
        covariance, _ = inverse_of(counted.T @ slopes + np.eye(slopes.shape[1]))
        return cls(slopes, -covariance @ counted.T, covariance)

    def seconds(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """The likeliest with another theta (m,), in s."""
        return np.asarray(NEEDLE_JITTER * (self.likeliest + self.by_theta @ (theta - self.theta)))
