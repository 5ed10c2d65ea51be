"""One connection for several who use the same bus: of interfaces that can be opened once only."""

import threading
from collections.abc import Callable, Sequence
from queue import Empty, Full, Queue

from observer_rt.bus.links.controller import BusCondition
from observer_rt.bus.links.link import SWITCHED, FdFlags, Frame, Link, StampSource

CAPACITY = 20_000  # frames that wait for one user
_LONGEST_WAIT = 0.02  # s that the reading thread is deaf to its end


class SharedBus:
    """Connects when its first user comes, disconnects with its last; a thread hands every frame to who wants it."""

    def __init__(self, connect: Callable[[], Link]) -> None:
        """connect: opens the link, for all identifiers that any user wants."""
        self._connect = connect
        self._lock = threading.Lock()  # of users, and of the connection's comings and goings
        self._sending = threading.Lock()
        self._users: tuple[_Share, ...] = ()
        self._connections = 0
        self._end = threading.Event()

    def open(self, receive_ids: Sequence[tuple[int, bool]]) -> Link:
        """A link for one more user, who wants these (identifier, is extended). Raises as `open_link`."""
        with self._lock:
            if not self._users:
                self.link = self._connect()
            share = _Share(self, frozenset(receive_ids))
            self._users = (*self._users, share)
            if len(self._users) == 1:
                self._begin_reading()
        return share

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        """See `Link`."""
        with self._sending:
            return self.link.try_send(frame_id, payload, is_extended, is_fd)

    def send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags) -> None:
        """See `Link`."""
        with self._sending:
            self.link.send(frame_id, payload, is_extended, is_fd, flags)

    def reconnect(self, failed: int) -> None:
        """Connect anew after connection number `failed` was lost, unless another user's try did. Raises as `Link`."""
        with self._lock, self._sending:
            if failed == self._connections:
                self.link.reconnect()
                self._begin_reading()

    def leave(self, share: "_Share") -> None:
        """One user less."""
        with self._lock:
            self._users = tuple(user for user in self._users if user is not share)
            if not self._users:
                self._end.set()
                self._reader.join()
                self.link.close()

    def _begin_reading(self) -> None:
        self._connections += 1
        self._end = threading.Event()
        self._reader = threading.Thread(
            target=self._read, args=(self._connections,), name="reading a shared bus", daemon=True
        )
        self._reader.start()

    def _read(self, connection: int) -> None:
        """Until nobody is left, or the link fails, which all hear."""
        while not self._end.is_set():
            try:
                frame = self.link.receive(_LONGEST_WAIT)
            except Exception as error:  # whatever it is, all who wait for frames must hear of it
                for user in self._users:
                    user.fail(error, connection)
                return
            if frame is not None:
                for user in self._users:
                    user.hand(frame)


class _Share(Link):
    """One user's part of a shared bus."""

    def __init__(self, bus: SharedBus, wanted: frozenset[tuple[int, bool]]) -> None:
        self._bus = bus
        self._wanted = wanted
        self._arrived: Queue[Frame] = Queue(CAPACITY)
        self._overflown = 0
        self._failure: Exception | None = None
        self._failed = 0  # connection

    def hand(self, frame: Frame) -> None:
        """Take a frame, if wanted."""
        if (frame.frame_id, frame.is_extended) in self._wanted:
            try:
                self._arrived.put_nowait(frame)
            except Full:
                self._overflown += 1

    def fail(self, error: Exception, connection: int) -> None:
        """Tell at the next `receive` that the connection is lost."""
        self._failed, self._failure = connection, error

    def receive(self, timeout_s: float) -> Frame | None:
        if self._failure is not None:
            raise self._failure
        try:
            return self._arrived.get(timeout_s > 0.0, timeout_s)
        except Empty:
            return None

    def send(
        self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags = SWITCHED
    ) -> None:
        self._bus.send(frame_id, payload, is_extended, is_fd, flags)

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        return self._bus.try_send(frame_id, payload, is_extended, is_fd)

    def reconnect(self) -> None:
        self._bus.reconnect(self._failed)
        self._failure = None

    @property
    def dropped(self) -> int:
        return self._bus.link.dropped + self._overflown

    @property
    def condition(self) -> BusCondition:
        return self._bus.link.condition

    @property
    def stamp_source(self) -> StampSource:
        return self._bus.link.stamp_source

    @property
    def warnings(self) -> Sequence[str]:
        return self._bus.link.warnings

    def close(self) -> None:
        self._bus.leave(self)
