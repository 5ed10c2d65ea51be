"""Links over a socket that was handed over."""

import socket
import struct
import time
from collections.abc import Iterator

import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.bus.links.opening import open_link
from observer_rt.foundation.errors import RunError, UserError

FD_FRAME = struct.Struct("=IBB2x64s")
Pair = tuple[socket.socket, socket.socket]


@pytest.fixture(params=[socket.SOCK_SEQPACKET, socket.SOCK_DGRAM])
def pair(request: pytest.FixtureRequest) -> Iterator[Pair]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, request.param)
    with ours, theirs:
        yield ours, theirs


def test_frames_go_both_ways_as_on_socketcan(pair: Pair) -> None:
    ours, theirs = pair
    with open_link("descriptor", str(theirs.fileno()), True, [(0x100, False)]) as link:
        before = time.time_ns()
        ours.send(FD_FRAME.pack(0x100, 12, 1, bytes(range(12))))
        after = time.time_ns()
        frame = link.receive(1.0)
        assert frame is not None
        assert before <= frame.stamp_ns <= after  # of when it came, not of when it was read, nor of another clock
        assert frame == Frame(0x100, bytes(range(12)), frame.stamp_ns, False, True, True)
        link.send(0x200, bytes(64), False, True)
        assert FD_FRAME.unpack(ours.recv(100)) == (0x200, 64, 1, bytes(64))


def test_unwanted_frames_are_left_out_and_the_descriptor_outlives_the_link(pair: Pair) -> None:
    ours, theirs = pair
    for identifier in (0x101, 0x100):
        ours.send(FD_FRAME.pack(identifier, 8, 0, bytes(8)))
    frames: list[Frame | None] = []
    for _ in range(3):
        with open_link("descriptor", str(theirs.fileno()), True, [(0x100, False)]) as link:
            frames.append(link.receive(0.0))
    assert [frame and frame.frame_id for frame in frames] == [None, 0x100, None]


def test_the_other_end_closed_is_an_error_without_a_way_back() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs, open_link("descriptor", str(theirs.fileno()), True, None) as link:
        ours.close()
        with pytest.raises(RunError, match="other end of descriptor"):
            link.receive(0.1)


@pytest.mark.parametrize("channel", ["can0", "987654"])
def test_what_is_no_descriptor_is_named(channel: str) -> None:
    with pytest.raises(UserError, match=r"link\.channel"):
        open_link("descriptor", channel, True, [])
