"""What makes coloured innovations white: a high pass that takes the slow part away, an autoregressive filter."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled

LEVEL_SAMPLES = 20  # from whose mean the high pass starts: a start from 0 would ring for many samples
NO_HIGH_PASS = -1.0
NONE_MASKED = np.empty(0, np.bool_)


@dataclass(frozen=True, eq=False)
class Whitening:
    """(1 - z)/(1 - theta z) (1 + a_1 z + .. + a_p z^p), z the delay of one sample.

    forgetting: theta, None without high pass; taps: a (p,).
    """

    forgetting: float | None
    taps: NDArray[np.float64]

    def of(self, values: NDArray[np.float64], masked: NDArray[np.bool_] = NONE_MASKED) -> NDArray[np.float64]:
        """Innovations (n,) or their slopes (n, m), whitened: linear, and alike for both.

        The first value does not count, as that of innovations does not, and becomes 0. masked: (n,) where there is
        no value, or (0,): one as it is expected there is taken, and 0 comes out until all taps lie on values again.
        """
        columns = values.reshape(values.shape[0], -1)
        result = np.empty_like(columns)
        forgetting = NO_HIGH_PASS if self.forgetting is None else self.forgetting
        _whiten(columns, masked, forgetting, self.taps, result)
        return result.reshape(values.shape)


@compiled
def _whiten(
    values: NDArray[np.float64],
    masked: NDArray[np.bool_],
    forgetting: float,
    taps: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Values (n, m) down the columns."""
    n, m = values.shape
    passed = np.zeros((n, m))
    before = np.zeros(m)
    if forgetting != NO_HIGH_PASS:
        count = min(LEVEL_SAMPLES, n - 1)
        for k in range(1, 1 + count):
            for j in range(m):
                before[j] += values[k, j] / count
    unknown = 0  # samples for which some tap still lies on an expected value
    result[0] = 0.0
    for k in range(1, n):
        is_masked = masked.shape[0] > 0 and masked[k]
        for j in range(m):
            expected = 0.0
            for i in range(min(taps.shape[0], k - 1)):
                expected -= taps[i] * passed[k - 1 - i, j]
            if forgetting == NO_HIGH_PASS:
                passed[k, j] = expected if is_masked else values[k, j]
            else:
                kept = forgetting * passed[k - 1, j] - before[j]
                passed[k, j] = expected if is_masked else values[k, j] + kept
                before[j] = passed[k, j] - kept if is_masked else values[k, j]
            result[k, j] = passed[k, j] - expected if unknown == 0 and not is_masked else 0.0
        unknown = taps.shape[0] if is_masked else max(unknown - 1, 0)


def forgetting_of(time_constant: float, interval: float) -> float:
    """theta of a high pass with a time constant [s] at a sample interval [s]."""
    return math.exp(-interval / time_constant)
