"""One of the daemon's buses: its link, opened once it is there, what goes wrong on it, and results that wait."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial

from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.bus.links.link import BusState, Link, LinkDownError, condition_messages
from observer_rt.bus.links.listening import first_heard
from observer_rt.bus.links.opening import SharedBus, open_link
from observer_rt.bus.links.receiver import Outage
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import NamedLink
from observer_rt.daemon.input_monitoring.arrivals import message_text
from observer_rt.daemon.input_monitoring.input_watch import REMEDY
from observer_rt.engine.reports.news import Listener, Notice, of_bus
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.words import Topic

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

    def discard(self) -> None:
        """Give up all that waits."""
        self.unsent += len(self._waiting)
        self._waiting.clear()


PERIOD = 1.0  # s between messages, so that a controller that comes and goes does not flood the screen


class LinkWatch:
    """Reports what has changed since the last time: the controller's condition, frames lost and results unsent."""

    def __init__(self, channel: str, link: Link, outbox: Outbox) -> None:
        self._channel, self._link, self._outbox = channel, link, outbox
        self._condition, self._dropped = link.condition, link.dropped
        self._next = 0
        self.begin_anew()

    def begin_anew(self) -> None:
        """The link is up again: what was not sent meanwhile is no news."""
        self._unsent = self._outbox.unsent

    def look(self, now: int) -> list[Notice]:
        """News at a monotonic time [ns]; none within `PERIOD` after the last."""
        if now < self._next:
            return []
        is_well = self._link.condition.state is BusState.ACTIVE
        news = [
            of_bus(Topic.LINK, text, is_well)
            for text in condition_messages(self._channel, self._condition, self._link.condition)
        ]
        self._condition = self._link.condition
        if dropped := self._link.dropped - self._dropped:
            self._dropped += dropped
            text = (
                f"{dropped} frames of {self._channel} were lost before this process could read them\n"
                "  remedy: give it a processor of its own (taskset) and real-time priority (chrt)"
            )
            news.append(Notice(Topic.LINK, text, incident=f"frames of {self._channel} lost"))
        if unsent := self._outbox.unsent - self._unsent:
            self._unsent += unsent
            text = (
                f"{unsent} results were not sent, the transmit queue of {self._channel} is full\n"
                "  remedy: check that another node acknowledges, the bus load, and the length of the queue "
                f"(SocketCAN: sudo ip link set {self._channel} txqueuelen 1000)"
            )
            news.append(Notice(Topic.LINK, text, incident=f"transmit queue of {self._channel} full"))
        if news:
            self._next = now + round(PERIOD * 1e9)
        return news


SILENCE = 10.0  # s without an outage, after which the same one is reported again: some devices come and go


class Port:
    """A link that is up, or down and being reconnected. Nothing here waits: other buses go on meanwhile."""

    def __init__(
        self, label: str, channel: str, link: Link, has_inputs: bool, tell: Callable[[Notice], None]
    ) -> None:
        """label: what messages call the bus; has_inputs: whether anything is to be received on it.

        tell: hears what is the matter, and when that is over.
        """
        self.label = label
        self.link = link
        self.has_inputs = has_inputs
        self.outages = 0
        """How often the interface went down or away."""
        self._outbox = Outbox(link)
        self._watch = LinkWatch(channel, link, self._outbox)
        self._tell = tell
        self._outage: Outage | None = None
        self._is_reported = False
        self._last_outage = ("", -SILENCE)  # what was the matter, and when

    @property
    def is_up(self) -> bool:
        """Whether the link can be used."""
        return self._outage is None

    @property
    def is_waiting(self) -> bool:
        """Whether results wait for room."""
        return self.is_up and bool(self._outbox)

    @property
    def unsent(self) -> int:
        """Results given up because the link had no room for them, or was down."""
        return self._outbox.unsent

    @property
    def troubles(self) -> int:
        """How often the interface went down or away, and its controller error-passive or bus-off."""
        condition = self.link.condition
        return self.outages + condition.passives + condition.bus_offs

    @property
    def is_in_trouble(self) -> bool:
        """Whether it neither sends nor receives now, or only with errors."""
        return not self.is_up or self.link.condition.state in (BusState.PASSIVE, BusState.OFF)

    def post(self, frames: Iterable[OutputFrame], by: Link) -> None:
        """Send results as there is room; while the link is down they are given up. Raises as `Link.try_send`.

        by: the link, or what sends for it.
        """
        self._outbox.link = by
        if self.is_up:
            self._outbox.post(frames)
        else:
            self.count_unsent(len(list(frames)))

    def count_unsent(self, frames: int) -> None:
        """So many results were given up by whoever sends them without this port."""
        self._outbox.unsent += frames

    def drain(self, patience: float) -> None:
        """Send what waits, for at most `patience` [s]; give up the rest. Raises as `post`."""
        if self.is_up:
            self._outbox.drain(patience)
        self._outbox.discard()

    def tell(self, now: int) -> None:
        """Messages about what has changed, at a monotonic time [ns]."""
        if self.is_up:
            for notice in self._watch.look(now):
                self._tell(notice)

    def go_down(self, error: LinkDownError) -> None:
        """The link failed: to be reconnected by `mend`. What waits is given up: it would be too old for anybody."""
        self._outage = Outage(self.link)
        self.outages += 1
        self._outbox.discard()
        self._is_reported = self._tell_outage(str(error))

    def mend(self, executor: Executor) -> bool:
        """Try to reconnect, in the executor; whether the link is up again."""
        try:
            if self._outage is not None and not self._outage.is_over(executor):
                return False
        except LinkDownError as error:
            self._is_reported = self._tell_outage(str(error)) or self._is_reported
            return False
        self._outage = None
        self._watch.begin_anew()
        if self._is_reported:
            self._tell(of_bus(Topic.LINK, f"{self.label} is back", is_over=True))
        return True

    def _tell_outage(self, reason: str) -> bool:
        """Whether there was something new to tell."""
        (before, when), now = self._last_outage, time.monotonic()
        self._last_outage = reason, now
        if is_new := reason != before or now - when > SILENCE:
            self._tell(of_bus(Topic.LINK, f"waiting for the interface: {reason}"))
        return is_new


