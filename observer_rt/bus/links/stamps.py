"""When a SocketCAN frame arrived: the stamps a socket delivers beside it, in integer nanoseconds since 1970."""

import array
import fcntl
import socket
import struct
import time

# Of the generic Linux interface (linux/net_tstamp.h, linux/ethtool.h), not known to Python's socket module.
SO_TIMESTAMPNS = 35
SO_TIMESTAMPING = 37
_RX_HARDWARE, _RX_SOFTWARE, _SOFTWARE, _RAW_HARDWARE = 1 << 2, 1 << 3, 1 << 4, 1 << 6
_SIOCETHTOOL = 0x8946
_ETHTOOL_GET_TS_INFO = 0x41
_TIMESPEC = struct.Struct("@ll")
_THREE_TIMESPECS = struct.Struct("@6l")  # by the kernel, unused, by the interface; 0 where there is none
_TS_INFO = struct.Struct("=II36x")  # command, capabilities, the rest of struct ethtool_ts_info
_IFREQ_POINTER = struct.Struct("@16sP16x")

ANCILLARY_BYTES = socket.CMSG_SPACE(_THREE_TIMESPECS.size)


class StampReader:
    """Reads the stamps of one socket; those of the interface itself where it offers them.

    The clock of an interface starts anywhere and nobody sets it: its stamps are carried to the computer's time by
    one offset, that of the first frame. Distances between stamps are those of the interface's clock, whatever the
    computer's load or changes of its time; from that time they differ by what the two have drifted apart since.
    """

    def __init__(self, can_socket: socket.socket, channel: str, computer_time: bool = False) -> None:
        """Switch stamps on; computer_time: never those of the interface. Raises OSError."""
        self.by_hardware = not computer_time and _offers_hardware_stamps(can_socket, channel)
        self._offset: int | None = None
        if self.by_hardware:
            wanted = _RX_HARDWARE | _RAW_HARDWARE | _RX_SOFTWARE | _SOFTWARE
            can_socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, wanted)
        else:
            can_socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)

    def read(self, kind: int, value: bytes) -> int | None:
        """The stamp [ns since 1970] in a control message of the socket level, None if it holds none."""
        if kind == SO_TIMESTAMPNS:
            seconds, nanoseconds = _TIMESPEC.unpack(value)
            return int(seconds * 1_000_000_000 + nanoseconds)
        if kind != SO_TIMESTAMPING:
            return None
        seconds, nanoseconds, _, _, raw_seconds, raw_nanoseconds = _THREE_TIMESPECS.unpack(value)
        by_kernel = int(seconds * 1_000_000_000 + nanoseconds) or time.time_ns()
        by_interface = int(raw_seconds * 1_000_000_000 + raw_nanoseconds)
        if by_interface == 0:  # such as a frame another program of this computer sent
            return by_kernel
        if self._offset is None:
            self._offset = by_kernel - by_interface
        return by_interface + self._offset


def _offers_hardware_stamps(can_socket: socket.socket, channel: str) -> bool:
    info = array.array("B", _TS_INFO.pack(_ETHTOOL_GET_TS_INFO, 0))
    try:
        fcntl.ioctl(can_socket, _SIOCETHTOOL, _IFREQ_POINTER.pack(channel.encode(), info.buffer_info()[0]))
    except OSError:  # a driver without the question, or no such interface: binding will tell
        return False
    _, capabilities = _TS_INFO.unpack(info)
    needed = _RX_HARDWARE | _RAW_HARDWARE
    return bool(capabilities & needed == needed)
