"""Raw SocketCAN links on a real vcan0."""

import errno
import socket
import struct
import time
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from observer_rt.bus.can_frame import GroupIdentifier
from observer_rt.bus.links import socketcan as socketcan_link
from observer_rt.bus.links.controller import BusCondition, BusState
from observer_rt.bus.links.link import FdFlags, Frame, Link, StampSource
from observer_rt.bus.links.opening import open_link
from observer_rt.foundation.errors import RunError
from tests.bus.links.kinds import KINDS

pytestmark = pytest.mark.vcan


def link_on(channel: str, receive_ids: list[tuple[int, bool]] | None = None, *, fd: bool = True) -> Link:
    return open_link("socketcan", channel, fd, receive_ids)


def test_messages_of_j1939_come_from_any_source(vcan: str) -> None:
    group = GroupIdentifier(0x18FEF1FE)
    with link_on(vcan, []) as sender, link_on(vcan, [(group, True), (0x100, False)]) as receiver:
        for identifier in (0x18FEF200, 0x0CFEF103, 0x18FEF104):
            sender.send(identifier, b"\1", True, False)
        sender.send(0x100, b"\2", False, False)
        frames = [receiver.receive(1.0), receiver.receive(1.0), receiver.receive(0.05)]
    assert [frame and (frame.frame_id, frame.is_extended) for frame in frames] == [
        (0x18FEF1FE, True),
        (0x100, False),
        None,
    ]


@pytest.mark.parametrize(
    ("frame_id", "payload", "is_extended", "is_fd"), [*KINDS, (0x101, b"\x55", False, True)]
)
def test_a_frame_arrives_as_sent(
    vcan: str, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool
) -> None:
    with link_on(vcan, []) as sender, link_on(vcan) as receiver:
        before = time.time_ns()
        sender.send(frame_id, payload, is_extended, is_fd)
        frame = receiver.receive(1.0)
    assert frame is not None
    assert frame == Frame(frame_id, payload, frame.stamp_ns, is_extended, is_fd, bit_rate_switch=is_fd)
    assert before <= frame.stamp_ns <= time.time_ns()


@pytest.mark.parametrize("is_fd", [True, False])
@pytest.mark.parametrize(("switched", "state"), [(True, False), (False, False), (True, True), (False, True)])
def test_the_flags_of_an_fd_frame_arrive_as_sent(vcan: str, is_fd: bool, switched: bool, state: bool) -> None:
    with (
        link_on(vcan, []) as sender,
        link_on(vcan) as receiver,
        can.Bus(interface="socketcan", channel=vcan, fd=True) as reference,
    ):
        sender.send(0x100, b"\1", False, is_fd, FdFlags(switched, state))
        frame = receiver.receive(1.0)
        message = reference.recv(1.0)
    assert frame is not None
    assert message is not None
    assert (frame.bit_rate_switch, frame.error_state_indicator) == (is_fd and switched, is_fd and state)
    assert (message.bitrate_switch, message.error_state_indicator) == (is_fd and switched, is_fd and state)


def test_python_can_understands_our_frames_and_we_its(vcan: str) -> None:
    with link_on(vcan) as link, can.Bus(interface="socketcan", channel=vcan, fd=True) as bus:
        link.send(0x200, bytes(range(64)), False, True)
        message = bus.recv(1.0)
        assert message is not None
        assert (message.arbitration_id, bytes(message.data)) == (0x200, bytes(range(64)))
        assert message.is_fd
        assert message.bitrate_switch
        bus.send(can.Message(arbitration_id=0x12345, data=b"abc", is_extended_id=True))
        frame = link.receive(1.0)
        assert frame is not None
        assert frame[:2] == (0x12345, b"abc")
        assert (frame.is_extended, frame.is_fd) == (True, False)


