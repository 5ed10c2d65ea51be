"""The pump's memory: what Python reads and writes beside the loop."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import BIT_RATE_SWITCH, CLASSIC_MTU, EXTENDED_FLAG, FD_MTU
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.core.frames.frames import ERRORS, LATENCIES, WAITING

BUS = np.dtype(
    [
        ("fd", np.int64),
        ("failure", np.int64),  # errno; the bus is left out until Python gives it a descriptor
        ("next", np.int64),  # frame of the batch
        ("count", np.int64),  # frames of the batch
        ("stamp", np.int64),  # of the next frame [ns]
        ("has_offset", np.bool_),
        ("offset", np.int64),  # ns, from the interface's clock to the computer's
        ("overflows", np.int64),  # frames lost, as the kernel counts them: 32 bits
        ("errors", np.int64),  # error frames so far
    ],
    align=True,
)
ERROR = np.dtype([("identifier", np.int64), ("length", np.int64), ("data", np.uint8, (8,))], align=True)
ARRIVAL = np.dtype([("key", np.int64), ("frames", np.int64), ("last", np.int64)], align=True)
PUMP = np.dtype(
    [
        ("is_to_stop", np.bool_),
        ("reported", np.int64),  # events closed and taken, failures, errors that Python knows of
        ("turns", np.int64),
        ("unsent", np.int64),
        # results
        ("bus", np.int64),  # they go to, -1: none are sent
        ("identifier", np.uint32),
        ("flags", np.uint8),
        ("size", np.int64),  # of a frame as the kernel takes it
        ("first_waiting", np.int64),
        ("end_waiting", np.int64),
        ("largest_latency", np.int64),  # ns, from the stamp of a frame until its rates are sent
        ("latencies", np.int64, (LATENCIES,)),  # how many rates took so long, four to an octave from 1 us on
    ],
    align=True,
)


class Pump(NamedTuple):
    """What Python reads and writes beside the loop."""

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
