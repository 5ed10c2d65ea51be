"""Who else sends on a bus: two senders of one identifier destroy each other's frames, or mix two recordings."""

import threading
import time
from collections.abc import Collection, Mapping
from contextlib import ExitStack

from observer_rt.bus.links.link import BusFrame, Link
from observer_rt.bus.links.open import open_link
from observer_rt.config.links import LinkConfig
from observer_rt.foundation.errors import UserError
from observer_rt.recording.replay.remapping import Sent

LISTENING = 0.5  # s; a windowed source pauses for about a tenth
_TURN = 0.02  # s, of one bus among several


def refuse_traffic(buses: Mapping[int, LinkConfig], sent: Collection[Sent], stop: threading.Event) -> None:
    """Listen a moment on all buses. `stop` ends it early.

    Raises:
        UserError: something of what will be sent is sent already, on the same bus.
        RunError: the interface cannot be used.
    """
    with ExitStack() as stack:
        links = {
            bus: stack.enter_context(
                open_link(config.interface, config.channel, config.fd, _identifiers(sent, bus))
            )
            for bus, config in buses.items()
        }
        heard = first_heard(links, stop)
    if heard is not None:
        config = buses[heard.bus]
        raise UserError(
            f"{config.interface} {config.channel}",
            f"another sender is active: frames with identifier 0x{heard.frame.frame_id:X} come in already",
            "stop it, send under another identifier (--map-id), or send all the same (--force)",
        )


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


def _identifiers(sent: Collection[Sent], bus: int) -> list[tuple[int, bool]]:
    return sorted((each.identifier, each.is_extended) for each in sent if each.bus == bus)
