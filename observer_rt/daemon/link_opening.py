"""Opening of an injector's links, each as soon as its interface is there, and of buses that injectors share."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial

from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.listening import first_heard
from observer_rt.bus.links.opening import SharedBus, open_link
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import NamedLink
from observer_rt.daemon.input_monitoring.arrivals import message_text
from observer_rt.daemon.input_monitoring.input_watch import REMEDY
from observer_rt.engine.reports.news import Listener, Notice, of_bus
from observer_rt.engine.words import Topic

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
        """Opens the links of all buses in order, each as soon as it can be; own identifiers are listened to, too.

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
        config = named.config
        if len(users) > 1 and config.interface not in OPENED_OFTEN:
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
