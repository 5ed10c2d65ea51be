"""Notification of systemd by a service of `Type=notify`: sd_notify(3), over the socket it names."""

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress

_FEEDS = 3  # a watchdog's time-out that long


class Notifier:
    """Tells the service manager of this process; without one it does nothing."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._socket: socket.socket | None = None
        address = environment.get("NOTIFY_SOCKET", "")
        if address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
            self._address = f"\0{address[1:]}" if address.startswith("@") else address
        for_us = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        timeout = int(environment.get("WATCHDOG_USEC", 0)) if for_us else 0
        self._period = timeout * 1e-6 / _FEEDS
        self._due = 0.0

    def ready(self) -> None:
        """Reports that the service runs."""
        self._tell("READY=1")

    def status(self, text: str) -> None:
        """Sets the line of `systemctl status`."""
        self._tell("STATUS=" + text.partition("\n")[0])

    def alive(self) -> None:
        """Feeds the watchdog when it is due; to be called often, whenever the loop went round."""
        if self._period and time.monotonic() >= self._due:
            self._due = time.monotonic() + self._period
            self._tell("WATCHDOG=1")

    def stopping(self) -> None:
        """Reports that the service was asked to stop."""
        self._tell("STOPPING=1")

    def _tell(self, message: str) -> None:
        if self._socket is None:
            return
        with suppress(OSError):  # a manager that does not listen is no reason to stop observing
            self._socket.sendto(message.encode(), self._address)


class WatchdogPulse:
    """Feeds the watchdog for several loops: when all that run have gone round, and not while one hangs."""

    def __init__(self, notifier: Notifier, loops: int) -> None:
        self._notifier = notifier
        self._lock = threading.Lock()
        self._running = self._awaited = frozenset(range(loops))

    @contextmanager
    def beating(self, loop: int) -> Iterator[Callable[[], None]]:
        """Yields a beat to be called whenever loop number `loop` went round; afterwards nobody waits for it.

        After the last one the manager hears that the service stops.
        """
        try:
            yield lambda: self._hear(loop)
        finally:
            with self._lock:
                self._running -= {loop}
                self._awaited -= {loop}
                if not self._running:
                    self._notifier.stopping()

    def _hear(self, loop: int) -> None:
        with self._lock:
            self._awaited -= {loop}
            if not self._awaited:
                self._awaited = self._running
                self._notifier.alive()
