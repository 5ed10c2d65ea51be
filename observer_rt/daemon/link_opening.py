"""Opens the links of an injector's buses, and waits for their interfaces."""

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.opening import first_heard, open_link
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.daemon.arrivals import message_text, watched_messages
from observer_rt.daemon.input_watch import OTHER_SENDER
from observer_rt.engine.reports.news import Listener, Notice
from observer_rt.engine.words import Topic

REOPEN = 0.25  # s between two tries to open an interface


class StoppedError(Exception):
    """The service was asked to stop while it waited for an interface."""


@dataclass(frozen=True)
class LinkOpening:
    """Opens the links of an injector. on_alive: called while it waits.

    Its methods raise `StoppedError` when `stop` is set meanwhile, `UserError` or `RunError` for a failure that
    waiting does not end.
    """

    bench: Bench
    bus_map: BusMap
    tell: Listener
    stop: threading.Event
    on_alive: Callable[[], None]

    def links(self) -> Iterator[Link]:
        """Opens the links of all buses in order, each as soon as it can be; own identifiers are listened to, too.

        A bus of other injectors only is neither opened nor waited for.
        """
        used = buses_of(self.bus_map)
        for number, named in enumerate(self.bench.config.buses):
            if number not in used:
                yield IdleLink()
                continue
            # where only results are sent they are read all the same: a link that reads nothing gets no error frames
            link = self._wait_for_link(number, watched_messages(self.bus_map), len(used) > 1)
            yield link
            on = f"{named.label}: " if len(used) > 1 else ""
            self.tell(Notice(Topic.START, f"{on}time stamps: {link.stamp_source}", is_over=True))
            for warning in link.warnings:
                self.tell(Notice(Topic.LINK, warning))

    def report_other_senders(self) -> None:
        """Listen a moment, before anything is sent, for other nodes that send the messages of this service."""
        with ExitStack() as stack, suppress(LinkDownError):  # which the daemon waits for
            links = {}
            for number in {layout.bus for layout in self.bus_map.sent}:
                links[number] = stack.enter_context(self._wait_for_link(number, self.bus_map.sent, False))
            if sender := first_heard(links, self.stop):
                on = sender.bus, sender.frame.frame_id
                layout = next(layout for layout in self.bus_map.sent if (layout.bus, layout.frame_id) == on)
                text = f"another node sends {message_text(self.bus_map, layout)} already\n  remedy: {OTHER_SENDER}"
                self.tell(Notice(Topic.SENDER, text))

    def _wait_for_link(self, number: int, messages: Iterable[MessageLayout], computer_time: bool) -> Link:
        """The link of a bus, opened once its interface is there; it reads those of these messages that are on it.

        computer_time: as of `open_link`.
        """
        named = self.bench.config.buses[number]
        wanted = list({(layout.frame_id, layout.is_extended): None for layout in messages if layout.bus == number})
        config = named.config
        waiting_for = ""
        while True:
            try:
                link = open_link(config.interface, config.channel, config.fd, wanted, computer_time, config.bit_rates)
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


def buses_of(bus_map: BusMap) -> frozenset[int]:
    """Numbers of the buses that something is read from or sent to."""
    return frozenset(layout.bus for layout in (*bus_map.received, *bus_map.sent))
