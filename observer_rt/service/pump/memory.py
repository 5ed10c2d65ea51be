"""The pump's memory: buffers that the kernel fills, and what Python reads and writes beside the loop."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import BIT_RATE_SWITCH, CLASSIC_MTU, EXTENDED_FLAG, FD_MTU
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.foundation.referenced import referenced
from observer_rt.service.pump.libc import IOVEC, MMSGHDR, POLLFD, POLLIN

BATCH = 16  # frames that one system call may bring
SLOT = FD_MTU + 8  # bytes of a frame with its stamp behind it, as a feeder gives it
CONTROL_WORDS = 16  # of 8 bytes: room for three time stamps and a count of lost frames
ERRORS = 64  # error frames remembered until Python has read them
WAITING = 512  # results: some 0.15 s at 100 kHz, after which the oldest serve nobody


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
    ],
    align=True,
)


@referenced()
class Pump(NamedTuple):
    """All memory of the pump; buffers of bus b begin at b * BATCH."""

    memory: NDArray[np.void]  # (1,) PUMP
    buses: NDArray[np.void]  # BUS
    polled: NDArray[np.void]  # POLLFD
    frames: NDArray[np.uint8]  # as the kernel gives them
    words: NDArray[np.uint32]  # the same memory
    stamps: NDArray[np.int64]  # the same memory
    control: NDArray[np.int64]
    headers: NDArray[np.void]  # MMSGHDR
    vectors: NDArray[np.void]  # IOVEC
    errors: NDArray[np.void]  # ERROR, ERRORS of every bus
    arrivals: NDArray[np.void]  # ARRIVAL
    waiting: NDArray[np.uint8]  # WAITING results as the kernel takes them
    event: NDArray[np.uint64]  # (1,) what is written to wake Python
    clock: NDArray[np.int64]  # (2,) seconds, nanoseconds


def make_pump(buses: int, watched: Sequence[MessageLayout], result: MessageLayout | None) -> Pump:
    """Memory for so many buses; watched: messages whose arrivals are counted; result: that of the rates, if any."""
    places = buses * BATCH
    frames = np.zeros(places * SLOT, np.uint8)
    control = np.zeros(places * CONTROL_WORDS, np.int64)
    vectors, headers = np.zeros(places, IOVEC), np.zeros(places, MMSGHDR)
    vectors["base"] = frames.ctypes.data + np.arange(places, dtype=np.uint64) * SLOT
    vectors["length"] = SLOT
    headers["iov"] = vectors.ctypes.data + np.arange(places, dtype=np.uint64) * IOVEC.itemsize
    headers["iov_count"] = 1
    headers["control"] = control.ctypes.data + np.arange(places, dtype=np.uint64) * CONTROL_WORDS * 8
    arrivals = np.zeros(len(watched), ARRIVAL)
    arrivals["key"] = [each.key for each in watched]
    polled = np.zeros(buses, POLLFD)
    polled["events"] = POLLIN
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
        polled,
        frames,
        frames.view(np.uint32),
        frames.view(np.int64),
        control,
        headers,
        vectors,
        np.zeros(buses * ERRORS, ERROR),
        arrivals,
        np.zeros(WAITING * FD_MTU, np.uint8),
        np.ones(1, np.uint64),
        np.zeros(2, np.int64),
    )
