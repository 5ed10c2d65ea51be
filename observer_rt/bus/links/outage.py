"""A link that went down or away, and its way back."""

import time
from concurrent.futures import Executor, Future

from observer_rt.bus.links.link import Link

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
