"""The receive buffer of a socket, on the loopback interface: what the kernel grants, and what it had no room for."""

import socket
from pathlib import Path

import pytest

from observer_rt.bus.links import receive_buffer
from observer_rt.bus.links.receive_buffer import LostFrames, size_receive_buffer


def test_one_smaller_than_wanted_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class UserSocket(socket.socket):
        def setsockopt(self, level: int, option: int, value: int | bytes) -> None:  # type: ignore[override]
            if (level, option) == (socket.SOL_SOCKET, 33):  # SO_RCVBUFFORCE
                raise PermissionError
            super().setsockopt(level, option, value)

    allowed = int(Path("/proc/sys/net/core/rmem_max").read_text())
    with UserSocket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        monkeypatch.setattr(receive_buffer, "RECEIVE_BUFFER_BYTES", allowed)
        assert size_receive_buffer(receiver, "can5", 768) == []
        monkeypatch.setattr(receive_buffer, "RECEIVE_BUFFER_BYTES", 2 * allowed)
        (warning,) = size_receive_buffer(receiver, "can5", 1000)
    assert f"gives can5 a receive buffer for some {2 * allowed // 1000} frames" in warning
    assert f"sysctl --write net.core.rmem_max={2 * allowed}" in warning


def test_the_kernels_count_goes_on_across_its_wrap_and_another_socket() -> None:
    lost = LostFrames()
    lost.begin(2**32 - 3)
    for count in (2**32 - 1, 4):
        lost.note(count)
    assert lost.count == 7
    lost.begin(100)
    lost.note(101)
    assert lost.count == 8