def test_only_wanted_data_frames_are_received(vcan: str) -> None:
    sent = [(0x101, False), (0x100, True), (0x200, False), (0x100, False), (0x200, True)]
    with (
        link_on(vcan, []) as sender,
        link_on(vcan, [(0x100, False), (0x200, True)]) as some,
        link_on(vcan) as everything,
        can.Bus(interface="socketcan", channel=vcan) as remote,
    ):
        remote.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True))
        for frame_id, is_extended in sent:
            sender.send(frame_id, b"", is_extended, True)

        def identifiers(link: Link) -> list[tuple[int, bool]]:
            return [(f.frame_id, f.is_extended) for f in iter(lambda: link.receive(0.05), None)]

        assert identifiers(some) == [(0x100, False), (0x200, True)]
        assert identifiers(everything) == sent
        assert identifiers(sender) == []


def test_a_link_without_fd_receives_classic_frames_only(vcan: str) -> None:
    with link_on(vcan, []) as sender, link_on(vcan, fd=False) as classic:
        sender.send(0x100, bytes(64), False, True)
        sender.send(0x101, bytes(8), False, False)
        frame = classic.receive(1.0)
        assert frame is not None
        assert (frame.frame_id, frame.is_fd) == (0x101, False)
        with pytest.raises(RunError, match=r"link\.fd = true"):
            classic.send(0x100, bytes(64), False, True)


def test_receive_waits_no_longer_than_told(vcan: str) -> None:
    with link_on(vcan, []) as link:
        start = time.monotonic()
        assert link.receive(0.05) is None
        assert 0.045 <= time.monotonic() - start < 2.0
        assert link.receive(0.0) is None


def test_the_receive_buffer_holds_a_second_of_traffic(vcan: str) -> None:
    with link_on(vcan, []) as sender, link_on(vcan) as receiver:
        for n in range(5_000):
            sender.send(0x100, struct.pack("<I60x", n), False, True)
        numbers = [struct.unpack_from("<I", f.payload)[0] for f in iter(lambda: receiver.receive(0.05), None)]
        assert numbers == list(range(5_000))
        assert receiver.dropped == 0


def test_every_lost_frame_is_counted(vcan: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socketcan_link, "RECEIVE_BUFFER_BYTES", 4096)
    with link_on(vcan, []) as sender, link_on(vcan) as receiver:
        dropped = []
        for _ in range(2):
            for _ in range(200):
                sender.send(0x100, bytes(64), False, True)
            kept = sum(1 for _ in iter(lambda: receiver.receive(0.05), None))
            assert 0 < kept < 200
            sender.send(0x101, bytes(64), False, True)  # the count comes with the next frame
            assert receiver.receive(1.0) is not None
            dropped.append(200 - kept)
            assert receiver.dropped == sum(dropped)


def test_error_frames_tell_the_condition_and_are_no_data(vcan: str) -> None:
    """A virtual interface has no errors of its own, but delivers the error frames that are sent on it."""
    bus_off, restarted, not_acknowledged, controller = 0x40, 0x100, 0x20, 0x04
    passive, overrun = bytes([0, 0x20]), bytes([0, 0x01])
    with (
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as driver,
        link_on(vcan, [(0x100, False)]) as link,
    ):
        driver.bind((vcan,))

        def tell(kind: int, data: bytes = b"") -> BusCondition:
            frame = struct.pack("=IB3x8s", socket.CAN_ERR_FLAG | kind, 8, data)
            driver.send(frame)
            assert link.receive(0.05) is None
            return link.condition

        assert link.condition == BusCondition()
        assert tell(controller, passive).state is BusState.PASSIVE
        assert tell(bus_off).state is BusState.OFF
        told = tell(restarted)
        assert (told.state, told.passives, told.bus_offs, told.restarts) == (BusState.ACTIVE, 1, 1, 1)
        assert tell(not_acknowledged) == told  # one for every frame nobody hears would be too many
        assert link.dropped == 0
        assert tell(controller, overrun).overruns == link.dropped == 1


def test_the_stamps_of_a_virtual_interface_are_the_kernels(vcan: str) -> None:
    with link_on(vcan) as link:
        assert link.stamp_source is StampSource.KERNEL


