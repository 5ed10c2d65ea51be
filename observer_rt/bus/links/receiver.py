"""Frames of one bus or of several, whichever comes first, on one clock; links that were down come back."""

import select
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from queue import Empty, SimpleQueue

from observer_rt.bus.links.link import BusFrame, Frame, Link, LinkDownError

LONGEST_WAIT = 0.02  # s that a reading thread is deaf to its end
CAPACITY = 20_000  # frames that reading threads keep; what comes on top of them waits in the drivers
_FULL_WAIT = 1e-3  # s

RECONNECT_PERIOD = 0.1  # s between tries


class BusDownError(LinkDownError):
    """The interface of one bus went down or away."""

    def __init__(self, bus: int, error: LinkDownError) -> None:
        self.bus = bus
        super().__init__(str(error))


class LinkReceiver(ABC):
    """Receives from several links; bus numbers are their places."""

    @abstractmethod
    def receive(self, timeout_s: float) -> BusFrame | None:
        """The next frame of any bus, or None if none came within `timeout_s` [s], or soon before.

        Raises:
            BusDownError: the interface of a bus went down or away. Call `leave_out`, reconnect it, `take_back`.
            RunError: one failed otherwise.
        """

    @abstractmethod
    def leave_out(self, bus: int) -> None:
        """Receive nothing from a bus any more."""

    @abstractmethod
    def take_back(self, bus: int) -> None:
        """Receive from a bus again, whose link was reconnected."""

    def close(self) -> None:
        """End what runs beside, if anything does; the links stay open."""
        return


def reading(links: Sequence[Link]) -> LinkReceiver:
    """Receiver of these links: a single one without detour, several at once by `poll` where all have a descriptor."""
    if len(links) == 1:
        return _Single(links[0])
    if any(link.descriptor is None for link in links):
        return _Threaded(links)
    return _Polled(links)


class _Single(LinkReceiver):
    def __init__(self, link: Link) -> None:
        self._link = link
        self._is_down = False

    def receive(self, timeout_s: float) -> BusFrame | None:
        if self._is_down:
            time.sleep(timeout_s)
            return None
        try:
            frame = self._link.receive(timeout_s)
        except LinkDownError as error:
            raise BusDownError(0, error) from error
        return None if frame is None else BusFrame(0, frame)

    def leave_out(self, bus: int) -> None:
        self._is_down = True

    def take_back(self, bus: int) -> None:
        self._is_down = False


class _Polled(LinkReceiver):
    """Looks at all sockets in one system call. Of frames that wait the earliest comes first, so that a backlog of all
    buses is worked off side by side."""

    def __init__(self, links: Sequence[Link]) -> None:
        self._links = links
        self._poll = select.poll()
        self._bus_of: dict[int, int] = {}
        self._waiting: dict[int, Frame] = {}  # the next frame of a bus
        for bus in range(len(links)):
            self.take_back(bus)

    def receive(self, timeout_s: float) -> BusFrame | None:
        waiting = self._waiting
        for descriptor, _ in self._poll.poll(0 if waiting else 1e3 * timeout_s):
            bus = self._bus_of[descriptor]
            if bus in waiting:
                continue
            try:
                frame = self._links[bus].receive(0.0)
            except LinkDownError as error:
                raise BusDownError(bus, error) from error
            if frame is not None:
                waiting[bus] = frame
        if not waiting:
            return None
        bus = min(waiting, key=lambda number: waiting[number].stamp_ns)
        return BusFrame(bus, waiting.pop(bus))

    def leave_out(self, bus: int) -> None:
        descriptor = next(number for number, of in self._bus_of.items() if of == bus)
        del self._bus_of[descriptor]
        self._poll.unregister(descriptor)

    def take_back(self, bus: int) -> None:
        descriptor = self._links[bus].descriptor
        assert descriptor is not None
        self._bus_of[descriptor] = bus
        self._poll.register(descriptor, select.POLLIN)


class _Threaded(LinkReceiver):
    """A thread for each link, for drivers that cannot be waited for together: frames come in the order read."""

    def __init__(self, links: Sequence[Link]) -> None:
        self._links = links
        self._arrived: SimpleQueue[tuple[int, Frame | Exception]] = SimpleQueue()
        self._readers: dict[int, tuple[threading.Thread, threading.Event]] = {}
        for bus in range(len(links)):
            self.take_back(bus)

    def receive(self, timeout_s: float) -> BusFrame | None:
        try:
            bus, arrived = self._arrived.get(timeout_s > 0.0, timeout_s)
        except Empty:
            return None
        if isinstance(arrived, LinkDownError):
            raise BusDownError(bus, arrived) from arrived
        if isinstance(arrived, Exception):
            raise arrived
        return BusFrame(bus, arrived)

    def leave_out(self, bus: int) -> None:
        thread, end = self._readers.pop(bus)
        end.set()
        thread.join()

    def take_back(self, bus: int) -> None:
        end = threading.Event()
        thread = threading.Thread(target=self._read, args=(bus, end), name=f"reading bus {bus}", daemon=True)
        self._readers[bus] = thread, end
        thread.start()

    def close(self) -> None:
        for bus in list(self._readers):
            self.leave_out(bus)

    def _read(self, bus: int, end: threading.Event) -> None:
        link, arrived = self._links[bus], self._arrived
        while not end.is_set():
            if arrived.qsize() > CAPACITY:
                time.sleep(_FULL_WAIT)
                continue
            try:
                frame = link.receive(LONGEST_WAIT)
            except Exception as error:  # whatever it is, the reader of all buses must get it
                arrived.put((bus, error))
                return
            if frame is not None:
                arrived.put((bus, frame))


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


class EnduringReading:
    """Receives from several links; one that is down is left out until it is back."""

    def __init__(self, links: Sequence[Link]) -> None:
        self.outages = 0
        """Number of times an interface went down or away."""
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
