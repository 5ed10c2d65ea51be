"""A link to nothing: in the place of a bus that is not used."""

import socket

from observer_rt.bus.links.descriptor import DescriptorLink


class IdleLink(DescriptorLink):
    """Never brings a frame, and never fails: one end of a pair of sockets that nobody writes to."""

    def __init__(self) -> None:
        ours, self._other_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours:
            super().__init__(str(ours.fileno()), True, [])

    def close(self) -> None:
        super().close()
        self._other_end.close()
