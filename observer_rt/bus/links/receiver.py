"""Frames of one bus or of several, whichever comes first: none waits for another, and all stamps are of one clock."""

import select
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue

from observer_rt.bus.links.link import BusFrame, Frame, Link, LinkDownError

LONGEST_WAIT = 0.02  # s that a reading thread is deaf to its end
Choice = Callable[[Sequence[int]], int]
CAPACITY = 20_000  # frames that reading threads keep; what comes on top of them waits in the drivers
_FULL_WAIT = 1e-3  # s


class BusDownError(LinkDownError):
    """The interface of one bus went down or away."""

    def __init__(self, bus: int, error: LinkDownError) -> None:
        self.bus = bus
        super().__init__(str(error))


class Reading(ABC):
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

    @abstractmethod
    def close(self) -> None:
        """End what runs beside; the links stay open."""


def reading(links: Sequence[Link], furthest_behind: Choice = min) -> Reading:
    """What reads these links: a single one without detour, several at once by `poll` where all have a descriptor.

    furthest_behind: tells which of some buses to take the next frame from, where stamps cannot.
    """
    if len(links) == 1:
        return _Single(links[0])
    if any(link.descriptor is None for link in links):
        return _Threaded(links, furthest_behind)
    return _Polled(links)


class _Single(Reading):
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

    def close(self) -> None:
        pass


class _Polled(Reading):
    """One system call looks at all sockets. Of frames that wait the earliest comes first, so that a backlog of all
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

    def close(self) -> None:
        pass


class _Threaded(Reading):
    """A thread for each link, for drivers that cannot be waited for together. Their stamps may tell no order, so of
    frames that wait those of the bus come first that is `furthest_behind`."""

    def __init__(self, links: Sequence[Link], furthest_behind: Choice) -> None:
        self._links = links
        self._furthest_behind = furthest_behind
        self._arrived: SimpleQueue[tuple[int, threading.Event, Frame | Exception]] = SimpleQueue()
        self._waiting: dict[int, deque[Frame]] = {bus: deque() for bus in range(len(links))}
        self._readers: dict[int, tuple[threading.Thread, threading.Event]] = {}
        for bus in range(len(links)):
            self.take_back(bus)

    def receive(self, timeout_s: float) -> BusFrame | None:
        buses = self._buses_waiting()
        if not buses:
            self._sort_in(timeout_s)
            buses = self._buses_waiting()
        elif self._arrived.qsize():
            self._sort_in(0.0)
            buses = self._buses_waiting()
        if not buses:
            return None
        bus = buses[0] if len(buses) == 1 else self._furthest_behind(buses)
        return BusFrame(bus, self._waiting[bus].popleft())

    def _buses_waiting(self) -> list[int]:
        return [bus for bus, frames in self._waiting.items() if frames]

    def _sort_in(self, timeout_s: float) -> None:
        """What has arrived, by its bus; waits for the first. Raises as `receive`."""
        for number in range(1 + self._arrived.qsize()):
            wait = timeout_s if number == 0 else 0.0
            try:
                bus, end, arrived = self._arrived.get(wait > 0.0, wait or None)
            except Empty:
                return
            if not isinstance(arrived, Exception):
                self._waiting[bus].append(arrived)
            elif isinstance(arrived, LinkDownError) and not end.is_set():
                raise BusDownError(bus, arrived) from arrived
            elif not end.is_set():  # else known already, from sending
                raise arrived

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
            if arrived.qsize() + len(self._waiting[bus]) > CAPACITY:
                time.sleep(_FULL_WAIT)
                continue
            try:
                frame = link.receive(LONGEST_WAIT)
            except Exception as error:  # whatever it is, the loop that serves all buses must hear of it
                arrived.put((bus, end, error))
                return
            if frame is not None:
                arrived.put((bus, end, frame))
