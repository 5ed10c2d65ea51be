"""How busy a bus is, from the frames that are heard on it."""

from collections import deque
from functools import cache

from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.load import frame_time
from observer_rt.config.links import LinkConfig

OVER = 1_000_000_000  # ns


class BusLoadMeter:
    """The share of the last second that frames took on a bus, at the bit rates the bench file states."""

    def __init__(self, link: LinkConfig) -> None:
        self._frame_time = cache(
            lambda length, is_fd, is_extended: frame_time(
                length, is_fd, link.bit_rate, link.data_bit_rate, is_extended
            )
        )
        self._parts: deque[tuple[int, float]] = deque()  # of a tenth of a second each: begin [ns], busy [s]

    def note(self, frame: Frame, now: int) -> None:
        """A frame came at a time [ns]."""
        busy = self._frame_time(len(frame.payload), frame.is_fd, frame.is_extended)
        if not self._parts or now - self._parts[-1][0] >= OVER // 10:
            self._parts.append((now, 0.0))
        begin, sum_before = self._parts[-1]
        self._parts[-1] = begin, sum_before + busy

    def share(self, now: int) -> float:
        """0 to 1, and beyond what the bus could carry."""
        while self._parts and now - self._parts[0][0] > OVER:
            self._parts.popleft()
        return sum(busy for _, busy in self._parts) * 1e9 / OVER
