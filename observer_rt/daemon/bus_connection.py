"""Connections to the daemon's buses: opened, reconnected, their reports, results that wait for room."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, suppress
from dataclasses import dataclass

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.controller import BusState, condition_messages
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.opening import RECONNECT_PERIOD, IdleLink, first_heard, open_link
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.daemon.arrivals import message_text, twins_of
from observer_rt.daemon.input_watch import OTHER_SENDER
from observer_rt.engine.reports.news import Listener, Notice
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.words import Topic

REOPEN = 0.25  # s between two tries to open an interface
CAPACITY = 512  # frames: some 0.15 s of results at 100 kHz, after which the oldest serve nobody
RETRY = 0.5e-3  # s, about three full frames at 500k/5M
PERIOD = 1.0  # s between messages, so that a controller that comes and goes does not flood the screen
SILENCE = 10.0  # s without an outage, after which the same one is reported again: some devices come and go


class StoppedError(Exception):
    """The service was asked to stop while it waited for an interface."""


@dataclass(frozen=True)
class LinkOpening:
    """Opens the links of an injector. on_alive: called while it waits.

    Its methods raise `StoppedError` when `stop` is set meanwhile, `UserError` or `RunError` for a failure that
    waiting does not end.
    """

    bench: Bench
    bus: BusMap
    tell: Listener
    stop: threading.Event
    on_alive: Callable[[], None]

    def links(self) -> Iterator[Link]:
        """Opens the links of all buses in order, each as soon as it can be; own identifiers are listened to, too.

        A bus of other injectors only is neither opened nor waited for.
        """
        used = buses_of(self.bus)
        for number, named in enumerate(self.bench.config.buses):
            if number not in used:
                yield IdleLink()
                continue
            # the inputs, also under a mistaken format, and results, which nobody else sends
            wanted = [*self.bus.received_on(number), *_on(number, (*self.bus.sent, *twins_of(self.bus)))]
            link = self._when_there(number, list(dict.fromkeys(wanted)), len(used) > 1)
            yield link
            on = f"{named.label}: " if len(used) > 1 else ""
            self.tell(Notice(Topic.START, f"{on}time stamps: {link.stamp_source}", is_over=True))
            for warning in link.warnings:
                self.tell(Notice(Topic.LINK, warning))

    def tell_other_senders(self) -> None:
        """Listen a moment, before anything is sent, for other nodes that send the messages of this service."""
        with ExitStack() as stack, suppress(LinkDownError):  # which the daemon waits for
            links = {}
            for number in {layout.bus for layout in self.bus.sent}:
                links[number] = stack.enter_context(self._when_there(number, _on(number, self.bus.sent), False))
            if sender := first_heard(links, self.stop):
                on, frame = sender
                name = next(
                    message_text(self.bus, layout)
                    for layout in self.bus.sent
                    if (layout.bus, layout.frame_id) == (on, frame.frame_id)
                )
                text = f"another node sends {name} already\n  remedy: {OTHER_SENDER}"
                self.tell(Notice(Topic.SENDER, text))

    def _when_there(self, number: int, wanted: list[tuple[int, bool]], computer_time: bool) -> Link:
        """The link of a bus, opened once its interface is there; wanted, computer_time: as of `open_link`."""
        named = self.bench.config.buses[number]
        config = named.config
        waiting_for = ""
        while True:
            try:
                link = open_link(config.interface, config.channel, config.fd, wanted, computer_time)
            except LinkDownError as error:
                if str(error) != waiting_for:
                    waiting_for = str(error)
                    self.tell(Notice(Topic.LINK, f"waiting for the interface: {waiting_for}"))
            else:
                if waiting_for:
                    self.tell(Notice(Topic.LINK, f"{named.label} is there", is_over=True))
                return link
            self.on_alive()
            if self.stop.wait(REOPEN):
                raise StoppedError


def buses_of(bus: BusMap) -> frozenset[int]:
    """Numbers of the buses that something is read from or sent to."""
    return frozenset(layout.bus for layout in (*bus.received, *bus.sent))


def _on(number: int, layouts: Iterable[MessageLayout]) -> list[tuple[int, bool]]:
    return [(layout.frame_id, layout.is_extended) for layout in layouts if layout.bus == number]


class Port:
    """A link that is up, or down and being reconnected, and the results that wait for room on it.

    Results are sent in order; of more than `CAPACITY` the oldest are given up. Nothing here waits: other buses go on
    meanwhile.
    """

    def __init__(
        self, label: str, channel: str, link: Link, has_inputs: bool, tell: Callable[[Notice], None]
    ) -> None:
        """label: what messages call the bus; has_inputs: whether anything is to be received on it.

        tell: takes notices of faults, and of their end.
        """
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
        self._last_outage = ("", -SILENCE)  # what was the matter, and when

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
        """Send results as there is room; while the link is down they are given up. Raises as `Link.try_send`.

        by: the link, or what sends for it. Nothing is sent twice, whatever is raised.
        """
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
        """Send what waits, for at most `patience` [s]; give up the rest. Raises as `post`."""
        end = time.monotonic() + patience
        self._flush(by)
        while self._waiting and time.monotonic() < end:
            time.sleep(RETRY)
            self._flush(by)
        self.discard()

    def discard(self) -> None:
        """Give up all that waits."""
        self.unsent += len(self._waiting)
        self._waiting.clear()

    def _flush(self, by: Link) -> None:
        """Sends what waits as far as there is room."""
        waiting = self._waiting
        while waiting:
            frame = waiting[0]
            if not by.try_send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd):
                return
            waiting.popleft()

    def tell(self, now: int) -> None:
        """Report changes, at a monotonic time [ns]; at most one report in a `PERIOD`."""
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
            self._next_report = now + round(PERIOD * 1e9)
        for notice in notices:
            self._tell(notice)

    def go_down(self, error: LinkDownError) -> None:
        """Takes the failed link for down until `mend`. What waits is given up: it would be too old for anybody."""
        self.is_up = False
        self._due = time.monotonic() + RECONNECT_PERIOD
        self.outages += 1
        self.down, self.down_since = str(error), time.monotonic_ns()
        self.discard()
        self._is_reported = self._tell_outage(str(error))

    def mend(self, executor: Executor) -> bool:
        """Tries to reconnect, in the executor, when that is due; returns whether the link is up again.

        Raises `RunError` for a link that failed for good.
        """
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
