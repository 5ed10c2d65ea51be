"""Links that go down or away, and their way back: whoever reads their frames need not care."""

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress

from observer_rt.bus.links.link import BusFrame, Link, LinkDownError
from observer_rt.bus.links.receiver import BusDownError, reading

RECONNECT_PERIOD = 0.1  # s between tries


class Outage:
    """From a `LinkDownError` until the link is back. It is reconnected beside: whoever asks waits for nothing."""

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
