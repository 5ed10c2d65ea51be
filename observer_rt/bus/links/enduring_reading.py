"""Reading of several links that goes on while an interface is down or away."""

import threading
import time
from collections.abc import Sequence
from queue import Empty, SimpleQueue

from observer_rt.bus.links.link import LONGEST_WAIT, BusFrame, Link, LinkDownError
from observer_rt.bus.links.opening import reconnect

CAPACITY = 20_000  # frames that reading threads keep; what comes on top of them waits in the drivers
_FULL_WAIT = 1e-3  # s


class EnduringReading:
    """Receives from several links, a thread each, in the order read; reconnects a link that went down."""

    def __init__(self, links: Sequence[Link]) -> None:
        self._links = links
        self._outages = [0] * len(links)
        self._dropped = [link.dropped for link in links]
        self._arrived: SimpleQueue[tuple[BusFrame, int] | Exception] = SimpleQueue()
        self._ended = threading.Event()
        self._threads = [
            threading.Thread(target=self._read, args=(bus,), name=f"reading bus {bus}", daemon=True)
            for bus in range(len(links))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def outages(self) -> int:
        """Number of times an interface went down or away."""
        return sum(self._outages)

    @property
    def dropped(self) -> int:
        """Frames that all links together lost before those that were taken."""
        return sum(self._dropped)

    def receive(self, timeout_s: float) -> BusFrame | None:
        """The next frame of any bus, None if none came within a while [s]; those left can be taken after `close`.

        Raises what made a link fail for good.
        """
        try:
            arrived = self._arrived.get(timeout=timeout_s)
        except Empty:
            self._dropped = [link.dropped for link in self._links]
            return None
        if isinstance(arrived, Exception):
            raise arrived
        frame, dropped = arrived
        self._dropped[frame.bus] = dropped
        return frame

    def close(self) -> None:
        """End the threads; the links stay open."""
        self._ended.set()
        for thread in self._threads:
            thread.join()

    def _read(self, bus: int) -> None:
        link = self._links[bus]
        try:
            while not self._ended.is_set():
                if self._arrived.qsize() > CAPACITY:
                    time.sleep(_FULL_WAIT)
                    continue
                try:
                    frame = link.receive(LONGEST_WAIT)
                except LinkDownError:
                    self._outages[bus] += 1
                    reconnect(link, self._ended)
                else:
                    if frame is not None:
                        self._arrived.put((BusFrame(bus, frame), link.dropped))
        except Exception as error:  # whatever it is, who receives must get it
            self._arrived.put(error)
