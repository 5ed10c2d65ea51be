"""Opening of links, also after an outage; links over a descriptor, idle links; listening for other senders."""

import os
import socket
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from ctypes.util import find_library
from importlib.util import find_spec

from observer_rt.bus.links.link import BusFrame, Frame, Link, LinkDownError
from observer_rt.bus.links.socketcan import SocketCanLink, StampReader
from observer_rt.foundation.errors import RunError, UserError, did_you_mean

_OURS = ("socketcan", "descriptor")
LISTENING = 0.5  # s; a windowed source pauses for about a tenth
_TURN = 0.02  # s, of one bus among several
RECONNECT_PERIOD = 0.1  # s between tries
# What drivers of python-can need besides: a package, by what is imported; a library of the vendor; Windows.
_PACKAGES = {
    "udp_multicast": ("msgpack", "msgpack"),
    **dict.fromkeys(("slcan", "serial", "robotell", "seeedstudio"), ("serial", "pyserial")),
    **{"gs_usb": ("usb", "gs_usb"), "neovi": ("ics", "python-ics")},
    **{name: (name, name) for name in ("canalystii", "cantact")},
}
_LIBRARIES = {"pcan": "pcanbasic", "kvaser": "canlib"}
_FOR_WINDOWS = ("etas", "ixxat", "nican", "nixnet", "systec", "usb2can", "vector")


class DescriptorLink(SocketCanLink):
    """Link over one end of a pair of sockets that keep messages apart (AF_UNIX, SOCK_SEQPACKET or SOCK_DGRAM).

    Each message is a `struct canfd_frame` or `struct can_frame`. `channel`: the descriptor's number, which stays open
    when the link is closed.
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
        # No kernel chooses here: a frame that nobody wants ends the wait early, which callers must expect anyway.
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
    """Never brings a frame, and never fails: one end of a pair of sockets that nobody writes to."""

    def __init__(self) -> None:
        ours, self._other_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours:
            super().__init__(str(ours.fileno()), True, [])

    def close(self) -> None:
        super().close()
        self._other_end.close()


def require_interface(location: str, name: str) -> None:
    """Raise `UserError` for an unknown interface; location: where the user states it."""
    if name in _OURS:
        return
    import can  # only for those who use one of its drivers

    interfaces = sorted({"socketcan", *can.VALID_INTERFACES})
    if name not in interfaces:
        problem = f"unknown interface {name!r}"
        raise UserError(location, problem, f"{did_you_mean(name, interfaces)}use one of {', '.join(interfaces)}")


def missing_driver(interface: str) -> str:
    """Remedy for a driver of an interface that this computer lacks; empty where none is known to be missing."""
    module, package = _PACKAGES.get(interface, ("", ""))
    if module and find_spec(module) is None:
        return f"pip install {package}"
    if (library := _LIBRARIES.get(interface)) and not find_library(library):
        return f"install lib{library} of the vendor, or use socketcan if the kernel drives the device"
    if interface in _FOR_WINDOWS:
        return "python-can drives it on Windows only: use socketcan if the kernel drives the device"
    return ""


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
        UserError: no such interface, or its driver is not installed.
        RunError: the interface is there but cannot be used.
    """
    require_interface("link.interface", interface)
    if interface == "socketcan":
        return SocketCanLink(channel, fd, receive_ids, computer_time)
    if interface == "descriptor":
        return DescriptorLink(channel, fd, receive_ids, computer_time)
    if remedy := missing_driver(interface):
        raise UserError("link.interface", f"{interface!r} cannot be used on this computer", remedy)
    from observer_rt.bus.links.python_can import PythonCanLink  # only for those who use one of its drivers

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


def reconnect(link: Link, stop: threading.Event) -> bool:
    """Try again and again to reconnect a link that is down; False: `stop` was set before it is back."""
    while not stop.wait(RECONNECT_PERIOD):
        with suppress(LinkDownError):
            link.reconnect()
            return True
    return False


class BusDownError(LinkDownError):
    """The interface of one bus went down or away."""

    def __init__(self, bus: int, error: LinkDownError) -> None:
        self.bus = bus
        super().__init__(str(error))
