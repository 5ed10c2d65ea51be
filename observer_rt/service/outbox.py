"""Results on their way to the link: the loop never waits for a full transmit queue."""

import time
from collections import deque
from collections.abc import Iterable

from observer_rt.bus.links.link import Link
from observer_rt.service.core.messages import OutputFrame

CAPACITY = 512  # frames: some 0.15 s of results at 100 kHz, after which the oldest serve nobody
RETRY = 0.5e-3  # s, about three full frames at 500k/5M


class Outbox:
    """Sends frames in order as the link has room; keeps `CAPACITY`, gives up the oldest of more."""

    def __init__(self, link: Link) -> None:
        self.link = link
        """By which they are sent."""
        self._waiting: deque[OutputFrame] = deque()
        self.unsent = 0
        """Frames given up."""

    def __len__(self) -> int:
        """Frames that wait for room."""
        return len(self._waiting)

    def post(self, frames: Iterable[OutputFrame]) -> None:
        """Send frames, or let them wait. Raises what `Link.try_send` raises; nothing is sent twice then."""
        self._waiting.extend(frames)
        self.flush()
        while len(self._waiting) > CAPACITY:
            self._waiting.popleft()
            self.unsent += 1

    def flush(self) -> None:
        """Send what waits as far as there is room. Raises as `post` does."""
        waiting, try_send = self._waiting, self.link.try_send
        while waiting:
            frame = waiting[0]
            if not try_send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd):
                return
            waiting.popleft()

    def drain(self, patience: float) -> None:
        """Send all that waits, for at most `patience` [s]; give up the rest. Raises as `post` does."""
        end = time.monotonic() + patience
        self.flush()
        while self._waiting and time.monotonic() < end:
            time.sleep(RETRY)
            self.flush()
        self.discard()

    def give_up(self, frames: Iterable[OutputFrame]) -> None:
        """Send none of the frames."""
        self.unsent += sum(1 for _ in frames)

    def discard(self) -> None:
        """Give up all that waits."""
        self.unsent += len(self._waiting)
        self._waiting.clear()
