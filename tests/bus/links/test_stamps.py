"""Stamps beside received frames: real ones of the loopback interface, and those of an interface with a clock."""

import ctypes
import fcntl
import socket
import struct
import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links import socketcan
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.links.socketcan import ANCILLARY_BYTES, StampReader

SECOND = 1_000_000_000
SO_TIMESTAMPING = 37
ALL_STAMPS = 0b1011101  # capabilities: sent and received, by interface and kernel


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Sender and receiver on the loopback interface; stamps are the same for every kind of socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.connect(receiver.getsockname())
            yield sender, receiver


@pytest.fixture
def with_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(_: socket.socket, request: int, argument: bytes) -> bytes:
        assert request == 0x8946
        name, pointer = struct.unpack("@16sP16x", argument)
        assert name.rstrip(b"\0") == b"lo"
        ctypes.memmove(pointer + 4, struct.pack("=I", ALL_STAMPS), 4)
        return argument

    monkeypatch.setattr(fcntl, "ioctl", answer)


def stamp_of_next(reader: StampReader, receiver: socket.socket) -> int | None:
    _, ancillary, _, _ = receiver.recvmsg(100, ANCILLARY_BYTES)
    if not ancillary:
        return None
    ((level, kind, value),) = ancillary
    assert level == socket.SOL_SOCKET
    return reader.read(kind, value)


def message(by_kernel: int, by_interface: int) -> bytes:
    return struct.pack("@6l", *divmod(by_kernel, SECOND), 0, 0, *divmod(by_interface, SECOND))


def test_the_kernels_stamp_where_the_interface_has_no_clock(pair: tuple[socket.socket, socket.socket]) -> None:
    sender, receiver = pair
    reader = StampReader(receiver, "lo")
    assert not reader.by_hardware
    assert not StampReader(receiver, "no-such-one").by_hardware
    assert reader.read(40, b"\1\0\0\0") is None  # another control message
    before = time.time_ns()
    sender.send(b"x")
    assert before <= (stamp_of_next(reader, receiver) or 0) <= time.time_ns()


@pytest.mark.usefixtures("with_clock")
def test_the_kernels_stamp_for_frames_the_interface_did_not_stamp(pair: tuple[socket.socket, socket.socket]) -> None:
    sender, receiver = pair
    reader = StampReader(receiver, "lo")
    assert reader.by_hardware
    stamp, end = None, time.monotonic() + 5.0
    while stamp is None and time.monotonic() < end:  # the kernel begins to stamp a moment after it was asked to
        before = time.time_ns()
        sender.send(b"x")
        stamp = stamp_of_next(reader, receiver)
    assert before <= (stamp or 0) <= time.time_ns()


@pytest.mark.usefixtures("with_clock")
@given(
    start=st.integers(1, 2**60), steps=st.lists(st.tuples(st.integers(0, SECOND), st.integers(0, 10**7)), min_size=1)
)
def test_the_interfaces_clock_gives_the_distances(start: int, steps: list[tuple[int, int]]) -> None:
    """On the computer's time since the first frame, however late the kernel looked at the others."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        reader = StampReader(receiver, "lo")
    computer, interface = 1_700_000_000 * SECOND + 123, start
    first = reader.read(SO_TIMESTAMPING, message(computer, interface))
    assert first == computer
    for step, late in steps:
        computer, interface = computer + step, interface + step
        assert reader.read(SO_TIMESTAMPING, message(computer + late, interface)) == computer


@pytest.mark.vcan
def test_stamps_of_the_kernel_come_in_the_hardwares_message(vcan: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A virtual interface has no clock: of the three stamps the real control message has the first only."""
    monkeypatch.setattr(socketcan, "_offers_hardware_stamps", lambda *_: True)
    kinds: set[int] = set()
    read = StampReader.read

    def noting(self: StampReader, kind: int, value: bytes) -> int | None:
        kinds.add(kind)
        return read(self, kind, value)

    monkeypatch.setattr(StampReader, "read", noting)
    with open_link("socketcan", vcan, True, []) as sender, open_link("socketcan", vcan, True) as receiver:
        stamps = []
        before = time.time_ns()
        for _ in range(100):
            sender.send(0x100, b"", False, True)
            frame = receiver.receive(1.0)
            assert frame is not None
            stamps.append(frame.stamp_ns)
        after = time.time_ns()
    assert kinds == {SO_TIMESTAMPING}
    assert [before, *stamps, after] == sorted([before, *stamps, after])
    assert len(set(stamps)) > 90  # each its own
