"""Signals that end a command in order, and the one that has a service read its files again."""

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator


class StopRequest(threading.Event):
    """Set by the first signal that ends a command; the next one interrupts it.

    reload: set by SIGHUP where it has files read again.
    """

    def __init__(self) -> None:
        super().__init__()
        self.reload = threading.Event()
        self._parts: list[threading.Event] = []

    @contextlib.contextmanager
    def setting(self, part: threading.Event) -> Iterator[None]:
        """While it lasts, the end of a part of the command is set with its own."""
        self._parts.append(part)
        if self.is_set():
            part.set()
        try:
            yield
        finally:
            self._parts.remove(part)

    def end(self, *_: object) -> None:
        """Set it, and what is set with it."""
        self.set()
        for part in self._parts:
            part.set()

    def end_or_interrupt(self, *_: object) -> None:
        """The same; when it is set already, interrupt."""
        if self.is_set():
            raise KeyboardInterrupt
        self.end()


@contextlib.contextmanager
def stop_on_signals(reloads: bool = False) -> Iterator[StopRequest]:
    """An event that the first SIGINT or SIGTERM sets while the context lasts, and SIGHUP unless it is ignored.

    reloads: SIGHUP asks to read files again where no terminal can hang up.
    """
    stop = StopRequest()
    handlers: dict[signal.Signals, Callable[..., None]] = dict.fromkeys(
        (signal.SIGINT, signal.SIGTERM), stop.end_or_interrupt
    )
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as under nohup
        is_asked = reloads and not any(map(os.isatty, range(3)))
        # a shell and the kernel both send it when a terminal is closed
        handlers[signal.SIGHUP] = (lambda *_: stop.reload.set()) if is_asked else stop.end
    previous = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield stop
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
