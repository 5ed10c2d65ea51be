"""Links over python-can's virtual bus."""

import threading
import time
from collections.abc import Iterator
from uuid import uuid4

import can
import pytest
from can.interfaces.virtual import VirtualBus

from observer_rt.bus.links.link import FdFlags, Frame, Link, LinkDownError, StampSource
from observer_rt.bus.links.opening import open_link
from observer_rt.foundation.errors import RunError, UserError
from tests.bus.links.kinds import KINDS


@pytest.fixture
def channel() -> str:
    return f"test-{uuid4()}"


@pytest.fixture
def sender(channel: str) -> Iterator[Link]:
    with open_link("virtual", channel, True, []) as link:
        yield link


def receiver_of(channel: str, receive_ids: list[tuple[int, bool]] | None = None) -> Link:
    return open_link("virtual", channel, True, receive_ids)


@pytest.mark.parametrize(("frame_id", "payload", "is_extended", "is_fd"), KINDS)
def test_a_frame_arrives_as_sent(
    sender: Link, channel: str, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool
) -> None:
    with receiver_of(channel) as receiver:
        before = time.time_ns()
        sender.send(frame_id, payload, is_extended, is_fd)
        frame = receiver.receive(1.0)
    assert frame is not None
    assert frame == Frame(frame_id, payload, frame.stamp_ns, is_extended, is_fd, bit_rate_switch=is_fd)
    assert before - 1_000 <= frame.stamp_ns <= time.time_ns() + 1_000


@pytest.mark.parametrize("is_fd", [True, False])
@pytest.mark.parametrize(("switched", "state"), [(True, False), (False, False), (True, True), (False, True)])
def test_the_flags_of_an_fd_frame_arrive_as_sent(
    sender: Link, channel: str, is_fd: bool, switched: bool, state: bool
) -> None:
    with receiver_of(channel) as receiver:
        sender.send(0x100, b"\1", False, is_fd, FdFlags(switched, state))
        frame = receiver.receive(1.0)
    assert frame is not None
    assert (frame.bit_rate_switch, frame.error_state_indicator) == (is_fd and switched, is_fd and state)


def test_nothing_is_lost_and_order_is_kept(sender: Link, channel: str) -> None:
    count = 5_000
    with receiver_of(channel) as receiver:
        flood = threading.Thread(
            target=lambda: [sender.send(0x100, n.to_bytes(8, "little"), False, True) for n in range(count)]
        )
        flood.start()
        received = [receiver.receive(5.0) for _ in range(count)]
        flood.join()
        assert receiver.receive(0.0) is None
        assert receiver.dropped == 0
    assert [int.from_bytes(frame.payload, "little") for frame in received if frame] == list(range(count))


def test_only_wanted_identifiers_are_received(sender: Link, channel: str) -> None:
    with receiver_of(channel, [(0x100, False), (0x200, True)]) as receiver:
        for frame_id, is_extended in [
            (0x101, False),
            (0x100, True),
            (0x200, False),
            (0x100, False),
            (0x200, True),
        ]:
            sender.send(frame_id, b"", is_extended, True)
        # Waiting behind three unwanted frames, yet found without waiting.
        wanted = [receiver.receive(0.0), receiver.receive(0.0)]
        assert [frame and (frame.frame_id, frame.is_extended) for frame in wanted] == [
            (0x100, False),
            (0x200, True),
        ]
        assert receiver.receive(0.0) is None


def test_remote_and_error_frames_are_left_out(channel: str) -> None:
    with receiver_of(channel) as receiver, can.Bus(interface="virtual", channel=channel) as bus:
        bus.send(can.Message(arbitration_id=1, is_remote_frame=True))
        bus.send(can.Message(arbitration_id=2, is_error_frame=True))
        bus.send(can.Message(arbitration_id=3, is_extended_id=False))
        frame = receiver.receive(0.0)
        assert frame is not None
        assert frame.frame_id == 3


def test_error_frames_are_counted(channel: str) -> None:
    with receiver_of(channel) as receiver, can.Bus(interface="virtual", channel=channel) as bus:
        bus.send(can.Message(is_error_frame=True))
        bus.send(can.Message(is_error_frame=True))
        assert receiver.receive(0.0) is None
        assert receiver.condition.error_frames == 2


