"""What goes wrong on the link, as messages: seldom enough to be read."""

from observer_rt.bus.links.controller import BusState, condition_messages
from observer_rt.bus.links.link import Link
from observer_rt.service.outbox import Outbox
from observer_rt.service.reports.news import Notice, of_bus
from observer_rt.service.words import Topic

PERIOD = 1.0  # s between messages, so that a controller that comes and goes does not flood the screen


class LinkWatch:
    """Tells what has changed since it last told: the controller's condition, frames lost and results unsent."""

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
        told = [
            of_bus(Topic.LINK, text, is_well)
            for text in condition_messages(self._channel, self._condition, self._link.condition)
        ]
        self._condition = self._link.condition
        if self._link.dropped > self._dropped:
            text = (
                f"{self._link.dropped - self._dropped} frames of {self._channel} were lost before this process could "
                "read them\n"
                "  remedy: give it a processor of its own (taskset) and real-time priority (chrt)"
            )
            told.append(Notice(Topic.LINK, text, incident=f"frames of {self._channel} lost"))
            self._dropped = self._link.dropped
        if self._outbox.unsent > self._unsent:
            text = (
                f"{self._outbox.unsent - self._unsent} results were not sent, the transmit queue of "
                f"{self._channel} is full\n"
                "  remedy: check that another node acknowledges, the bus load, and the length of the queue "
                f"(SocketCAN: sudo ip link set {self._channel} txqueuelen 1000)"
            )
            told.append(Notice(Topic.LINK, text, incident=f"transmit queue of {self._channel} full"))
            self._unsent = self._outbox.unsent
        if told:
            self._next = now + round(PERIOD * 1e9)
        return told
