"""What links of every kind do: over python-can's virtual bus, and on a real vcan0."""

import time
from collections.abc import Callable
from uuid import uuid4

import can
import pytest

from observer_rt.bus.links.link import FdFlags, Frame, Link
from observer_rt.bus.links.opening import open_link

Connect = Callable[[list[tuple[int, bool]] | None], Link]
PLACES = ["virtual", pytest.param("socketcan", marks=pytest.mark.vcan)]


@pytest.fixture
def channel(interface: str, request: pytest.FixtureRequest) -> str:
    return f"test-{uuid4()}" if interface == "virtual" else str(request.getfixturevalue("vcan"))


@pytest.fixture(params=PLACES)
def interface(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def connect(interface: str, channel: str) -> Connect:
    """Opens links on one bus, for these identifiers; None: for all."""
    return lambda receive_ids: open_link(interface, channel, True, receive_ids)


def waiting(link: Link) -> list[Frame]:
    return list(iter(lambda: link.receive(0.05), None))


@pytest.mark.parametrize(
    ("frame_id", "payload", "is_extended", "is_fd"),
    [
        (0x100, bytes(range(64)), False, True),
        (0x1ABCDEF0, b"\x55", True, True),
        (0x7FF, b"\x01\x02", False, False),
        (0x1, b"", True, False),
    ],
)
def test_it_arrives_as_sent(connect: Connect, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> None:
    with connect([]) as sender, connect(None) as receiver:
        before = time.time_ns()
        sender.send(frame_id, payload, is_extended, is_fd)
        frame = receiver.receive(1.0)
    assert frame is not None
    assert frame == Frame(frame_id, payload, frame.stamp_ns, is_extended, is_fd, bit_rate_switch=is_fd)
    assert before - 1_000 <= frame.stamp_ns <= time.time_ns() + 1_000


@pytest.mark.parametrize(
    ("is_fd", "switched", "state"), [(True, True, False), (True, False, True), (False, True, True)]
)
def test_flags_arrive_as_sent_and_python_can_understands_our_frames_as_we_its(
    connect: Connect, interface: str, channel: str, is_fd: bool, switched: bool, state: bool
) -> None:
    with (
        connect([]) as sender,
        connect(None) as receiver,
        can.Bus(interface=interface, channel=channel, fd=True) as reference,
    ):
        sender.send(0x100, b"\1", False, is_fd, FdFlags(switched, state))
        frame, message = receiver.receive(1.0), reference.recv(1.0)
        reference.send(can.Message(arbitration_id=0x12345, data=b"abc", is_extended_id=True))
        answer = receiver.receive(1.0)
    assert frame is not None
    assert message is not None
    assert (frame.bit_rate_switch, frame.error_state_indicator) == (is_fd and switched, is_fd and state)
    assert (message.bitrate_switch, message.error_state_indicator) == (is_fd and switched, is_fd and state)
    assert (message.arbitration_id, bytes(message.data), message.is_fd) == (0x100, b"\1", is_fd)
    assert answer is not None
    assert (*answer[:2], answer.is_extended, answer.is_fd) == (0x12345, b"abc", True, False)


def test_only_wanted_data_frames_are_received(connect: Connect, interface: str, channel: str) -> None:
    sent = [(0x101, False), (0x100, True), (0x200, False), (0x100, False), (0x200, True)]
    with (
        connect([]) as sender,
        connect([(0x100, False), (0x200, True)]) as some,
        connect(None) as everything,
        can.Bus(interface=interface, channel=channel) as remote,
    ):
        remote.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True))
        for frame_id, is_extended in sent:
            sender.send(frame_id, b"", is_extended, True)
        first = some.receive(0.0)  # waits behind unwanted ones, yet is found at once
        assert first is not None
        assert [(frame.frame_id, frame.is_extended) for frame in (first, *waiting(some))] == sent[3:]
        assert [(frame.frame_id, frame.is_extended) for frame in waiting(everything)] == sent
        assert waiting(sender) == []
        everything.send(0x100, b"", False, True)
        assert waiting(everything) == []  # not its own


def test_receive_waits_no_longer_than_told(connect: Connect) -> None:
    with connect([(0x100, False)]) as link:
        start = time.monotonic()
        assert link.receive(0.05) is None
        assert 0.045 <= time.monotonic() - start < 2.0
        assert link.receive(0.0) is None


@pytest.mark.parametrize(("length", "is_fd"), [(65, True), (9, False)])
def test_too_long_a_payload_is_refused(connect: Connect, length: int, is_fd: bool) -> None:
    with connect([]) as link, pytest.raises(ValueError, match=rf"\b{length} (bytes|but)"):
        link.send(0x100, bytes(length), False, is_fd)
