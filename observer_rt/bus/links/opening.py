"""Opens links, and again after an outage: chooses the implementation; listens a moment who else sends."""

import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future

from observer_rt.bus.links.link import BusFrame, Link, LinkDownError
from observer_rt.foundation.errors import UserError, did_you_mean

_OURS = ("socketcan", "descriptor")
LISTENING = 0.5  # s; a windowed source pauses for about a tenth
_TURN = 0.02  # s, of one bus among several
RECONNECT_PERIOD = 0.1  # s between tries


def require_interface(location: str, name: str) -> None:
    """Raise `UserError` for an unknown interface; location: where the user states it."""
    if name in _OURS:
        return
    import can  # only for those who use one of its drivers

    interfaces = sorted({"socketcan", *can.VALID_INTERFACES})
    if name not in interfaces:
        raise UserError(
            location,
            f"unknown interface {name!r}",
            f"{did_you_mean(name, interfaces)}use one of {', '.join(interfaces)}",
        )


def open_link(
    interface: str,
    channel: str,
    fd: bool,
    receive_ids: Sequence[tuple[int, bool]] | None = None,
    computer_time: bool = False,
) -> Link:
    """Connect to `channel` of a python-can interface; `socketcan` is served by a faster implementation.

    `descriptor` is no interface: `channel` is the number of a socket this process was given.

    `fd`: allow CAN FD frames. `receive_ids`: the (identifier, is extended) pairs wanted; None means all,
    empty none. `computer_time`: stamp by the clock of this computer even if interface or driver have a better one,
    so that stamps of several links can be compared.

    Raises:
        UserError: no such interface.
        RunError: the interface is there but cannot be used.
    """
    require_interface("link.interface", interface)
    # Imported here so that neither python-can's drivers nor Linux are needed by those who use the other.
    if interface == "socketcan":
        from observer_rt.bus.links.socketcan import SocketCanLink

        return SocketCanLink(channel, fd, receive_ids, computer_time)
    if interface == "descriptor":
        from observer_rt.bus.links.descriptor import DescriptorLink

        return DescriptorLink(channel, fd, receive_ids, computer_time)
    from observer_rt.bus.links.python_can import PythonCanLink

    return PythonCanLink(interface, channel, fd, receive_ids, computer_time)


def first_heard(links: Mapping[int, Link], stop: threading.Event) -> BusFrame | None:
    """The first frame within a moment on links that receive what will be sent; None: nobody else sends it.

    links: by bus; `stop` ends it early. Raises `RunError` when a link fails.
    """
    end = time.monotonic() + LISTENING
    while time.monotonic() < end and not stop.is_set():
        for bus, link in links.items():
            frame = link.receive(_TURN)
            if frame is not None:
                return BusFrame(bus, frame)
    return None


class BusDownError(LinkDownError):
    """The interface of one bus went down or away."""

    def __init__(self, bus: int, error: LinkDownError) -> None:
        self.bus = bus
        super().__init__(str(error))


class Outage:
    """Time from a `LinkDownError` until the link is back, reconnected beside: whoever asks waits for nothing."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._attempt: Future[None] | None = None
        self._due = time.monotonic() + RECONNECT_PERIOD

    def is_over(self, executor: Executor) -> bool:
        """Whether the link can be used again; tries that are due are made in the executor.

        Raises:
            LinkDownError: why the last try failed; others follow.
            RunError: it failed for good.
        """
        if self._attempt is None:
            if time.monotonic() >= self._due:
                self._attempt = executor.submit(self._link.reconnect)
            return False
        if not self._attempt.done():
            return False
        attempt, self._attempt = self._attempt, None
        self._due = time.monotonic() + RECONNECT_PERIOD
        attempt.result()
        return True
