"""Reading several links at once: whichever frame comes first, none starved; one that is down comes back."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue

import pytest

from observer_rt.bus.links.enduring_reading import EnduringReading
from observer_rt.bus.links.link import BusFrame, Frame, LinkDownError
from observer_rt.foundation.errors import RunError
from tests.links import FakeLink

PATIENCE = 20.0  # s


class PutLink(FakeLink):
    """Frames and failures put in by the test; it cannot be connected anew as often as stated."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting: SimpleQueue[Frame | RunError] = SimpleQueue()
        self.away_for = 0

    def put(self, number: int) -> None:
        self.waiting.put(Frame(number, b"", 0))

    def receive(self, timeout_s: float) -> Frame | None:
        try:
            item = self.waiting.get(timeout=timeout_s)
        except Empty:
            return None
        if isinstance(item, RunError):
            raise item
        return item

    def reconnect(self) -> None:
        self.away_for -= 1
        if self.away_for >= 0:
            raise LinkDownError("still away")


@contextmanager
def links_and_reading(count: int) -> Iterator[tuple[list[PutLink], EnduringReading]]:
    links = [PutLink() for _ in range(count)]
    reader = EnduringReading(links)
    try:
        yield links, reader
    finally:
        reader.close()


def received(reader: EnduringReading, count: int) -> list[BusFrame]:
    frames = [reader.receive(PATIENCE) for _ in range(count)]
    return [frame for frame in frames if frame is not None]


def test_frames_of_all_buses_come_with_their_bus() -> None:
    with links_and_reading(3) as (links, reader):
        for number in range(30):
            links[number % 3].put(number)
        frames = received(reader, 30)
        assert reader.receive(0.01) is None
    for bus in range(3):
        assert [f.frame.frame_id for f in frames if f.bus == bus] == list(range(bus, 30, 3))


def test_a_bus_that_goes_down_comes_back_and_the_others_go_on() -> None:
    with links_and_reading(2) as (links, reader):
        links[1].away_for = 2
        links[1].waiting.put(LinkDownError("unplugged"))
        links[0].put(5)
        assert received(reader, 1)[0].bus == 0
        links[1].put(7)
        assert (received(reader, 1), reader.outages) == ([BusFrame(1, Frame(7, b"", 0))], 1)
        assert links[1].away_for == -1


def test_a_failure_for_good_is_raised() -> None:
    with links_and_reading(2) as (links, reader):
        links[1].waiting.put(RunError("broken"))
        with pytest.raises(RunError, match="broken"):
            received(reader, 1)


def test_it_ends_while_a_link_is_away() -> None:
    threads = threading.active_count()
    with links_and_reading(1) as (links, reader):
        links[0].away_for = 1 << 30
        links[0].waiting.put(LinkDownError("unplugged"))
        assert reader.receive(0.05) is None
    assert links[0].away_for < 1 << 30 or reader.outages <= 1
    assert threading.active_count() == threads
