"""Links over python-can's virtual bus."""

import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock
from uuid import uuid4

import can
import pytest
from can.interfaces.virtual import VirtualBus

from observer_rt.bus.links.link import Link, LinkDownError, StampSource
from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench_file import LinkConfig
from observer_rt.foundation.errors import RunError, UserError


@pytest.fixture
def channel() -> str:
    return f"test-{uuid4()}"


@pytest.fixture
def sender(channel: str) -> Iterator[Link]:
    with open_link("virtual", channel, True, []) as link:
        yield link


def receiver_of(channel: str, receive_ids: list[tuple[int, bool]] | None = None) -> Link:
    return open_link("virtual", channel, True, receive_ids)


def test_error_frames_are_counted_and_are_no_data(channel: str) -> None:
    with receiver_of(channel) as receiver, can.Bus(interface="virtual", channel=channel) as bus:
        bus.send(can.Message(is_error_frame=True))
        bus.send(can.Message(is_error_frame=True))
        assert receiver.receive(0.0) is None
        assert receiver.condition.error_frames == 2


def test_what_the_driver_refuses_is_tried_again(channel: str, sender: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    with receiver_of(channel) as receiver:
        with monkeypatch.context() as full:
            full.setattr(VirtualBus, "send", Mock(side_effect=can.CanOperationError("the transmit buffer is full")))
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


def test_a_device_that_went_away_is_reconnected(channel: str, sender: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    unplugged = Mock(side_effect=can.CanInitializationError("no such device"))
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


def test_an_interface_that_cannot_be_opened_fails_at_run_time(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(VirtualBus, "__init__", Mock(side_effect=can.CanInitializationError("no such device")))
    with pytest.raises(LinkDownError, match=rf"virtual channel {channel} cannot be opened.*\n.*driver"):
        receiver_of(channel)


@pytest.mark.parametrize(
    ("interface", "remedy"),
    [("udp_multicast", "pip install msgpack"), ("pcan", "libpcanbasic of the vendor"), ("vector", "on Windows only")],
)
def test_what_a_driver_lacks_is_not_waited_for(interface: str, remedy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "msgpack", None)
    monkeypatch.setattr("observer_rt.bus.links.opening.find_library", lambda _: None)
    with pytest.raises(UserError, match=f"'{interface}' cannot be used on this computer\n.*{remedy}"):
        open_link(interface, "0", True)


@pytest.mark.parametrize("error", [can.CanInterfaceNotImplementedError("no API"), ImportError("no API")])
def test_a_driver_that_says_so_itself_is_not_waited_for_at_first(
    channel: str, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    with receiver_of(channel) as receiver:
        monkeypatch.setattr(VirtualBus, "__init__", Mock(side_effect=error))
        with pytest.raises(UserError, match="'virtual' cannot be used on this computer: no API"):
            receiver_of(channel)
        with pytest.raises(LinkDownError, match="no API"):
            receiver.reconnect()


@pytest.mark.parametrize("file", ["no section", "[default]\nport = 40000\nreceive_own_messages = True"])
def test_only_the_bench_file_configures_a_bus(file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files and variables that other programs of the user have for python-can count nothing."""
    opened, begin = list[object](), VirtualBus.__init__

    def note(bus: VirtualBus, channel: str | int, **options: object) -> None:
        opened.append((channel, options))
        begin(bus, channel, **options)  # type: ignore[arg-type]

    (tmp_path / ".canrc").write_text(file)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("CAN_CONFIG", '{"bitrate": 1')
    monkeypatch.setattr(VirtualBus, "__init__", note)
    open_link("virtual", "7", True, bit_rates=LinkConfig(bit_rate=1e6).bit_rates).close()
    assert opened == [(7, {"fd": True, "bitrate": 1_000_000, "data_bitrate": 5_000_000})]


class GroupBus:
    """As a bus of python-can's multicast, over a socket that is in no group; frames of another one came before."""

    def __init__(self, family: socket.AddressFamily = socket.AF_INET, address: str = "127.0.0.1") -> None:
        self.socket = socket.socket(family, socket.SOCK_DGRAM)
        self.socket.bind((address, 0))
        self.fileno, self.shutdown = self.socket.fileno, self.socket.close
        self.send(2)

    def send(self, frames: int, data: bytes = b"") -> None:
        for _ in range(frames):
            self.socket.sendto(data, self.socket.getsockname())

    def recv(self, _: float) -> can.Message | None:
        try:
            data = self.socket.recv(1 << 16, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None
        return can.Message(arbitration_id=0x100, data=data[:8], is_extended_id=False)


@pytest.mark.parametrize(
    ("address", "options"),
    [
        ((socket.AF_INET, "127.0.0.1"), [(socket.IPPROTO_IP, 49)]),
        ((socket.AF_INET6, "::1"), [(socket.IPPROTO_IP, 49), (socket.IPPROTO_IPV6, 29)]),
    ],
    ids=["IPv4", "IPv6"],
)
def test_frames_of_other_multicast_groups_are_refused(
    address: tuple[socket.AddressFamily, str], options: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By IP_MULTICAST_ALL and IPV6_MULTICAST_ALL: else a socket gets what any program on the computer has joined."""
    bus = GroupBus(*address)
    assert bus.socket.getsockopt(*options[-1]) == 1
    monkeypatch.setattr("observer_rt.bus.links.opening.find_spec", lambda _: "there")
    monkeypatch.setattr(can, "Bus", lambda **_: bus)
    with open_link("udp_multicast", "239.74.163.2", True) as link:
        assert [bus.socket.getsockopt(*option) for option in options] == [0] * len(options)
        assert link.receive(0.0) is None


def test_frames_without_room_in_the_receive_buffer_are_dropped_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless nobody reads the link; those of a socket before a reconnection stay counted."""
    sent, buses = 200, list[GroupBus]()

    def open_bus(**_: object) -> GroupBus:
        buses.append(GroupBus())
        return buses[-1]

    monkeypatch.setattr("observer_rt.bus.links.receive_buffer.RECEIVE_BUFFER_BYTES", 1 << 20)
    monkeypatch.setattr("observer_rt.bus.links.opening.find_spec", lambda _: "there")
    monkeypatch.setattr(can, "Bus", open_bus)
    with (
        open_link("udp_multicast", "239.74.163.2", True) as link,
        open_link("udp_multicast", "0", True, []) as sender,
    ):
        lost = 0
        for _ in range(2):
            buses[-1 if lost else 0].send(sent, bytes(50_000))
            came = sum(1 for _ in iter(lambda: link.receive(0.0), None))
            lost += sent - came
            assert 20 < came < sent  # far more than by the usual buffer
            assert link.dropped == lost
            link.reconnect()
        buses[1].send(sent, bytes(50_000))
        sender.receive(0.0)
        assert sender.dropped == 0


def test_own_frames_that_come_back_are_no_other_senders(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on interfaces that give every frame to all, its sender among them; equal ones of another node count."""
    bus_of = can.Bus
    monkeypatch.setattr(can, "Bus", lambda **options: bus_of(**options, receive_own_messages=True))
    with receiver_of(channel, [(0x200, False)]) as link:
        for payload in (b"a", b"b", b"a"):
            link.send(0x200, payload, False, True)
        assert link.try_send(0x200, b"c", False, True)
        with bus_of(interface="virtual", channel=channel) as other:
            other.send(can.Message(arbitration_id=0x200, data=b"a", is_extended_id=False, is_fd=True))
            other.send(can.Message(arbitration_id=0x200, data=b"d", is_extended_id=False, is_fd=True))
        received = [link.receive(1.0), link.receive(1.0), link.receive(0.0)]
    assert [frame and frame.payload for frame in received] == [b"a", b"d", None]
