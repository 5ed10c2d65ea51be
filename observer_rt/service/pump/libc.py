"""Calls of the C library from compiled code, without a detour through Python. Linux, 64 bits.

Structures as of socket(7), recvmmsg(2), poll(2) and linux/can.h, in the machine's byte order.
"""

import numpy as np
from numba import types

EINTR, EAGAIN, ENODEV, ENETDOWN, ENOBUFS = 4, 11, 19, 100, 105
MSG_DONTWAIT, MSG_WAITFORONE = 0x40, 0x10000
POLLIN = 0x1
CLOCK_REALTIME, CLOCK_MONOTONIC = 0, 1
SOL_SOCKET = 1

IOVEC = np.dtype([("base", np.uint64), ("length", np.uint64)], align=True)
MMSGHDR = np.dtype(
    [
        ("name", np.uint64),
        ("name_length", np.uint64),
        ("iov", np.uint64),
        ("iov_count", np.uint64),
        ("control", np.uint64),
        ("control_length", np.uint64),
        ("flags", np.int64),
        ("length", np.uint64),  # received
    ],
    align=True,
)
POLLFD = np.dtype([("fd", np.int32), ("events", np.int16), ("revents", np.int16)], align=True)

_FD, _ADDRESS, _COUNT = types.int32, types.uintp, types.uint32
recvmmsg = types.ExternalFunction("recvmmsg", types.int32(_FD, _ADDRESS, _COUNT, types.int32, types.uintp))
send = types.ExternalFunction("send", types.intp(_FD, _ADDRESS, types.uintp, types.int32))
write = types.ExternalFunction("write", types.intp(_FD, _ADDRESS, types.uintp))
poll = types.ExternalFunction("poll", types.int32(_ADDRESS, types.uintp, types.int32))
clock_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, _ADDRESS))
errno_location = types.ExternalFunction("__errno_location", types.CPointer(types.int32)())
