"""How well the injected volume is known."""

import numpy as np
from numpy.typing import NDArray

MODEL_SHARE = 1e-3  # systematic, of the volume (one sigma)
MODEL_VOLUME = 0.015e-9  # m3, systematic (one sigma)


def volume_interval(
    rate: NDArray[np.float64],
    slopes: NDArray[np.float64],
    covariance: NDArray[np.float64],
    interval: float,
) -> tuple[float, float]:
    """95 % interval of an injected volume [m3], by what was learned up to the injection and from it.

    rate [m3/s] (n,) and slopes (n, m): the injection re-simulated with the newest estimate over its window, and the
    derivatives; covariance (m, m) of the estimate; interval of the samples [s].
    """
    volume = float(np.trapezoid(rate)) * interval
    gradient = np.trapezoid(slopes, axis=0) * interval
    variance = float(gradient @ covariance @ gradient)
    sigma = float(np.sqrt(variance + (MODEL_SHARE * volume) ** 2 + MODEL_VOLUME**2))
    return volume - 1.96 * sigma, volume + 1.96 * sigma
