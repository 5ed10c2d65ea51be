"""Links over a descriptor: one end of a pair of sockets, which another process or thread feeds, or nobody."""

import os
import socket

from observer_rt.bus.links.link import Frame, LinkDownError
from observer_rt.bus.links.socketcan import SocketCanLink, StampReader
from observer_rt.foundation.errors import RunError, UserError


class DescriptorLink(SocketCanLink):
    """Link over one end of a message-keeping pair of sockets (AF_UNIX, SOCK_SEQPACKET or SOCK_DGRAM).

    Each message is a `struct canfd_frame` or `struct can_frame`; `channel`: number of the descriptor, left open.
    """

    def _connect(self) -> None:
        try:
            self._socket = socket.socket(fileno=os.dup(int(self._channel)))
        except (ValueError, OSError) as error:
            remedy = "give the number of one that was handed to this process"
            raise UserError("link.channel", f"{self._channel!r} is not the descriptor of a socket", remedy) from error
        self._socket.setblocking(False)
        self._stamps = StampReader(self._socket, self._channel, computer_time=True)

    def receive(self, timeout_s: float) -> Frame | None:
        # no kernel filters here: an unwanted frame ends the wait early, which callers must expect anyway
        frame = super().receive(timeout_s)
        wanted = self._receive_ids
        if frame is None or wanted is None or (frame.frame_id, frame.is_extended) in wanted:
            return frame
        return None

    def failure(self, error: OSError) -> Exception:
        failure = super().failure(error)
        if isinstance(failure, LinkDownError):  # nothing that comes back
            return RunError(f"the other end of descriptor {self._channel} was closed")
        return failure


class IdleLink(DescriptorLink):
    """A link that never brings a frame and never fails: one end of a pair of sockets that nobody writes to."""

    def __init__(self) -> None:
        ours, self._other_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours:
            super().__init__(str(ours.fileno()), True, [])

    def close(self) -> None:
        super().close()
        self._other_end.close()
