"""Outages of links: the error for a bus that is down, and the tries to reconnect its link beside the loop."""

import time
from concurrent.futures import Executor, Future

from observer_rt.bus.links.link import Link, LinkDownError

RECONNECT_PERIOD = 0.1  # s between tries


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
