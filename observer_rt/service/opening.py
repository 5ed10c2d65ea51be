"""The links of a daemon at its start: interfaces that are not there yet are waited for, other senders heard."""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from functools import partial

from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.opening import SharedBus, open_link
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.config.links import NamedLink
from observer_rt.recording.replay.sources import first_heard
from observer_rt.service.reports.news import Listener, Notice, of_bus
from observer_rt.service.watch.arrivals import message_text
from observer_rt.service.watch.input_watch import REMEDY
from observer_rt.service.words import Topic

RETRY = 0.25  # s between two tries to open an interface


class StoppedError(Exception):
    """The service was told to stop while it waited for an interface."""


def open_links(
    bench: Bench,
    bus: BusMap,
    shared: Mapping[int, SharedBus],
    tell: Listener,
    stop: threading.Event,
    on_alive: Callable[[], None],
) -> Iterator[Link]:
    """The links of all buses in order, each as soon as it can be opened; own identifiers are listened to, too.

    A bus that is none of this injector's is neither opened nor waited for. shared: those it opens with others.

    Raises `StoppedError` when `stop` is set meanwhile, `UserError` or `RunError` for what waiting does not mend.
    """
    used = buses_of(bus)
    for number, named in enumerate(bench.config.buses):
        if number not in used:
            yield IdleLink()
            continue
        opener = _opener(named, wanted_on(bus, number), len(used) > 1, shared.get(number))
        link = _when_there(named, opener, tell, stop, on_alive)
        yield link
        on = f"{named.label}: " if len(used) > 1 else ""
        tell(of_bus(Topic.START, f"{on}time stamps: {link.stamp_source}", is_over=True))
        for warning in link.warnings:
            tell(of_bus(Topic.LINK, warning))


def tell_other_senders(
    bench: Bench,
    bus: BusMap,
    shared: Mapping[int, SharedBus],
    tell: Listener,
    stop: threading.Event,
    on_alive: Callable[[], None],
) -> None:
    """Listen a moment, before anything is sent, for others that send what this service will.

    Waits for the interfaces, and raises, as `open_links` does.
    """
    with ExitStack() as stack, suppress(LinkDownError):  # which the daemon waits for
        links = {}
        for number in {layout.bus for layout in bus.sent}:
            named = bench.config.buses[number]
            opener = _opener(named, _own(bus, number), False, shared.get(number))
            links[number] = stack.enter_context(_when_there(named, opener, tell, stop, on_alive))
        heard = first_heard(links, stop)
        if heard is not None:
            on, frame = heard
            name = next(
                message_text(bus, layout)
                for layout in bus.sent
                if (layout.bus, layout.frame_id) == (on, frame.frame_id)
            )
            tell(Notice(Topic.SENDER, f"another node sends {name} already\n  remedy: {REMEDY}"))


def buses_of(bus: BusMap) -> frozenset[int]:
    """Numbers of the buses that something is read from or sent to."""
    return frozenset(layout.bus for layout in (*bus.received, *bus.sent))


def wanted_on(bus: BusMap, number: int) -> list[tuple[int, bool]]:
    """(identifier, is extended) to be read from a bus: the inputs, and what nobody else should send."""
    return list(dict.fromkeys([*bus.received_on(number), *_own(bus, number)]))


def connected(named: NamedLink, wanted: list[tuple[int, bool]], computer_time: bool) -> Link:
    """A link as the bench file says; wanted, computer_time: as of `open_link`."""
    config = named.config
    return open_link(config.interface, config.channel, config.fd, wanted, computer_time)


def _opener(
    named: NamedLink, wanted: list[tuple[int, bool]], computer_time: bool, shared: SharedBus | None
) -> Callable[[], Link]:
    if shared is not None:
        return partial(shared.open, wanted)
    return partial(connected, named, wanted, computer_time)


def _when_there(
    named: NamedLink,
    opener: Callable[[], Link],
    tell: Listener,
    stop: threading.Event,
    on_alive: Callable[[], None],
) -> Link:
    """The link, opened once its interface is there."""
    told = ""
    while True:
        try:
            link = opener()
        except LinkDownError as error:
            if str(error) != told:
                told = str(error)
                tell(of_bus(Topic.LINK, f"waiting for the interface: {told}"))
        else:
            if told:
                tell(of_bus(Topic.LINK, f"{named.label} is there", is_over=True))
            return link
        on_alive()
        if stop.wait(RETRY):
            raise StoppedError


def _own(bus: BusMap, number: int) -> list[tuple[int, bool]]:
    return [(layout.frame_id, layout.is_extended) for layout in bus.sent if layout.bus == number]
