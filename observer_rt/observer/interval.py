"""How well the injected volume is known."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.observer.learning import Outcome

MODEL_SHARE = 1e-3  # systematic, of the volume (one sigma)
MODEL_VOLUME = 0.015e-9  # m3, systematic (one sigma)


def volume_interval(
    volume: float, slopes: NDArray[np.float64], interval: float, outcome: Outcome
) -> tuple[float, float] | None:
    """95 % interval of an injected volume [m3] that was estimated with `outcome.carried` in force.

    slopes: (n, m) derivatives of the rate over the injection's window; interval of the samples [s]. Centred where
    the estimate learned from the injection itself puts the volume. None where the training knows no covariance.
    """
    if outcome.covariance is None:
        return None
    gradient = (slopes.sum(axis=0) - 0.5 * (slopes[0] + slopes[-1])) * interval
    centre = volume + float(gradient @ (outcome.estimate - outcome.carried))
    variance = float(gradient @ outcome.covariance @ gradient)
    sigma = np.sqrt(variance + (MODEL_SHARE * volume) ** 2 + MODEL_VOLUME**2)
    return centre - 1.96 * sigma, centre + 1.96 * sigma
