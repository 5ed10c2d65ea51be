"""The receive buffer of a socket: its size, and the frames for which it had no room."""

import socket
import struct
from contextlib import suppress

_SO_RCVBUFFORCE, _SO_MEMINFO = 33, 55  # of asm-generic/socket.h, not known to Python's socket module
_MEMORY_FIGURES = struct.Struct("=9I")  # of linux/sock_diag.h; the last one counts what was dropped

RECEIVE_BUFFER_BYTES = 16 << 20  # some 20,000 frames; the usual default holds about 300


def size_receive_buffer(receiver: socket.socket, name: str, frame_bytes: int) -> list[str]:
    """Returns a warning where the kernel gives less than is wanted. frame_bytes: of it, about what a frame takes."""
    try:
        receiver.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, RECEIVE_BUFFER_BYTES)
    except PermissionError:  # needs CAP_NET_ADMIN; else the most that net.core.rmem_max allows
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    granted = receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)  # twice what was asked for
    if granted >= 2 * RECEIVE_BUFFER_BYTES:
        return []
    return [
        f"the kernel gives {name} a receive buffer for some {granted // frame_bytes} frames only: more are lost when "
        f"this process has to wait\n  remedy: sudo sysctl --write net.core.rmem_max={RECEIVE_BUFFER_BYTES}"
    ]


def lost_by(receiver: socket.socket) -> int:
    """Frames for which a socket had no room since it was made, in 32 bits; 0 where the kernel does not tell."""
    with suppress(OSError):
        figures = receiver.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMORY_FIGURES.size)
        return int(_MEMORY_FIGURES.unpack(figures)[-1])
    return 0


class LostFrames:
    """Frames that a link lost by all its sockets so far, one after another."""

    def __init__(self) -> None:
        self.count = 0
        self._by_socket = 0

    def begin(self, by_socket: int = 0) -> None:
        """From now on another socket counts, which stands at this number."""
        self._by_socket = by_socket

    def note(self, by_socket: int) -> None:
        """The socket stands at this number, in 32 bits: across its wrap, too."""
        more = (by_socket - self._by_socket) & 0xFFFFFFFF
        self._by_socket += more
        self.count += more
