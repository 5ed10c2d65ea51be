"""Inputs without a sample index: where what is counted here lies in the observer's count.

Both count frames, each since it began to listen. What the observer publishes tells the difference: a rate cannot
come before its samples, which bounds it to some milliseconds, and within these the rate that the model makes of the
samples heard here fits the published one at one place only.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

SLOWEST = 5e-3  # s from a sample to its rate, of the promptest frames
_FRAMES = 100  # of rates, one of which was prompt
_ALIKE = 0.9  # share of the squares of a published rate that the model has at its place, but for a factor
_HALF, _WHOLE = 0x80000000, 0x100000000  # indices are sent in 32 bits


class CountShift:
    """By how many samples the observer's count is ahead of ours."""

    def __init__(self, lookahead: int, rate_hz: float) -> None:
        """lookahead: samples the observer must know beyond one before it publishes its rate."""
        self._reach = lookahead + round(SLOWEST * rate_hz)
        self._ahead: deque[int] = deque(maxlen=_FRAMES)

    def note(self, published: int, received: int) -> None:
        """Rates came up to the observer's sample `published` when ours were received up to `received`."""
        self._ahead.append((published - received + _HALF) % _WHOLE - _HALF)

    @property
    def candidates(self) -> range:
        """The shifts that are possible; none before rates came."""
        least = max(self._ahead, default=0)
        return range(least, least + self._reach + 1) if self._ahead else range(0)


def best_place(published: NDArray[np.float64], modelled: NDArray[np.float64]) -> int | None:
    """Where in modelled rates (n,) a stretch of published ones (m,) lies, m <= n, nan where none were published.

    Wear is a factor. None where nothing was injected, or no place is like it.
    """
    is_known = np.isfinite(published)
    rates = np.where(is_known, published, 0.0)
    squares = float(rates @ rates)
    if squares == 0.0:
        return None
    common = np.correlate(modelled, rates, "valid")
    own = np.correlate(modelled**2, is_known.astype(np.float64), "valid")
    alike = np.clip(common, 0.0, None) ** 2 / (squares * np.clip(own, 1e-9 * squares, None))
    best = int(np.argmax(alike))
    return best if alike[best] > _ALIKE else None
