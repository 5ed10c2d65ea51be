"""A bus with one connection for several users: each hears what it wants, all send, and it comes back once for all."""

import threading
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack
from uuid import uuid4

import pytest

from observer_rt.bus.links.link import Frame, Link, LinkDownError
from observer_rt.bus.links.opening import CAPACITY, SharedBus, open_link
from observer_rt.foundation.errors import RunError, UserError
from tests.links import FakeLink


class DeviceLink(FakeLink):
    """Receives what the test gives it, raises what it gives, and counts how often it was connected and closed."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting: deque[Frame | Exception] = deque()
        self.emptied = threading.Event()
        self.connections = 1
        self.closed = 0
        self.is_away = False

    def receive(self, timeout_s: float) -> Frame | None:
        if not self.waiting:
            self.emptied.set()
            threading.Event().wait(1e-3)
            return None
        arrived = self.waiting.popleft()
        if isinstance(arrived, Exception):
            self.emptied.set()
            raise arrived
        return arrived

    def reconnect(self) -> None:
        if self.is_away:
            raise LinkDownError("still away")
        self.connections += 1

    def close(self) -> None:
        self.closed += 1

    def give(self, *arrived: Frame | Exception) -> None:
        """All that comes in; returns when it was read."""
        self.waiting.extend(arrived)
        self.emptied.clear()
        self.emptied.wait(5.0)


@pytest.fixture
def device() -> DeviceLink:
    return DeviceLink()


@pytest.fixture
def users(device: DeviceLink) -> Iterator[list[Link]]:
    """One that wants 1 and 2, one that wants 2 and the extended 3."""
    bus = SharedBus(lambda: device)
    with ExitStack() as stack:
        wanted = ([(1, False), (2, False)], [(2, False), (3, True)])
        yield [stack.enter_context(bus.open(each)) for each in wanted]


def read_on(link: Link) -> None:
    """For as long as nothing keeps it from reading, a second at the most."""
    for _ in range(100):
        link.receive(0.01)


def heard(link: Link) -> list[int]:
    """Identifiers of what waits."""
    found = []
    while (frame := link.receive(0.0)) is not None:
        found.append(frame.frame_id)
    return found


def test_each_hears_what_it_wants_in_order(device: DeviceLink, users: list[Link]) -> None:
    device.give(*(Frame(identifier, b"", 0) for identifier in (2, 1, 3, 2, 9)), Frame(3, b"", 0, True))
    assert [heard(user) for user in users] == [[2, 1, 2], [2, 2, 3]]
    assert users[0].receive(0.01) is None


def test_all_send_through_the_one(device: DeviceLink, users: list[Link]) -> None:
    users[0].send(5, b"a", False, True)
    assert users[1].try_send(6, b"b", True, False)
    assert [(frame.frame_id, frame.payload) for frame in device.sent] == [(5, b"a"), (6, b"b")]


def test_it_closes_with_its_last_user_and_opens_with_the_next(device: DeviceLink) -> None:
    opened: list[DeviceLink] = []

    def connect() -> Link:
        opened.append(device)
        return device

    bus = SharedBus(connect)
    first, second = bus.open([(1, False)]), bus.open([(1, False)])
    first.close()
    device.give(Frame(1, b"", 0))
    assert (len(opened), device.closed, heard(second)) == (1, 0, [1])
    second.close()
    assert device.closed == 1
    with bus.open([(1, False)]) as third:
        device.give(Frame(1, b"", 0))
        assert (len(opened), heard(third)) == (2, [1])


def test_an_outage_is_one_for_all_and_ends_once(device: DeviceLink, users: list[Link]) -> None:
    device.give(LinkDownError("unplugged"))
    for user in users:
        with pytest.raises(LinkDownError, match="unplugged"):
            read_on(user)
    device.is_away = True
    with pytest.raises(LinkDownError, match="still away"):
        users[0].reconnect()
    device.is_away = False
    users[0].reconnect()
    device.give(Frame(2, b"", 0))
    with pytest.raises(LinkDownError, match="unplugged"):  # it has not been told that all is well
        users[1].receive(1.0)
    users[1].reconnect()
    assert device.connections == 2
    assert [heard(user) for user in users] == [[2], [2]]


def test_who_comes_during_an_outage_hears_of_it() -> None:
    device = DeviceLink()
    bus = SharedBus(lambda: device)
    with bus.open([(1, False)]) as first:
        device.give(LinkDownError("unplugged"))
        with pytest.raises(LinkDownError):
            read_on(first)
        with bus.open([(1, False)]) as second:
            with pytest.raises(LinkDownError, match="unplugged"):
                read_on(second)
            for user in (second, first):
                user.reconnect()
            device.give(Frame(1, b"", 0))
            assert [heard(user) for user in (first, second)] == [[1], [1]]
    assert device.connections == 2


def test_whatever_ends_the_reading_is_heard_by_all(device: DeviceLink, users: list[Link]) -> None:
    device.give(ZeroDivisionError("in the driver"))
    for user in users:
        with pytest.raises(ZeroDivisionError):
            read_on(user)


@pytest.mark.parametrize("failure", [UserError("link", "no"), LinkDownError("away"), RunError("broken")])
def test_what_keeps_it_from_opening_is_told(failure: Exception) -> None:
    def connect() -> Link:
        raise failure

    bus = SharedBus(connect)
    for _ in range(2):
        with pytest.raises(type(failure)):
            bus.open([(1, False)])


def test_who_does_not_read_loses_frames_that_are_counted(device: DeviceLink, users: list[Link]) -> None:
    device.lost = 7
    device.give(*[Frame(1, b"", 0)] * (CAPACITY + 5), Frame(2, b"", 0))
    assert [user.dropped for user in users] == [7 + 6, 7]
    assert heard(users[1]) == [2]
    assert len(heard(users[0])) == CAPACITY


def test_over_python_can() -> None:
    channel = f"test-{uuid4()}"
    bus = SharedBus(lambda: open_link("virtual", channel, True, [(1, False), (2, False)]))
    with (
        open_link("virtual", channel, True, None) as device,
        bus.open([(1, False)]) as one,
        bus.open([(2, False)]) as two,
    ):
        for identifier in (1, 2, 3):
            device.send(identifier, b"x", False, True)
        found = [user.receive(1.0) for user in (one, two)]
        assert [frame and frame.frame_id for frame in found] == [1, 2]
        assert one.stamp_source == two.stamp_source
        one.send(9, b"result", False, True)
        answer = device.receive(1.0)
        assert answer is not None
        assert answer.frame_id == 9
        assert heard(two) == []
