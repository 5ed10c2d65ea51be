"""Protocol of every CAN connection, and its frames: one by one, and as blocks in arrays."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from itertools import islice
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.links.controller import BusCondition
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import Ints

LONGEST_WAIT = 0.02  # s until a reading thread notices that it is to end
BLOCK_FRAMES = 256  # which bring far fewer samples than the observer remembers


class Frame(NamedTuple):
    """Received data frame. `stamp_ns`: when, nanoseconds since 1970; by the clock of `Link.stamp_source`."""

    frame_id: int
    payload: bytes
    stamp_ns: int
    is_extended: bool = False
    is_fd: bool = True
    bit_rate_switch: bool = False
    """Flag of a CAN FD frame: its data came at the faster bit rate."""
    error_state_indicator: bool = False
    """Flag of a CAN FD frame: its sender had seen so many errors that it was error passive."""


class FdFlags(NamedTuple):
    """Flags with which a CAN FD frame is to be sent, as in `Frame`."""

    bit_rate_switch: bool = True
    error_state_indicator: bool = False


SWITCHED = FdFlags()


class BusFrame(NamedTuple):
    """A frame, and the number of the bus it came on."""

    bus: int
    frame: Frame


class StampSource(StrEnum):
    """Source of receive stamps; each less jittery than those after it."""

    HARDWARE = "hardware"  # the CAN interface
    KERNEL = "kernel"  # the kernel of this computer
    DRIVER = "driver"  # a vendor's driver, by a clock it chooses
    ARRIVAL = "arrival"  # this process


class LinkDownError(RunError):
    """The interface went down or away; `Link.reconnect` reports when it is back."""


class BusDownError(LinkDownError):
    """The interface of one bus went down or away."""

    def __init__(self, bus: int, error: LinkDownError) -> None:
        self.bus = bus
        super().__init__(str(error))


class Link(Protocol):
    """An open connection to one CAN bus; a context manager that closes it; it receives no own frames.

    Remote and error frames are left out (`condition`). One thread may receive while others send.
    """

    @abstractmethod
    def receive(self, timeout_s: float) -> Frame | None:
        """The next wanted frame, or None if none came within `timeout_s` [s] (0: only what waits already).

        Raises `LinkDownError` where the interface went down or away, `RunError` where it failed otherwise.
        """

    @abstractmethod
    def send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags = SWITCHED) -> None:
        """Send one data frame, `flags` if CAN FD; a controller may set its error state indicator itself.

        Waits a moment for a full queue. Raises as `receive`, also for a queue that stays full or a bus without CAN
        FD; `ValueError` for a payload too long for the frame.
        """

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        """`send` without waiting: whether there was room for the frame. Raises as `send` does."""
        self.send(frame_id, payload, is_extended, is_fd)
        return True

    def reconnect(self) -> None:
        """Connect anew after a `LinkDownError`; what was counted stays. Nothing to do where nothing can be lost.

        Raises `LinkDownError`: the interface is not back yet, or cannot be used as it is.
        """
        return

    @property
    @abstractmethod
    def dropped(self) -> int:
        """Frames lost by controller, driver or kernel so far, as known when the last frame was received."""

    @property
    def condition(self) -> BusCondition:
        """Condition of the controller; always the same where the interface does not report it."""
        return BusCondition()

    @property
    def stamp_source(self) -> StampSource:
        """Source of the stamps of received frames."""
        return StampSource.ARRIVAL

    @property
    def warnings(self) -> Sequence[str]:
        """Warnings about the link, found when it was opened; with remedies."""
        return ()

    @abstractmethod
    def close(self) -> None:
        """Release the interface. The link cannot be used afterwards."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class FrameBlock(NamedTuple):
    """Frames in the order received (n of them)."""

    keys: Ints
    """(n,), as by `frame_key`."""
    stamps: Ints
    """(n,), when each was received [ns], as of `Frame`."""
    starts: Ints
    """(n + 1,), where the payload of each begins in `data`, and where that of the last one ends."""
    data: NDArray[np.uint8]
    """The payloads, one after another."""

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.keys.size)


def block_of(frames: Sequence[BusFrame]) -> FrameBlock:
    """Block of frames with their buses."""
    return FrameBlock(
        np.array([frame_key(frame.frame_id, frame.is_extended, bus) for bus, frame in frames], np.int64),
        np.array([frame.stamp_ns for _, frame in frames], np.int64),
        np.cumsum([0, *(len(frame.payload) for _, frame in frames)], dtype=np.int64),
        np.frombuffer(b"".join(frame.payload for _, frame in frames), np.uint8),
    )


def blocks_of(frames: Iterable[BusFrame]) -> Iterator[FrameBlock]:
    """Blocks of all frames in order, of at most `BLOCK_FRAMES`."""
    remaining = iter(frames)
    while batch := list(islice(remaining, BLOCK_FRAMES)):
        yield block_of(batch)
