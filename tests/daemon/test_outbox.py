"""Results on their way to a link that has no room for them."""

import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import Frame, LinkDownError
from observer_rt.daemon.bus_connection import CAPACITY, Outbox
from observer_rt.engine.service.messages import OutputFrame
from tests.links import FakeLink


def frame(number: int) -> OutputFrame:
    return OutputFrame(0x200, False, True, number.to_bytes(4, "little"))


class NarrowLink(FakeLink):
    """Takes `room` frames, then none until it is given more; `down`: fails instead."""

    def __init__(self, room: int = 0) -> None:
        super().__init__()
        self.room = room
        self.down = False
        self.taken: list[int] = []

    def on_sent(self, frame: Frame) -> None:
        raise AssertionError("would wait")

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        if self.down:
            raise LinkDownError("pulled out")
        if self.room == 0:
            return False
        self.room -= 1
        self.taken.append(int.from_bytes(payload, "little"))
        return True


@given(steps=st.lists(st.tuples(st.integers(0, 300), st.integers(0, 300)), max_size=20))
def test_frames_go_in_order_and_each_is_sent_waits_or_is_counted(steps: list[tuple[int, int]]) -> None:
    link = NarrowLink()
    outbox = Outbox(link)
    posted = 0
    for count, room in steps:
        link.room = room
        outbox.post(frame(posted + n) for n in range(count))
        posted += count
        assert len(link.taken) + len(outbox) + outbox.unsent == posted
        assert len(outbox) <= CAPACITY
        assert not (outbox and link.room)  # nothing waits while there is room
    assert link.taken == sorted(set(link.taken))


def test_the_oldest_are_given_up() -> None:
    link = NarrowLink()
    outbox = Outbox(link)
    outbox.post(frame(n) for n in range(CAPACITY + 3))
    assert (outbox.unsent, len(outbox)) == (3, CAPACITY)
    link.room = 2 * CAPACITY
    outbox.flush()
    assert link.taken == list(range(3, CAPACITY + 3))


def test_what_waits_when_the_link_goes_down_is_counted() -> None:
    link = NarrowLink(room=1)
    outbox = Outbox(link)
    outbox.post([frame(0), frame(1)])
    link.down = True
    with pytest.raises(LinkDownError):
        outbox.post([frame(2)])
    outbox.discard()
    assert (outbox.unsent, len(outbox), link.taken) == (2, 0, [0])


def test_the_last_frames_are_waited_for_but_not_for_ever() -> None:
    class SlowLink(NarrowLink):
        refusals: Iterator[bool] = iter([True] * 5)

        def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
            self.room = 0 if next(self.refusals, False) else 1
            return super().try_send(frame_id, payload, is_extended, is_fd)

    link = SlowLink()
    outbox = Outbox(link)
    outbox.post([frame(0), frame(1)])
    outbox.drain(10.0)
    assert (link.taken, outbox.unsent) == ([0, 1], 0)
    full = Outbox(NarrowLink())
    full.post([frame(0)])
    start = time.monotonic()
    full.drain(0.05)
    assert time.monotonic() - start < 5.0
    assert (full.unsent, len(full)) == (1, 0)
