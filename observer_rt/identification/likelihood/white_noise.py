"""Level of the white noise of a recording's signals."""

import math

import numpy as np
from numpy.typing import NDArray

_ORDER = 4  # differences: what physics does to a signal within four samples is far below the noise
_GAIN = math.sqrt(70.0)  # by which they raise white noise: 1 4 6 4 1
_CLIP = 5.0  # standard deviations beyond which a difference is a kink or a spike
_NORMAL_MEDIAN = 0.6745  # median of |z| of a standard normal z
_ITERATIONS = 20
FEWEST_DIFFERENCES = 200


def white_noise(values: NDArray[np.float64], chosen: NDArray[np.bool_]) -> float:
    """Standard deviation of a sample's white noise, nan where too few samples tell.

    values, chosen: (n,); only runs of chosen samples without a nan count. Clipped standard deviation of the fourth
    differences: their median would be 1.5 % low on signals of few codes, enough to matter.
    """
    usable = chosen & np.isfinite(values)
    is_complete = usable[: -_ORDER or None].copy()
    for shift in range(1, _ORDER + 1):
        is_complete &= usable[shift : values.size - _ORDER + shift]
    differences = np.diff(np.where(usable, values, 0.0), _ORDER)[is_complete]
    if differences.size < FEWEST_DIFFERENCES:
        return math.nan
    size = np.abs(differences)
    sigma = float(np.median(size)) / _NORMAL_MEDIAN or float(np.sqrt(np.mean(size**2)))
    for _ in range(_ITERATIONS):
        kept = size[size <= _CLIP * sigma]
        clipped = float(np.sqrt(np.mean(kept**2))) if kept.size else sigma
        if math.isclose(clipped, sigma, rel_tol=1e-9):
            break
        sigma = clipped
    return sigma / _GAIN
