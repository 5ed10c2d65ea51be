"""Frames of links whose interfaces may go away and come back: whoever reads them need not care."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

from observer_rt.bus.links.link import BusFrame, Link, LinkDownError
from observer_rt.bus.links.outage import Outage
from observer_rt.bus.links.receiver import BusDownError, reading


class EnduringReading:
    """Receives from several links; one that is down is left out until it is back."""

    def __init__(self, links: Sequence[Link]) -> None:
        self.outages = 0
        """How often an interface went down or away."""
        self.down: Mapping[int, str] = {}
        """Why, of the buses that are down now; replaced, never changed."""
        self._links = links
        self._reading = reading(links)
        self._outages: dict[int, Outage] = {}  # by bus
        self._executor = ThreadPoolExecutor(1)

    @property
    def dropped(self) -> int:
        """Frames that all links together lost so far."""
        return sum(link.dropped for link in self._links)

    def receive(self, timeout_s: float) -> BusFrame | None:
        """The next frame, None if none came within a while [s], or none can. Raises `RunError` if a link failed."""
        for bus, outage in list(self._outages.items()):
            with suppress(LinkDownError):
                if outage.is_over(self._executor):
                    del self._outages[bus]
                    self.down = {other: why for other, why in self.down.items() if other != bus}
                    self._reading.take_back(bus)
        try:
            return self._reading.receive(timeout_s)
        except BusDownError as error:
            self.outages += 1
            self._reading.leave_out(error.bus)
            self._outages[error.bus] = Outage(self._links[error.bus])
            self.down = {**self.down, error.bus: str(error)}
            return None

    def close(self) -> None:
        """End what runs beside; the links stay open."""
        self._executor.shutdown()
        self._reading.close()
