"""A bus of the daemon: its link is reconnected and reported, and results wait for room on it."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future

from observer_rt.bus.links.controller import BusState, condition_messages
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.opening import RECONNECT_PERIOD
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.words import Topic
from observer_rt.foundation.units import NANOSECONDS

CAPACITY = 512  # frames: some 0.15 s of results at 100 kHz, after which the oldest serve nobody
RETRY = 0.5e-3  # s, about three full frames at 500k/5M
PERIOD = 1.0  # s between messages, so that a controller that comes and goes does not flood the screen
SILENCE = 10.0  # s without an outage, after which the same one is reported again: some devices come and go


class Port:
    """A link up, or down and being reconnected, and results that wait for room on it.

    Results are sent in order; beyond `CAPACITY` the oldest are given up. Nothing here waits: other buses go on.
    """

    def __init__(
        self, label: str, channel: str, link: Link, has_inputs: bool, tell: Callable[[Notice], None]
    ) -> None:
        """label: what messages call the bus; has_inputs: it brings frames; tell: takes notices."""
        self.label = label
        self.link = link
        self.has_inputs = has_inputs
        self.outages = 0
        """Number of times the interface went down or away."""
        self.unsent = 0
        """Results given up because the link had no room for them, or was down."""
        self.down, self.down_since = "", 0
        """Why it is down, empty: it is not; since when, by the monotonic clock [ns]."""
        self.is_up = True
        """Whether the link can be used."""
        self._channel = channel
        self._tell = tell
        self._waiting: deque[OutputFrame] = deque()
        self._attempt: Future[None] | None = None  # to reconnect
        self._due = 0.0  # of the next one
        self._condition, self._dropped, self._reported_unsent = link.condition, link.dropped, 0
        self._next_report = 0
        self._is_reported = False
        self._last_outage = ("", -SILENCE)  # its reason, and when [s]

    @property
    def is_waiting(self) -> bool:
        """Whether results wait for room."""
        return self.is_up and bool(self._waiting)

    @property
    def troubles(self) -> int:
        """Number of times the interface went down or away, or its controller error-passive or bus-off."""
        condition = self.link.condition
        return self.outages + condition.passives + condition.bus_offs

    @property
    def is_in_trouble(self) -> bool:
        """Whether the link is down now, or its controller sends with errors only."""
        return not self.is_up or self.link.condition.state in (BusState.PASSIVE, BusState.OFF)

    def post(self, frames: Iterable[OutputFrame], by: Link) -> None:
        """Send results once each as there is room, none while down. Raises as `Link.try_send`; by: the sender."""
        self._waiting.extend(frames)
        if not self.is_up:
            self.discard()
        self._flush(by)
        while len(self._waiting) > CAPACITY:
            self._waiting.popleft()
            self.unsent += 1

    def count_unsent(self, frames: int) -> None:
        """Count results that another sender than this port gave up."""
        self.unsent += frames

    def drain(self, patience: float, by: Link) -> None:
        """Send waiting results, for at most `patience` [s]; give up the rest. Raises as `post`."""
        end = time.monotonic() + patience
        self._flush(by)
        while self._waiting and time.monotonic() < end:
            time.sleep(RETRY)
            self._flush(by)
        self.discard()

    def discard(self) -> None:
        """Give up all waiting results."""
        self.unsent += len(self._waiting)
        self._waiting.clear()

    def _flush(self, by: Link) -> None:
        waiting = self._waiting
        while waiting:
            frame = waiting[0]
            if not by.try_send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd):
                return
            waiting.popleft()

    def tell(self, now: int) -> None:
        """Report changes of the link at a monotonic time [ns], at most once in a `PERIOD`."""
        if not self.is_up or now < self._next_report:
            return
        is_well = self.link.condition.state is BusState.ACTIVE
        notices = [
            Notice(Topic.LINK, text, is_well)
            for text in condition_messages(self._channel, self._condition, self.link.condition)
        ]
        self._condition = self.link.condition
        if dropped := self.link.dropped - self._dropped:
            self._dropped += dropped
            text = (
                f"{dropped} frames of {self._channel} were lost before this process could read them\n"
                "  remedy: give it a processor of its own (taskset) and real-time priority (chrt)"
            )
            notices.append(Notice(Topic.LINK, text))
        if unsent := self.unsent - self._reported_unsent:
            self._reported_unsent += unsent
            text = (
                f"{unsent} results were not sent, the transmit queue of {self._channel} is full\n"
                "  remedy: check that another node acknowledges, the bus load, and the length of the queue "
                f"(SocketCAN: sudo ip link set {self._channel} txqueuelen 1000)"
            )
            notices.append(Notice(Topic.LINK, text))
        if notices:
            self._next_report = now + round(PERIOD * NANOSECONDS)
        for notice in notices:
            self._tell(notice)

    def go_down(self, error: LinkDownError) -> None:
        """Take the failed link for down until `try_reconnect` succeeds; results that wait are given up as too old."""
        self.is_up = False
        self._due = time.monotonic() + RECONNECT_PERIOD
        self.outages += 1
        self.down, self.down_since = str(error), time.monotonic_ns()
        self.discard()
        self._is_reported = self._tell_outage(str(error))

    def try_reconnect(self, executor: Executor) -> bool:
        """Try to reconnect, in the executor, when due; True if up again. Raises `RunError`: failed for good."""
        attempt = self._attempt
        if attempt is None or not attempt.done():
            if attempt is None and time.monotonic() >= self._due:
                self._attempt = executor.submit(self.link.reconnect)
            return False
        self._attempt, self._due = None, time.monotonic() + RECONNECT_PERIOD
        try:
            attempt.result()
        except LinkDownError as error:
            self.down = str(error)
            self._is_reported = self._tell_outage(str(error)) or self._is_reported
            return False
        self.is_up, self.down = True, ""
        self._reported_unsent = self.unsent  # what was not sent meanwhile is not reported
        if self._is_reported:
            self._tell(Notice(Topic.LINK, f"{self.label} is back", is_over=True))
        return True

    def _tell_outage(self, reason: str) -> bool:
        """Report an outage unless it repeats the last report; returns whether it was reported."""
        (before, when), now = self._last_outage, time.monotonic()
        self._last_outage = reason, now
        if is_new := reason != before or now - when > SILENCE:
            self._tell(Notice(Topic.LINK, f"waiting for the interface: {reason}"))
        return is_new