def test_what_the_driver_refuses_may_be_tried_again(
    channel: str, sender: Link, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise can.CanOperationError("the transmit buffer is full")

    with receiver_of(channel) as receiver:
        with monkeypatch.context() as full:
            full.setattr(VirtualBus, "send", refuse)
            assert not sender.try_send(0x100, b"", False, True)
        assert sender.try_send(0x100, b"", False, True)
        assert receiver.receive(0.0) is not None


def test_threads_that_send_take_turns(channel: str, sender: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    within, met = threading.Semaphore(), list[bool]()

    def send(*_: object) -> None:
        met.append(not within.acquire(blocking=False))
        time.sleep(1e-3)
        within.release()

    monkeypatch.setattr(VirtualBus, "send", send)
    threads = [
        threading.Thread(target=lambda: [sender.try_send(0x100, b"", False, True) for _ in range(20)])
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert met == [False] * 40


def test_a_device_that_went_away_is_connected_anew(
    channel: str, sender: Link, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unplugged(*_: object, **__: object) -> None:
        raise can.CanInitializationError("no such device")

    with receiver_of(channel, [(0x100, False)]) as receiver:
        with monkeypatch.context() as without_device:
            without_device.setattr(VirtualBus, "_recv_internal", unplugged)
            with pytest.raises(LinkDownError, match="no such device"):
                receiver.receive(0.0)
            without_device.setattr(VirtualBus, "__init__", unplugged)
            for _ in range(2):
                with pytest.raises(LinkDownError, match="no such device"):
                    receiver.reconnect()
        receiver.reconnect()
        sender.send(0x101, b"", False, True)
        sender.send(0x100, b"", False, True)
        frame = receiver.receive(0.0)
        assert frame is not None
        assert frame.frame_id == 0x100


def test_a_driver_without_stamps(channel: str, sender: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    def send(bus: can.BusABC, message: can.Message, timeout: float | None = None) -> None:
        message.timestamp = 0.0
        monkeypatch.undo()
        with can.Bus(interface="virtual", channel=channel, preserve_timestamps=True) as other:
            other.send(message, timeout)

    assert sender.stamp_source is StampSource.ARRIVAL
    monkeypatch.setattr(VirtualBus, "send", send)
    with receiver_of(channel) as receiver:
        before = time.time_ns()
        sender.send(0x100, b"", False, True)
        frame = receiver.receive(0.0)
    assert frame is not None
    assert before <= frame.stamp_ns <= time.time_ns()


def test_receive_waits_no_longer_than_told(channel: str) -> None:
    with receiver_of(channel) as receiver:
        start = time.monotonic()
        assert receiver.receive(0.05) is None
        assert 0.045 <= time.monotonic() - start < 2.0


def test_own_frames_are_not_received(channel: str) -> None:
    with receiver_of(channel) as link:
        link.send(0x100, b"", False, True)
        assert link.receive(0.0) is None


def test_too_long_a_payload_is_refused(sender: Link) -> None:
    with pytest.raises(ValueError, match="64"):
        sender.send(0x100, bytes(65), False, True)


def test_a_closed_link_fails_with_its_name(channel: str) -> None:
    link = receiver_of(channel)
    link.close()
    with pytest.raises(RunError, match=f"virtual channel {channel}"):
        link.receive(0.0)
    with pytest.raises(RunError, match="cannot send"):
        link.send(0x100, b"", False, True)


def test_an_unknown_interface_is_a_users_mistake() -> None:
    with pytest.raises(UserError, match=r"unknown interface 'sokcetcan'\n.*\bsocketcan\b.*\bvirtual\b"):
        open_link("sokcetcan", "can0", True)


def test_an_interface_that_cannot_be_opened_fails_at_run_time() -> None:
    with pytest.raises(RunError, match=r"pcan channel NO_SUCH_CHANNEL cannot be opened.*\n.*driver"):
        open_link("pcan", "NO_SUCH_CHANNEL", True)
