"""Sending faster than an interface carries: the kernel itself refuses frames, and none is lost or sent twice."""

import errno
import socket
import time
from collections import Counter
from typing import Any

import pytest

from observer_rt.bus.links.link import Link
from observer_rt.bus.links.opening import open_link
from observer_rt.foundation.errors import RunError
from tests.interface import FRAME_BYTES, OwnInterface

pytestmark = pytest.mark.vcan

RATE = 2000  # frames/s
QUEUE = 20  # frames
LONG_QUEUE = 1000  # frames, more than a socket's own buffer holds
FULL = pytest.mark.parametrize(
    ("queue", "send_buffer", "error"),
    [(QUEUE, None, "ENOBUFS"), (LONG_QUEUE, 1, "EAGAIN")],
    ids=["of the interface", "of the socket"],
)


def note_refusals(monkeypatch: pytest.MonkeyPatch, send_buffer: int | None = None) -> Counter[str]:
    """Names of errors of sending from now on, and how often; send_buffer: bytes of new sockets, None: the usual."""
    refusals: Counter[str] = Counter()

    class Noting(socket.socket):
        def bind(self, address: Any) -> None:
            super().bind(address)
            if send_buffer is not None:
                self.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, send_buffer)

        def send(self, data: bytes, flags: int = 0) -> int:  # type: ignore[override]
            try:
                return super().send(data, flags)
            except OSError as error:
                refusals[errno.errorcode[error.errno or 0]] += 1
                raise

    monkeypatch.setattr(socket, "socket", Noting)
    return refusals


def links(interface: OwnInterface, queue: int = QUEUE, rate: int = RATE) -> tuple[Link, Link]:
    interface.slow_down(rate * FRAME_BYTES, queue * FRAME_BYTES)
    return (open_link("socketcan", interface.name, True, []), open_link("socketcan", interface.name, True))


def numbers(receiver: Link) -> list[int]:
    return [int.from_bytes(frame.payload[:4], "little") for frame in iter(lambda: receiver.receive(0.05), None)]


def payload(number: int) -> bytes:
    return number.to_bytes(4, "little") + bytes(60)


@FULL
def test_what_is_refused_is_told_and_not_sent_unless_one_waits(
    own_interface: OwnInterface, monkeypatch: pytest.MonkeyPatch, queue: int, send_buffer: int, error: str
) -> None:
    refusals = note_refusals(monkeypatch, send_buffer)
    sender, receiver = links(own_interface, queue)
    with sender, receiver:
        taken = [n for n in range(300) if sender.try_send(0x100, payload(n), False, True)]
        assert 0 < len(taken) < 300
        assert (set(refusals), refusals[error]) == ({error}, 300 - len(taken))
        assert numbers(receiver) == taken
        time.sleep(2 * QUEUE / RATE)
        refusals.clear()
        start = time.monotonic()
        for number in range(400):
            sender.send(0x100, payload(number), False, True)  # which waits for room
        assert time.monotonic() - start > 0.5 * (400 - 2 * QUEUE) / RATE
        assert refusals[error] > 0
        assert numbers(receiver) == list(range(400))


def test_a_queue_that_stays_full_is_reported(own_interface: OwnInterface) -> None:
    sender, receiver = links(own_interface, rate=1)
    with sender, receiver:
        while sender.try_send(0x100, payload(0), False, True):
            pass
        with pytest.raises(RunError, match=r"vcan9 stayed full for 0.5 s\n.*txqueuelen 1000"):
            sender.send(0x100, payload(1), False, True)
