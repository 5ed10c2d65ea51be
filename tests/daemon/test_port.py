"""Results on their way to a link that has no room for them."""

import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import Frame, LinkDownError
from observer_rt.daemon.port import CAPACITY, Port
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


def port_of(link: NarrowLink) -> Port:
    return Port("can5", "can5", link, False, lambda _: None)


@given(steps=st.lists(st.tuples(st.integers(0, 300), st.integers(0, 300)), max_size=20))
def test_frames_go_in_order_and_each_is_sent_or_counted(steps: list[tuple[int, int]]) -> None:
    link = NarrowLink()
    port = port_of(link)
    posted = 0
    for count, room in steps:
        link.room = room
        port.post([frame(posted + n) for n in range(count)], link)
        posted += count
        waiting = posted - len(link.taken) - port.unsent
        assert waiting <= CAPACITY
        assert port.is_waiting == (waiting > 0)
        assert not (waiting and link.room)  # nothing waits while there is room
    port.discard()
    assert (len(link.taken) + port.unsent, link.taken) == (posted, sorted(set(link.taken)))


def test_the_oldest_are_given_up() -> None:
    link = NarrowLink()
    port = port_of(link)
    port.post([frame(n) for n in range(CAPACITY + 3)], link)
    assert port.unsent == 3
    link.room = 2 * CAPACITY
    port.post([], link)
    assert link.taken == list(range(3, CAPACITY + 3))


def test_what_waits_when_the_link_goes_down_is_counted() -> None:
    link = NarrowLink(room=1)
    port = port_of(link)
    port.post([frame(0), frame(1)], link)
    link.down = True
    with pytest.raises(LinkDownError) as raised:
        port.post([frame(2)], link)
    port.go_down(raised.value)
    port.post([frame(3)], link)
    assert (port.unsent, port.is_waiting, link.taken) == (3, False, [0])


def test_the_last_frames_are_waited_for_but_not_for_ever() -> None:
    class SlowLink(NarrowLink):
        refusals: Iterator[bool] = iter([True] * 5)

        def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
            self.room = 0 if next(self.refusals, False) else 1
            return super().try_send(frame_id, payload, is_extended, is_fd)

    link = SlowLink()
    port = port_of(link)
    port.post([frame(0), frame(1)], link)
    port.drain(10.0, link)
    assert (link.taken, port.unsent) == ([0, 1], 0)
    full = NarrowLink()
    port = port_of(full)
    port.post([frame(0)], full)
    start = time.monotonic()
    port.drain(0.05, full)
    assert time.monotonic() - start < 5.0
    assert (port.unsent, port.is_waiting) == (1, False)
