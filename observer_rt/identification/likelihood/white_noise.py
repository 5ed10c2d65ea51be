"""Level of the noise of a recording's signals, white or behind an anti-alias filter."""

import math

import numpy as np
from numpy.typing import NDArray

_ORDER = 4  # differences: what physics does to a signal within four samples is far below the noise
_ORDER_OF_PAIRS = 8  # differences of means of two samples, among which a line rings twice as fast
_FINE_RATE = 80e3  # Hz, from which on pairs of samples are far above the higher waves of a line
_COLOUR_RATIO = 1.25  # times the level by samples, from which on the level by pairs is no chance
_CLIP_SIGMAS = 5.0  # standard deviations beyond which a difference is a kink or a spike
_NORMAL_MEDIAN = 0.6745  # median of |z| of a standard normal z
_ITERATIONS = 20
FEWEST_DIFFERENCES = 200


def noise_level(values: NDArray[np.float64], chosen: NDArray[np.bool_], sample_rate: float) -> float:
    """Standard deviation of the white noise that is as strong as the signal's at the frequencies of a line's waves.

    An anti-alias filter makes single samples differ less, but hardly the means of their pairs: where these tell of
    more noise, they count. At a slow sample rate [Hz] they would contain the line's ringing, too.
    """
    by_samples, even = white_noise(values, chosen), values.size // 2 * 2
    pairs = np.where(chosen, values, np.nan)[:even].reshape(-1, 2).mean(axis=1)
    by_pairs = math.sqrt(2.0) * white_noise(pairs, np.isfinite(pairs), _ORDER_OF_PAIRS)
    return by_pairs if sample_rate >= _FINE_RATE and by_pairs > _COLOUR_RATIO * by_samples else by_samples


def white_noise(values: NDArray[np.float64], chosen: NDArray[np.bool_], order: int = _ORDER) -> float:
    """Standard deviation of a sample's white noise: the clipped one of differences. nan: of too few.

    values, chosen: (n,); only runs of chosen samples without a nan count. order: of the differences.
    """
    sizes = np.abs(np.diff(np.where(chosen, values, np.nan), order))
    sizes = sizes[np.isfinite(sizes)]
    if sizes.size < FEWEST_DIFFERENCES:
        return math.nan
    # the median alone would be 1.5 % low on signals of few codes, enough to matter
    sigma = float(np.median(sizes)) / _NORMAL_MEDIAN or float(np.sqrt(np.mean(sizes**2)))
    for _ in range(_ITERATIONS):
        kept = sizes[sizes <= _CLIP_SIGMAS * sigma]
        clipped = float(np.sqrt(np.mean(kept**2))) if kept.size else sigma
        if math.isclose(clipped, sigma, rel_tol=1e-9):
            break
        sigma = clipped
    return sigma / math.sqrt(math.comb(2 * order, order))  # by which they raise white noise
