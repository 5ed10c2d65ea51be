"""A needle lift as it was before a slow sensor rounded it."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.openings import Opening, find_openings, opening_between, ramp_samples
from observer_rt.observer.stream.channel_compensation import noise_gain

GRID = 2e-6  # s of lag, at whose multiples openings are looked for: between them nothing jumps


def without_lag(lift: NDArray[np.float64], sample_rate: float, lag: float) -> NDArray[np.float64]:
    """y + lag y' [m] (n,) of a recorded lift y; central differences leave straight ramps exact."""
    return np.asarray(lift + lag * sample_rate * np.gradient(lift))


def openings_without_lag(
    lift: NDArray[np.float64], noise: float, recorded: Sequence[Opening], sample_rate: float, lag: float
) -> list[tuple[float, list[Opening]]]:
    """Openings of `without_lag`, as those of two multiples of GRID beside the lag, with the share of each.

    noise: white, of the recorded lift [m]. Only openings that were recorded are kept; they begin and end earlier.
    """
    restored, ramp = without_lag(lift, sample_rate, lag), ramp_samples(sample_rate)
    below = math.floor(lag / GRID)
    result = []
    for multiple, share in ((below, 1.0 + below - lag / GRID), (below + 1, lag / GRID - below)):
        near = multiple * GRID
        found = find_openings(
            without_lag(lift, sample_rate, near), noise * noise_gain(near * sample_rate), ramp
        )
        kept = [one for one in found if any(_overlap(one, other) for other in recorded)]
        result.append((share, [opening_between(restored, one.first, one.last, ramp) for one in kept]))
    return result


def _overlap(one: Opening, other: Opening) -> bool:
    return one.first <= other.last and other.first <= one.last
