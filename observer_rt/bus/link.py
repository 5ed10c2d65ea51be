"""The one protocol every CAN connection follows, and the choice of its implementation."""

from abc import abstractmethod
from collections.abc import Sequence
from types import TracebackType
from typing import NamedTuple, Protocol, Self


class Frame(NamedTuple):
    """One received data frame. `stamp_ns`: when, nanoseconds since 1970 by the receiving computer."""

    frame_id: int
    payload: bytes
    stamp_ns: int
    is_extended: bool = False
    is_fd: bool = True


class Link(Protocol):
    """An open connection to one CAN bus; a context manager that closes it.

    Own frames are not received. Remote and error frames are left out.
    """

    @abstractmethod
    def receive(self, timeout_s: float) -> Frame | None:
        """The next wanted frame, or None if none came within `timeout_s` [s] (0: only what waits already).

        Raises:
            RunError: the interface went down or away.
        """

    @abstractmethod
    def send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> None:
        """Send one data frame; a CAN FD frame with the bit rate switched. Waits a moment for a full queue.

        Raises:
            RunError: the interface went down or away, its queue stays full, or it carries no CAN FD.
            ValueError: the payload is too long for a frame of this kind.
        """

    @property
    @abstractmethod
    def dropped(self) -> int:
        """Frames lost by kernel or driver so far, as known when the last frame was received."""

    @abstractmethod
    def close(self) -> None:
        """Release the interface. The link cannot be used afterwards."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def open_link(
    interface: str, channel: str, fd: bool, receive_ids: Sequence[tuple[int, bool]] | None = None
) -> Link:
    """Connect to `channel` of a python-can interface; `socketcan` is served by a faster implementation.

    `fd`: allow CAN FD frames. `receive_ids`: the (identifier, is extended) pairs wanted; None means all,
    empty none.

    Raises:
        UserError: no such interface.
        RunError: the interface is there but cannot be used.
    """
    # Imported here so that neither python-can's drivers nor Linux are needed by those who use the other.
    if interface == "socketcan":
        from observer_rt.bus.socketcan_link import SocketCanLink

        return SocketCanLink(channel, fd, receive_ids)
    from observer_rt.bus.python_can_link import PythonCanLink

    return PythonCanLink(interface, channel, fd, receive_ids)