def test_a_receive_buffer_smaller_than_wanted_is_told(vcan: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class Unprivileged(socket.socket):
        def setsockopt(self, level: int, option: int, value: int | bytes) -> None:  # type: ignore[override]
            if (level, option) == (socket.SOL_SOCKET, 33):  # SO_RCVBUFFORCE
                raise PermissionError
            super().setsockopt(level, option, value)

    monkeypatch.setattr(socket, "socket", Unprivileged)
    allowed = int(Path("/proc/sys/net/core/rmem_max").read_text())
    monkeypatch.setattr(socketcan_link, "RECEIVE_BUFFER_BYTES", allowed)
    with link_on(vcan) as link:
        assert list(link.warnings) == []
    monkeypatch.setattr(socketcan_link, "RECEIVE_BUFFER_BYTES", 2 * allowed)
    with link_on(vcan) as link:
        (warning,) = link.warnings
        assert f"sysctl --write net.core.rmem_max={2 * allowed}" in warning


@pytest.mark.parametrize(("length", "is_fd"), [(65, True), (9, False)])
def test_too_long_a_payload_is_refused(vcan: str, length: int, is_fd: bool) -> None:
    with link_on(vcan, []) as link, pytest.raises(ValueError, match=f"{length} bytes"):
        link.send(0x100, bytes(length), False, is_fd)


def test_a_missing_interface_is_named_with_those_present(vcan: str) -> None:
    with pytest.raises(RunError, match=rf"no interface nocan9 .*{vcan}.*\n.*ip link add dev nocan9"):
        link_on("nocan9")
    with pytest.raises(RunError, match="no interface nocan9"):
        link_on("nocan9", fd=False)


def failing_socket(number: int, failures: int) -> tuple[type[socket.socket], Callable[[], int]]:
    """A socket class whose first `failures` sends and receives fail with error `number`."""
    left = [failures]

    class FailingSocket(socket.socket):
        def _fail(self) -> None:
            if left[0] > 0:
                left[0] -= 1
                raise OSError(number, "as arranged")

        def send(self, data: bytes, flags: int = 0) -> int:  # type: ignore[override]
            self._fail()
            return super().send(data, flags)

        def recvmsg(self, *sizes: int) -> tuple[bytes, list[tuple[int, int, bytes]], int, object]:
            self._fail()
            return super().recvmsg(*sizes)

    return FailingSocket, lambda: left[0]


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (errno.ENETDOWN, r"vcan0 is down\n.*ip link set vcan0 up"),
        (errno.ENODEV, "no interface vcan0"),
        (errno.ENXIO, "no interface vcan0"),
    ],
)
def test_a_lost_interface_fails_with_the_remedy(
    vcan: str, monkeypatch: pytest.MonkeyPatch, number: int, said: str
) -> None:
    kind, _ = failing_socket(number, failures=2)
    monkeypatch.setattr(socket, "socket", kind)
    with link_on(vcan) as link:
        with pytest.raises(RunError, match=said):
            link.receive(0.0)
        with pytest.raises(RunError, match=said):
            link.send(0x100, b"", False, True)


def test_whether_there_is_room_is_told_without_waiting(vcan: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with link_on(vcan) as receiver:
        kind, _ = failing_socket(errno.ENOBUFS, failures=2)
        monkeypatch.setattr(socket, "socket", kind)
        with link_on(vcan) as sender:
            taken = [sender.try_send(0x100, bytes([n]), False, True) for n in range(4)]
        assert taken == [False, False, True, True]
        assert [f.payload for f in iter(lambda: receiver.receive(0.05), None)] == [b"\2", b"\3"]


def test_a_full_transmit_queue_is_waited_for(vcan: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with link_on(vcan) as receiver:
        kind, left = failing_socket(errno.ENOBUFS, failures=20)
        monkeypatch.setattr(socket, "socket", kind)
        with link_on(vcan) as sender:
            sender.send(0x100, b"once", False, True)
        assert left() == 0
        frames = list(iter(lambda: receiver.receive(0.05), None))
        assert [frame.payload for frame in frames] == [b"once"]


def test_a_queue_that_stays_full_is_reported(vcan: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, _ = failing_socket(errno.ENOBUFS, failures=1_000_000)
    monkeypatch.setattr(socket, "socket", kind)
    with link_on(vcan) as sender:
        start = time.monotonic()
        with pytest.raises(RunError, match=r"stayed full.*\n.*txqueuelen"):
            sender.send(0x100, b"", False, True)
        assert time.monotonic() - start < 5.0
