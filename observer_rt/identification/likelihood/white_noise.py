"""Level of the noise of a recording's signals, white or behind an anti-alias filter."""

import math

import numpy as np
from numpy.typing import NDArray

_ORDER = 4  # differences: what physics does to a signal within four samples is far below the noise
_OF_PAIRS = 8  # the like, of the means of two samples, among which ringing is twice as fast
_FINE = 80e3  # Hz, from which on they are far above the higher waves of a line
_COLOURED = 1.25  # times the level by samples, from which on that by pairs is no chance
_CLIP = 5.0  # standard deviations beyond which a difference is a kink or a spike
_NORMAL_MEDIAN = 0.6745  # median of |z| of a standard normal z
_ITERATIONS = 20
FEWEST_DIFFERENCES = 200


def noise_level(values: NDArray[np.float64], chosen: NDArray[np.bool_], sample_rate: float) -> float:
    """Standard deviation of white noise that is as strong where a line rings, as of `white_noise`.

    An anti-alias filter takes from the noise what samples differ by, but little of that which their pairs do. Those
    of a slow sample rate [Hz] would hold the line's ringing, too.
    """
    white, even = white_noise(values, chosen), values.size // 2 * 2
    pairs = np.where(chosen, values, np.nan)[:even].reshape(-1, 2).mean(axis=1)
    by_pairs = math.sqrt(2.0) * white_noise(pairs, np.isfinite(pairs), _OF_PAIRS)
    return by_pairs if sample_rate >= _FINE and by_pairs > _COLOURED * white else white


def white_noise(values: NDArray[np.float64], chosen: NDArray[np.bool_], order: int = _ORDER) -> float:
    """Standard deviation of a sample's white noise, nan where too few samples tell.

    values, chosen: (n,); only runs of chosen samples without a nan count. order: of the differences.
    Their clipped standard deviation: their median would be 1.5 % low on signals of few codes, enough to matter.
    """
    size = np.abs(np.diff(np.where(chosen, values, np.nan), order))
    size = size[np.isfinite(size)]
    if size.size < FEWEST_DIFFERENCES:
        return math.nan
    sigma = float(np.median(size)) / _NORMAL_MEDIAN or float(np.sqrt(np.mean(size**2)))
    for _ in range(_ITERATIONS):
        kept = size[size <= _CLIP * sigma]
        clipped = float(np.sqrt(np.mean(kept**2))) if kept.size else sigma
        if math.isclose(clipped, sigma, rel_tol=1e-9):
            break
        sigma = clipped
    return sigma / math.sqrt(math.comb(2 * order, order))  # by which they raise white noise
