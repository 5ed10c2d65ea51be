"""Opening of links by interface and channel, also after an outage; listening for other senders."""

import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from ctypes.util import find_library
from importlib.util import find_spec

from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.links.link import BusFrame, Link, LinkDownError
from observer_rt.bus.links.socketcan import SocketCanLink
from observer_rt.foundation.errors import UserError, did_you_mean

_OWN_INTERFACES = ("socketcan", "descriptor")  # served without python-can
LISTENING = 0.5  # s; a windowed source pauses for about a tenth
_TURN = 0.02  # s, of one bus among several
RECONNECT_PERIOD = 0.1  # s between tries
_PACKAGES = {  # Needs of python-can's drivers: module to import and its package; a vendor's library; Windows.
    "udp_multicast": ("msgpack", "msgpack"),
    **dict.fromkeys(("slcan", "serial", "robotell", "seeedstudio"), ("serial", "pyserial")),
    **{"gs_usb": ("usb", "gs_usb"), "neovi": ("ics", "python-ics")},
    **{name: (name, name) for name in ("canalystii", "cantact")},
}
_LIBRARIES = {"pcan": "pcanbasic", "kvaser": "canlib"}
_FOR_WINDOWS = ("etas", "ixxat", "nican", "nixnet", "systec", "usb2can", "vector")


def require_interface(location: str, name: str) -> None:
    """Raise `UserError` for an unknown interface; location: where the user states it."""
    if name in _OWN_INTERFACES:
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
    bit_rates: Sequence[float] = (),
) -> Link:
    """Connect to `channel` of a python-can interface; `socketcan` is served by a faster implementation.

    `descriptor` is no interface: `channel` is a socket number given to this process. `fd`: allow CAN FD frames.
    `receive_ids`: wanted (identifier, is extended) pairs, None: all. `computer_time`: stamp by this computer's clock,
    to compare links. `bit_rates` [bit/s]: of python-can's drivers, whose configuration files do not count; the second
    of CAN FD data; empty: as these begin. Raises `UserError` without the interface or driver, `RunError` where it
    cannot be used.
    """
    require_interface("link.interface", interface)
    if interface == "socketcan":
        return SocketCanLink(channel, fd, receive_ids, computer_time)
    if interface == "descriptor":
        return DescriptorLink(channel, fd, receive_ids, computer_time)
    if remedy := missing_driver(interface):
        raise UserError("link.interface", f"{interface!r} cannot be used on this computer", remedy)
    from observer_rt.bus.links.python_can import PythonCanLink  # only for those who use one of its drivers

    return PythonCanLink(interface, channel, fd, receive_ids, computer_time, bit_rates)


def first_heard(links: Mapping[int, Link], stop: threading.Event) -> BusFrame | None:
    """The first frame of another node within `LISTENING` on links, by bus; None: nobody else sends.

    links: receive only messages that will be sent; `stop` ends listening early. Raises `RunError` when one fails.
    """
    end = time.monotonic() + LISTENING
    while time.monotonic() < end and not stop.is_set():
        for bus, link in links.items():
            frame = link.receive(_TURN)
            if frame is not None:
                return BusFrame(bus, frame)
    return None


def reconnect(link: Link, stop: threading.Event) -> bool:
    """Try to reconnect a link that is down until it is back, or `stop` is set: False."""
    while not stop.wait(RECONNECT_PERIOD):
        with suppress(LinkDownError):
            link.reconnect()
            return True
    return False
