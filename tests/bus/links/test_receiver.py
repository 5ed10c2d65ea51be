"""Reading several links at once: whichever frame comes first, none starved, a failing one left out and taken back."""

import socket
import threading
import time
import uuid
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import pytest

from observer_rt.bus.links.link import BusFrame, Frame, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.links.receiver import BusDownError, LinkReceiver, reading
from observer_rt.foundation.errors import RunError
from tests.links import FakeLink

PATIENCE = 20.0  # s


class PipeLink(FakeLink):
    """Frames put in by the test; with a descriptor that is readable while some wait, or without."""

    def __init__(self, has_descriptor: bool) -> None:
        super().__init__()
        self._near, self._far = socket.socketpair()
        self._near.setblocking(False)
        self._has_descriptor = has_descriptor
        self._frames: deque[Frame] = deque()
        self.failure: RunError | None = None

    def put(self, number: int, stamp_ns: int = 0) -> None:
        self._far.send(b"x")  # before the frame, so that it is there when the frame is taken
        self._frames.append(Frame(number, b"", stamp_ns))

    def fail(self, error: RunError) -> None:
        self.failure = error
        self._far.send(b"x")

    def receive(self, timeout_s: float) -> Frame | None:
        if self.failure is not None:
            raise self.failure
        end = time.monotonic() + timeout_s
        while not self._frames and time.monotonic() < end:
            time.sleep(1e-4)
        if not self._frames:
            return None
        self._near.recv(1)
        return self._frames.popleft()

    def reconnect(self) -> None:
        self.failure = None

    @property
    def descriptor(self) -> int | None:
        return self._near.fileno() if self._has_descriptor else None

    def close(self) -> None:
        self._near.close()
        self._far.close()


@contextmanager
def links_and_reading(*have_descriptors: bool) -> Iterator[tuple[list[PipeLink], LinkReceiver]]:
    with ExitStack() as stack:
        links = [stack.enter_context(PipeLink(has)) for has in have_descriptors]
        reader = reading(links)
        try:
            yield links, reader
        finally:
            reader.close()


def received(reader: LinkReceiver, count: int) -> list[BusFrame]:
    found: list[BusFrame] = []
    end = time.monotonic() + PATIENCE
    while len(found) < count:
        assert time.monotonic() < end
        frame = reader.receive(0.01)
        if frame is not None:
            found.append(frame)
    return found


KINDS = [(True, True, True), (False, False, False), (True, False, True)]  # which links have a descriptor


@pytest.mark.parametrize("kinds", KINDS)
def test_frames_of_all_buses_come_with_their_bus(kinds: Sequence[bool]) -> None:
    with links_and_reading(*kinds) as (links, reader):
        for number in range(30):
            links[number % 3].put(number)
        found = received(reader, 30)
        assert reader.receive(0.0) is None
    for bus in range(3):
        assert [f.frame.frame_id for f in found if f.bus == bus] == list(range(bus, 30, 3))


@pytest.mark.parametrize("kinds", KINDS)
def test_a_flooded_bus_does_not_keep_another_waiting(kinds: Sequence[bool]) -> None:
    with links_and_reading(*kinds) as (links, reader):
        for number in range(100):
            links[0].put(number, stamp_ns=1000 + number)
        received(reader, 10)
        links[1].put(999, stamp_ns=1010)
        found = received(reader, 91)
        place = next(n for n, frame in enumerate(found) if frame.bus == 1)
    if all(kinds):
        assert place <= 5  # behind the frames that are older
    assert len(found) == 91


def test_of_waiting_frames_the_earliest_comes_first() -> None:
    with links_and_reading(True, True) as (links, reader):
        for stamp in (10, 40, 50):
            links[0].put(stamp, stamp)
        for stamp in (20, 30, 60):
            links[1].put(stamp, stamp)
        assert [f.frame.stamp_ns for f in received(reader, 6)] == [10, 20, 30, 40, 50, 60]


def test_nothing_within_the_time_out() -> None:
    for kinds in [(True,), *KINDS]:
        with links_and_reading(*kinds) as (_, reader):
            start = time.monotonic()
            assert reader.receive(0.05) is None
            assert time.monotonic() - start >= 0.045


@pytest.mark.parametrize("kinds", [(True,), *KINDS])
def test_a_bus_that_fails_is_left_out_and_taken_back(kinds: Sequence[bool]) -> None:
    last = len(kinds) - 1
    with links_and_reading(*kinds) as (links, reader):
        links[last].fail(LinkDownError("unplugged"))
        with pytest.raises(BusDownError, match="unplugged") as raised:
            received(reader, 1)
        assert raised.value.bus == last
        reader.leave_out(last)
        if last:
            links[0].put(5)
            assert received(reader, 1)[0].bus == 0
        else:
            assert reader.receive(0.01) is None
        links[last].reconnect()
        reader.take_back(last)
        links[last].put(7)
        assert received(reader, 1) == [BusFrame(last, Frame(7, b"", 0))]


@pytest.mark.parametrize("kinds", KINDS)
def test_a_failure_for_good_is_raised(kinds: Sequence[bool]) -> None:
    with links_and_reading(*kinds) as (links, reader):
        links[1].fail(RunError("broken"))
        with pytest.raises(RunError, match="broken"):
            received(reader, 1)


def test_python_can_buses_are_read_side_by_side() -> None:
    channels = [f"reading-{uuid.uuid4().hex[:8]}-{n}" for n in range(3)]
    with ExitStack() as stack:
        links = [stack.enter_context(open_link("virtual", name, True, None, True)) for name in channels]
        senders = [stack.enter_context(open_link("virtual", name, True, [])) for name in channels]
        reader = reading(links)
        threads = threading.active_count()
        for number in range(60):
            senders[number % 3].send(number, b"", False, True)
        found = received(reader, 60)
        reader.close()
        assert threading.active_count() == threads - 3
    stamps = [f.frame.stamp_ns for f in found]
    assert abs(stamps[-1] - time.time_ns()) < PATIENCE * 1e9
    for bus in range(3):
        assert [f.frame.frame_id for f in found if f.bus == bus] == list(range(bus, 60, 3))
