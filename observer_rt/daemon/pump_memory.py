"""The pump's memory: what Python reads and writes beside the loop; the latency of the rates by it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import BIT_RATE_SWITCH, CLASSIC_MTU, EXTENDED_FLAG, FD_MTU
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.core.frames.frames import ARRIVAL, ERROR_FRAME, ERRORS, PUMP, PUMP_BUS, WAITING
from observer_rt.foundation.units import MICROSECOND, NANOSECOND

SHORTEST = 1024  # ns, where the first of the octaves begins that are counted in quarters
QUANTILE = 0.999  # of the rates, that `Latency.p999` is about


class Pump(NamedTuple):
    """Memory that Python reads and writes beside the loop."""

    memory: NDArray[np.void]  # (1,) PUMP
    buses: NDArray[np.void]  # PUMP_BUS
    errors: NDArray[np.void]  # ERROR_FRAME, ERRORS of every bus
    arrivals: NDArray[np.void]  # ARRIVAL
    waiting: NDArray[np.uint8]  # WAITING results as the kernel takes them


def make_pump(buses: int, watched: Sequence[MessageLayout], result: MessageLayout | None) -> Pump:
    """Memory for so many buses; watched: messages whose arrivals are counted; result: that of the rates, if any."""
    arrivals = np.zeros(len(watched), ARRIVAL)
    arrivals["key"] = [layout.key for layout in watched]
    memory = np.zeros(1, PUMP)
    memory["bus"] = -1
    if result is not None:
        memory["bus"] = result.bus
        memory["identifier"] = result.frame_id | (EXTENDED_FLAG if result.is_extended else 0)
        memory["flags"] = BIT_RATE_SWITCH if result.is_fd else 0
        memory["size"] = FD_MTU if result.is_fd else CLASSIC_MTU
    waiting = np.zeros(WAITING * FD_MTU, np.uint8)
    return Pump(memory, np.zeros(buses, PUMP_BUS), np.zeros(buses * ERRORS, ERROR_FRAME), arrivals, waiting)


class Latency(NamedTuple):
    """Latency of all rates so far [s]: the 99.9 % quantile, to a quarter of an octave, and the largest."""

    p999: float
    largest: float

    def as_text(self) -> str:
        """Describes it in a few words."""
        p999, largest = (latency / MICROSECOND for latency in (self.p999, self.largest))
        return f"99.9 % of rates sent within {p999:.0f} us, the latest after {largest:.0f} us"


def latency_of(memory: np.void) -> Latency | None:
    """Latency by the counts of a `memory.PUMP`; None before rates were sent."""
    counts: NDArray[np.int64] = memory["latencies"]
    total, largest = int(counts.sum()), int(memory["largest_latency"])
    if not total:
        return None
    bin_number = int(np.searchsorted(np.cumsum(counts), QUANTILE * total))
    octave, quarter = divmod(bin_number + 1, 4)
    end = SHORTEST * 2**octave * (1.0 + 0.25 * quarter) if bin_number + 1 < counts.size else largest
    return Latency(min(end, largest) * NANOSECOND, largest * NANOSECOND)
