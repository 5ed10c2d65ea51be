"""Latency of the rates: from the stamp of the frame that caused them until the loop has sent them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MICROSECOND

NANOSECOND = 1e-9  # s
SHORTEST = 1024  # ns, where the first of the octaves begins that are counted in quarters
MOST = 0.999  # of the rates, that `Latency.p999` is about


@dataclass(frozen=True)
class Latency:
    """Latency of all rates so far [s]: the 99.9 % quantile, to a quarter of an octave, and the largest."""

    p999: float
    largest: float

    def as_text(self) -> str:
        """Describes it in a few words."""
        p999, largest = (each / MICROSECOND for each in (self.p999, self.largest))
        return f"99.9 % of rates sent within {p999:.0f} us, the latest after {largest:.0f} us"


def latency_of(memory: np.void) -> Latency | None:
    """Latency by the counts of a `memory.PUMP`; None before rates were sent."""
    counts: NDArray[np.int64] = memory["latencies"]
    total, largest = int(counts.sum()), int(memory["largest_latency"])
    if not total:
        return None
    place = int(np.searchsorted(np.cumsum(counts), MOST * total))
    octave, quarter = divmod(place + 1, 4)
    end = SHORTEST * 2**octave * (1.0 + 0.25 * quarter) if place + 1 < counts.size else largest
    return Latency(min(end, largest) * NANOSECOND, largest * NANOSECOND)
