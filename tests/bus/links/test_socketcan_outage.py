"""A SocketCAN interface that goes down or away and comes back."""

import subprocess
import time

import pytest

from observer_rt.bus.links import socketcan as socketcan_link
from observer_rt.bus.links.link import Frame, Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from tests.interface import OwnInterface

pytestmark = pytest.mark.vcan


def link_on(interface: OwnInterface, receive_ids: list[tuple[int, bool]] | None = None) -> Link:
    return open_link("socketcan", interface.name, True, receive_ids)


def first_failure(link: Link) -> str:
    """What `receive` raises before long."""
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
    with link_on(own_interface, []) as sender, link_on(own_interface) as receiver:
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
    with link_on(own_interface, []) as sender, link_on(own_interface, [(0x100, False)]) as receiver:
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
    with link_on(own_interface) as link:
        own_interface.down()
        first_failure(link)
        subprocess.run(["ip", "link", "set", own_interface.name, "mtu", "16"], check=True)
        with pytest.raises(LinkDownError, match="mtu is 16"):
            link.reconnect()
        subprocess.run(["ip", "link", "set", own_interface.name, "mtu", "72"], check=True)
        own_interface.up()
        link.reconnect()
        assert link.receive(0.0) is None


def test_what_was_lost_before_still_counts(
    own_interface: OwnInterface, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(socketcan_link, "RECEIVE_BUFFER_BYTES", 4096)
    with link_on(own_interface, []) as sender, link_on(own_interface) as receiver:
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
