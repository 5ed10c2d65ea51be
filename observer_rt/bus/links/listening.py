"""Listens a moment whether another node sends what will be sent."""

import threading
import time
from collections.abc import Mapping

from observer_rt.bus.links.link import BusFrame, Link

LISTENING = 0.5  # s; a windowed source pauses for about a tenth
_TURN = 0.02  # s, of one bus among several


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
