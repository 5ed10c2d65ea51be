"""What takes frames from the links of a daemon through its core, and sends what they cause."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from observer_rt.service.core.messages import OutputFrame


class FramePump(ABC):
    """Bus numbers are the places of the links."""

    @abstractmethod
    def serve(self, timeout_s: float) -> Sequence[OutputFrame]:
        """Serve until something happened, for at most about `timeout_s` [s]: frames for the caller to send.

        Raises:
            BusDownError: the interface of a bus went down or away. Call `leave_out`, reconnect it, `take_back`.
            RunError: one failed otherwise.
        """

    @abstractmethod
    def leave_out(self, bus: int) -> None:
        """Neither receive from a bus nor send to it any more."""

    @abstractmethod
    def take_back(self, bus: int) -> None:
        """Serve a bus again, whose link was reconnected."""

    @abstractmethod
    def finish(self) -> Sequence[OutputFrame]:
        """No frame will come: what is complete, for the caller to send."""

    def goes_round(self) -> bool:
        """Whether what runs beside has done something since the last call."""
        return True

    @abstractmethod
    def close(self) -> None:
        """End what runs beside; the links stay open."""
