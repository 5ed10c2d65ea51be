"""The pump's memory: what Python reads and writes beside the loop."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import BIT_RATE_SWITCH, CLASSIC_MTU, EXTENDED_FLAG, FD_MTU
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.core.frames.frames import ERRORS, RECORDS, WAITING
from observer_rt.foundation.records import dtype_of

BUS = dtype_of(RECORDS["PumpBus"])
ERROR = dtype_of(RECORDS["ErrorFrame"])
ARRIVAL = dtype_of(RECORDS["Arrival"])
PUMP = dtype_of(RECORDS["PumpMemory"])


class Pump(NamedTuple):
    """Memory that Python reads and writes beside the loop."""

    memory: NDArray[np.void]  # (1,) PUMP
    buses: NDArray[np.void]  # BUS
    errors: NDArray[np.void]  # ERROR, ERRORS of every bus
    arrivals: NDArray[np.void]  # ARRIVAL
    waiting: NDArray[np.uint8]  # WAITING results as the kernel takes them


def make_pump(buses: int, watched: Sequence[MessageLayout], result: MessageLayout | None) -> Pump:
    """Memory for so many buses; watched: messages whose arrivals are counted; result: that of the rates, if any."""
    arrivals = np.zeros(len(watched), ARRIVAL)
    arrivals["key"] = [each.key for each in watched]
    memory = np.zeros(1, PUMP)
    memory["bus"] = -1
    if result is not None:
        memory["bus"] = result.bus
        memory["identifier"] = result.frame_id | (EXTENDED_FLAG if result.is_extended else 0)
        memory["flags"] = BIT_RATE_SWITCH if result.is_fd else 0
        memory["size"] = FD_MTU if result.is_fd else CLASSIC_MTU
    return Pump(
        memory,
        np.zeros(buses, BUS),
        np.zeros(buses * ERRORS, ERROR),
        arrivals,
        np.zeros(WAITING * FD_MTU, np.uint8),
    )
