"""Opens links: chooses the implementation, and shares one connection where an interface opens once only."""

import threading
from collections.abc import Callable, Sequence
from queue import Empty, Full, Queue

from observer_rt.bus.links.link import SWITCHED, BusCondition, FdFlags, Frame, Link, StampSource
from observer_rt.foundation.errors import UserError, did_you_mean

_OURS = ("socketcan", "descriptor")
CAPACITY = 20_000  # frames that wait for one user
_LONGEST_WAIT = 0.02  # s that the reading thread is deaf to its end


class SharedBus:
    """Connects when its first user comes, disconnects with its last; a thread hands every frame to who wants it."""

    def __init__(self, connect: Callable[[], Link]) -> None:
        """connect: opens the link, for all identifiers that any user wants."""
        self._connect = connect
        self._lock = threading.Lock()  # of users, and of the connection's comings and goings
        self._users: tuple[_Share, ...] = ()
        self._end = threading.Event()
        self._is_lost = False
        self.connections = 0
        """Number of connections made."""
        self.trouble = Exception()
        """Error that ended the last connection that was lost."""

    def open(self, receive_ids: Sequence[tuple[int, bool]]) -> Link:
        """A link for one more user, who wants these (identifier, is extended). Raises as `open_link`."""
        with self._lock:
            if not self._users:
                self.link = self._connect()
                self._begin_reading()
            share = _Share(self, frozenset(receive_ids))
            self._users = (*self._users, share)
        return share

    def reconnect(self) -> None:
        """Connect anew, unless another user's try did. Raises as `Link`."""
        with self._lock:
            if self._is_lost:
                self.link.reconnect()
                self._begin_reading()

    def is_good(self, connection: int) -> bool:
        """Whether that is the connection there is."""
        return not self._is_lost and connection == self.connections

    def leave(self, share: "_Share") -> None:
        """Remove one user of the connection."""
        with self._lock:
            self._users = tuple(user for user in self._users if user is not share)
            if not self._users:
                self._end.set()
                self._reader.join()
                self.link.close()

    def _begin_reading(self) -> None:
        self.connections += 1
        self._is_lost = False
        self._end = threading.Event()
        self._reader = threading.Thread(target=self._read, name="reading a shared bus", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        """Until nobody is left, or the link fails."""
        while not self._end.is_set():
            try:
                frame = self.link.receive(_LONGEST_WAIT)
            except Exception as error:  # whatever it is, all who wait for frames must get it
                self.trouble, self._is_lost = error, True
                return
            if frame is not None:
                for user in self._users:
                    user.hand(frame)


class _Share(Link):
    """Share of one user in a shared bus."""

    def __init__(self, bus: SharedBus, wanted: frozenset[tuple[int, bool]]) -> None:
        self._bus = bus
        self._wanted = wanted
        self._arrived: Queue[Frame] = Queue(CAPACITY)
        self._overflown = 0
        self._connection = bus.connections

    def hand(self, frame: Frame) -> None:
        """Take a frame, if wanted."""
        if (frame.frame_id, frame.is_extended) in self._wanted:
            try:
                self._arrived.put_nowait(frame)
            except Full:
                self._overflown += 1

    def receive(self, timeout_s: float) -> Frame | None:
        if not self._bus.is_good(self._connection):
            raise self._bus.trouble
        try:
            return self._arrived.get(timeout_s > 0.0, timeout_s)
        except Empty:
            return None

    def send(
        self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags = SWITCHED
    ) -> None:
        self._bus.link.send(frame_id, payload, is_extended, is_fd, flags)

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        return self._bus.link.try_send(frame_id, payload, is_extended, is_fd)

    def reconnect(self) -> None:
        self._bus.reconnect()
        self._connection = self._bus.connections

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


def require_interface(place: str, name: str) -> None:
    """Raise `UserError` for an interface that is none; place: where the user states it."""
    if name in _OURS:
        return
    import can  # only for those who use one of its drivers

    known = sorted({"socketcan", *can.VALID_INTERFACES})
    if name not in known:
        raise UserError(
            place, f"unknown interface {name!r}", f"{did_you_mean(name, known)}use one of {', '.join(known)}"
        )


def open_link(
    interface: str,
    channel: str,
    fd: bool,
    receive_ids: Sequence[tuple[int, bool]] | None = None,
    computer_time: bool = False,
) -> Link:
    """Connect to `channel` of a python-can interface; `socketcan` is served by a faster implementation.

    `descriptor` is no interface: `channel` is the number of a socket this process was given.

    `fd`: allow CAN FD frames. `receive_ids`: the (identifier, is extended) pairs wanted; None means all,
    empty none. `computer_time`: stamp by the clock of this computer even if interface or driver have a better one,
    so that stamps of several links can be compared.

    Raises:
        UserError: no such interface.
        RunError: the interface is there but cannot be used.
    """
    require_interface("link.interface", interface)
    # Imported here so that neither python-can's drivers nor Linux are needed by those who use the other.
    if interface == "socketcan":
        from observer_rt.bus.links.socketcan import SocketCanLink

        return SocketCanLink(channel, fd, receive_ids, computer_time)
    if interface == "descriptor":
        from observer_rt.bus.links.descriptor import DescriptorLink

        return DescriptorLink(channel, fd, receive_ids, computer_time)
    from observer_rt.bus.links.python_can import PythonCanLink

    return PythonCanLink(interface, channel, fd, receive_ids, computer_time)
