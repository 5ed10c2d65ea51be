"""Messages to systemd: the service is ready, alive, stops, and what it does."""

import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress

_FEEDS = 3  # in a watchdog's time-out


class Notifier:
    """Tells the service manager of this process; without one it does nothing."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._socket: socket.socket | None = None
        address = environment.get("NOTIFY_SOCKET", "")
        if address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
            self._address = f"\0{address[1:]}" if address.startswith("@") else address
        own, timeout = str(os.getpid()), environment.get("WATCHDOG_USEC", "")  # empty ones count as none
        is_watched = timeout.isdecimal() and (environment.get("WATCHDOG_PID") or own) == own
        self._period = int(timeout) * 1e-6 / _FEEDS if is_watched else 0.0
        self._due = 0.0

    def ready(self) -> None:
        """Reports that the service runs."""
        self._tell("READY=1")

    def status(self, text: str) -> None:
        """Sets the line of `systemctl status`."""
        self._tell("STATUS=" + text.partition("\n")[0])

    def alive(self) -> None:
        """Feeds the watchdog when it is due; the loop calls it in every round."""
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
