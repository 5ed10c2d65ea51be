"""Requests to stop a command, or to read its files again, which come as signals."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class SignalledEvent(threading.Event):
    """An event that a signal's handler may set in the midst of a wait for it: its lock is re-entrant."""

    def __init__(self) -> None:
        super().__init__()
        self._cond = threading.Condition(threading.RLock())


class StopRequest(SignalledEvent):
    """Set by the first signal that ends a command, which the next interrupts; reload: a signal asks to read again."""

    def __init__(self) -> None:
        super().__init__()
        self.reload = threading.Event()
        self._parts: list[threading.Event] = []

    @contextmanager
    def setting(self, part: threading.Event) -> Iterator[None]:
        """While the context lasts, set the event of a part of the command together with this one."""
        self._parts.append(part)
        if self.is_set():
            part.set()
        try:
            yield
        finally:
            self._parts.remove(part)

    def end(self, *_: object) -> None:
        """Set this event and the events that end with it."""
        self.set()
        for part in self._parts:
            part.set()

    def end_or_interrupt(self, *_: object) -> None:
        """End at the first call; raise `KeyboardInterrupt` at the second."""
        if self.is_set():
            raise KeyboardInterrupt
        self.end()


@contextmanager
def stop_on_signals(reloads: bool = False) -> Iterator[StopRequest]:
    """An event that SIGINT, SIGTERM, and SIGHUP unless it is ignored, set while the context lasts.

    reloads: SIGUSR1 asks to read files again, and SIGHUP where no terminal can hang up.
    """
    stop = StopRequest()
    handlers: dict[signal.Signals, Callable[..., None]] = dict.fromkeys(
        (signal.SIGINT, signal.SIGTERM), stop.end_or_interrupt
    )
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as under nohup
        is_asked = reloads and not any(map(os.isatty, range(3)))
        # a shell and the kernel both send it when a terminal is closed
        handlers[signal.SIGHUP] = (lambda *_: stop.reload.set()) if is_asked else stop.end
    if reloads:
        handlers[signal.SIGUSR1] = lambda *_: stop.reload.set()
    previous = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield stop
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
