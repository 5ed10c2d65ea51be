"""Raw SocketCAN links on a real vcan0, and on an interface that goes down or away and comes back."""

import errno
import socket
import struct
import subprocess
import time

import pytest

from observer_rt.bus.links import receive_buffer
from observer_rt.bus.links.controller import BusCondition, BusState
from observer_rt.bus.links.link import Frame, Link, LinkDownError, StampSource
from observer_rt.bus.links.opening import open_link
from observer_rt.foundation.errors import RunError
from tests.interface import OwnInterface

pytestmark = pytest.mark.vcan


def link_on(channel: str, receive_ids: list[tuple[int, bool]] | None = None, *, fd: bool = True) -> Link:
    return open_link("socketcan", channel, fd, receive_ids)


def test_a_link_without_fd_receives_classic_frames_only(vcan: str) -> None:
    with link_on(vcan, []) as sender, link_on(vcan, fd=False) as classic:
        sender.send(0x100, bytes(64), False, True)
        sender.send(0x101, bytes(8), False, False)
        frame = classic.receive(1.0)
        assert frame is not None
        assert (frame.frame_id, frame.is_fd) == (0x101, False)
        assert classic.stamp_source is StampSource.KERNEL
        with pytest.raises(RunError, match=r"link\.fd = true"):
            classic.send(0x100, bytes(64), False, True)


def test_the_receive_buffer_holds_a_second_of_traffic(vcan: str) -> None:
    with link_on(vcan, []) as sender, link_on(vcan) as receiver:
        for n in range(5_000):
            sender.send(0x100, struct.pack("<I60x", n), False, True)
        numbers = [struct.unpack_from("<I", f.payload)[0] for f in iter(lambda: receiver.receive(0.05), None)]
        assert (numbers, receiver.dropped) == (list(range(5_000)), 0)


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
            driver.send(struct.pack("=IB3x8s", socket.CAN_ERR_FLAG | kind, 8, data))
            assert link.receive(0.05) is None
            return link.condition

        assert link.condition == BusCondition()
        assert tell(controller, passive).state is BusState.PASSIVE
        assert tell(bus_off).state is BusState.OFF
        condition = tell(restarted)
        assert condition.state is BusState.ACTIVE
        assert (condition.passives, condition.bus_offs, condition.restarts) == (1, 1, 1)
        assert tell(not_acknowledged) == condition  # one for every frame nobody hears would be too many
        assert link.dropped == 0
        assert tell(controller, overrun).overruns == link.dropped == 1


def test_a_missing_interface_is_named_with_those_present(vcan: str) -> None:
    with pytest.raises(RunError, match=rf"no interface nocan9 .*{vcan}.*\n.*ip link add dev nocan9"):
        link_on("nocan9")
    with pytest.raises(RunError, match="no interface nocan9"):
        link_on("nocan9", fd=False)


@pytest.mark.parametrize(
    ("number", "said"),
    [(errno.ENETDOWN, r"vcan0 is down\n.*ip link set vcan0 up"), (errno.ENXIO, "no interface vcan0")],
)
def test_a_lost_interface_has_a_remedy(vcan: str, monkeypatch: pytest.MonkeyPatch, number: int, said: str) -> None:
    def fail(*_: object) -> None:
        raise OSError(number, "as arranged")

    class FailingSocket(socket.socket):
        send = recvmsg = fail  # type: ignore[assignment]

    monkeypatch.setattr(socket, "socket", FailingSocket)
    with link_on(vcan) as link:
        with pytest.raises(RunError, match=said):
            link.receive(0.0)
        with pytest.raises(RunError, match=said):
            link.send(0x100, b"", False, True)


def first_failure(link: Link) -> str:
    try:
        for _ in range(100):
            link.receive(0.01)
    except LinkDownError as error:
        return str(error)
    pytest.fail("the link did not notice")


def passes(sender: Link, receiver: Link, payload: bytes) -> None:
    before = time.time_ns()
    sender.send(0x100, payload, False, True)
    frame = receiver.receive(1.0)
    assert frame is not None
    assert frame == Frame(0x100, payload, frame.stamp_ns, bit_rate_switch=True)
    assert before <= frame.stamp_ns <= time.time_ns()


def test_down_and_up_again(own_interface: OwnInterface) -> None:
    with link_on(own_interface.name, []) as sender, link_on(own_interface.name) as receiver:
        passes(sender, receiver, b"before")
        own_interface.down()
        said = first_failure(receiver)
        assert f"{own_interface.name} is down" in said
        assert f"sudo ip link set {own_interface.name} up" in said
        assert f"{own_interface.name} is down" in first_failure(sender)
        with pytest.raises(LinkDownError, match="is down"):
            sender.send(0x100, b"during", False, True)
        for link in (sender, receiver):
            with pytest.raises(LinkDownError, match="is down"):
                link.reconnect()
        own_interface.up()
        for link in (sender, receiver):
            link.reconnect()
        passes(sender, receiver, b"after")


def test_unplugged_and_back_as_another_device(own_interface: OwnInterface) -> None:
    with link_on(own_interface.name, []) as sender, link_on(own_interface.name, [(0x100, False)]) as receiver:
        own_interface.remove()
        assert f"no interface {own_interface.name}" in first_failure(receiver)
        with pytest.raises(LinkDownError, match="no interface"):
            receiver.reconnect()
        own_interface.add()
        for link in (sender, receiver):
            link.reconnect()
        sender.send(0x101, b"unwanted", False, True)
        passes(sender, receiver, b"wanted")


def test_back_but_not_configured_yet(own_interface: OwnInterface) -> None:
    """As after plugging in: classic, and not up."""
    with link_on(own_interface.name) as link:
        own_interface.down()
        first_failure(link)
        subprocess.run(["ip", "link", "set", own_interface.name, "mtu", "16"], check=True)
        with pytest.raises(LinkDownError, match="mtu is 16"):
            link.reconnect()
        subprocess.run(["ip", "link", "set", own_interface.name, "mtu", "72"], check=True)
        own_interface.up()
        link.reconnect()
        assert link.receive(0.0) is None


def test_what_was_lost_before_still_counts(own_interface: OwnInterface, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(receive_buffer, "RECEIVE_BUFFER_BYTES", 4096)
    with link_on(own_interface.name, []) as sender, link_on(own_interface.name) as receiver:
        lost = 0
        for _ in range(2):
            for _ in range(200):
                sender.send(0x100, bytes(64), False, True)
            lost += 200 - sum(1 for _ in iter(lambda: receiver.receive(0.05), None))
            passes(sender, receiver, b"the count comes with the next frame")
            assert receiver.dropped == lost > 0
            own_interface.down()
            own_interface.up()
            first_failure(receiver)
            receiver.reconnect()
            sender.reconnect()
            assert receiver.dropped == lost