REOPEN = 0.25  # s between two tries to open an interface
OPENED_OFTEN = ("socketcan", "virtual")  # interfaces whose channels can be opened several times


class StoppedError(Exception):
    """The service was asked to stop while it waited for an interface."""


@dataclass(frozen=True)
class LinkOpening:
    """Opens the links of an injector. shared: those of buses it has with others; on_alive: called while it waits.

    Its methods raise `StoppedError` when `stop` is set meanwhile, `UserError` or `RunError` for what waiting does
    not mend.
    """

    bench: Bench
    bus: BusMap
    shared: Mapping[int, SharedBus]
    tell: Listener
    stop: threading.Event
    on_alive: Callable[[], None]

    def links(self) -> Iterator[Link]:
        """Of all buses in order, each as soon as it can be opened; own identifiers are listened to, too.

        A bus that is none of this injector's is neither opened nor waited for.
        """
        used = buses_of(self.bus)
        for number, named in enumerate(self.bench.config.buses):
            if number not in used:
                yield IdleLink()
                continue
            link = self._when_there(number, _wanted_on(self.bus, number), len(used) > 1)
            yield link
            on = f"{named.label}: " if len(used) > 1 else ""
            self.tell(of_bus(Topic.START, f"{on}time stamps: {link.stamp_source}", is_over=True))
            for warning in link.warnings:
                self.tell(of_bus(Topic.LINK, warning))

    def tell_other_senders(self) -> None:
        """Listen a moment, before anything is sent, for others that send what this service will."""
        with ExitStack() as stack, suppress(LinkDownError):  # which the daemon waits for
            links = {}
            for number in {layout.bus for layout in self.bus.sent}:
                links[number] = stack.enter_context(self._when_there(number, _own(self.bus, number), False))
            if heard := first_heard(links, self.stop):
                on, frame = heard
                name = next(
                    message_text(self.bus, layout)
                    for layout in self.bus.sent
                    if (layout.bus, layout.frame_id) == (on, frame.frame_id)
                )
                text = f"another node sends {name} already\n  remedy: {REMEDY}"
                self.tell(Notice(Topic.SENDER, text))

    def _when_there(self, number: int, wanted: list[tuple[int, bool]], computer_time: bool) -> Link:
        """The link of a bus, opened once its interface is there; wanted, computer_time: as of `open_link`."""
        named, shared = self.bench.config.buses[number], self.shared.get(number)
        waiting_for = ""
        while True:
            try:
                link = shared.open(wanted) if shared else _connected(named, wanted, computer_time)
            except LinkDownError as error:
                if str(error) != waiting_for:
                    waiting_for = str(error)
                    self.tell(of_bus(Topic.LINK, f"waiting for the interface: {waiting_for}"))
            else:
                if waiting_for:
                    self.tell(of_bus(Topic.LINK, f"{named.label} is there", is_over=True))
                return link
            self.on_alive()
            if self.stop.wait(REOPEN):
                raise StoppedError


def buses_of(bus: BusMap) -> frozenset[int]:
    """Numbers of the buses that something is read from or sent to."""
    return frozenset(layout.bus for layout in (*bus.received, *bus.sent))


def shared_buses(bench: Bench, maps: Iterable[BusMap]) -> dict[int, SharedBus]:
    """The buses, by their numbers, that several injectors use and that can be opened once only."""
    shared = {}
    for number, named in enumerate(bench.config.buses):
        users = [bus for bus in maps if number in buses_of(bus)]
        if len(users) > 1 and named.config.interface not in OPENED_OFTEN:
            wanted = list(dict.fromkeys(each for bus in users for each in _wanted_on(bus, number)))
            computer_time = any(len(buses_of(bus)) > 1 for bus in users)
            shared[number] = SharedBus(partial(_connected, named, wanted, computer_time))
    return shared


def _wanted_on(bus: BusMap, number: int) -> list[tuple[int, bool]]:
    """(identifier, is extended) to be read from a bus: the inputs, and what nobody else should send."""
    return list(dict.fromkeys([*bus.received_on(number), *_own(bus, number)]))


def _connected(named: NamedLink, wanted: list[tuple[int, bool]], computer_time: bool) -> Link:
    """A link as the bench file says; wanted, computer_time: as of `open_link`."""
    config = named.config
    return open_link(config.interface, config.channel, config.fd, wanted, computer_time)


def _own(bus: BusMap, number: int) -> list[tuple[int, bool]]:
    return [(layout.frame_id, layout.is_extended) for layout in bus.sent if layout.bus == number]
