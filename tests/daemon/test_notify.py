"""What a service manager hears, on a socket of the test's own."""

import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.daemon.log import Notifier


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(5.0)
        yield listening


def environment(manager: socket.socket, **more: str) -> dict[str, str]:
    return {"NOTIFY_SOCKET": str(manager.getsockname()), **more}


def notifications(manager: socket.socket) -> list[str]:
    manager.setblocking(False)
    messages = []
    while True:
        try:
            messages.append(manager.recv(1000).decode())
        except BlockingIOError:
            return messages


def test_what_is_told(manager: socket.socket) -> None:
    notifier = Notifier(environment(manager))
    notifier.ready()
    notifier.status("waiting for can0\n  remedy: plug it in")
    notifier.alive()  # nobody watches
    notifier.stopping()
    assert notifications(manager) == ["READY=1", "STATUS=waiting for can0", "STOPPING=1"]


def test_the_watchdog_is_fed_three_times_in_its_time_out(manager: socket.socket) -> None:
    notifier = Notifier(environment(manager, WATCHDOG_USEC="300000", WATCHDOG_PID=str(os.getpid())))
    end = time.monotonic() + 0.55
    while time.monotonic() < end:
        notifier.alive()
        time.sleep(0.001)
    assert 4 <= len(notifications(manager)) <= 6


def test_a_watchdog_of_another_process_is_not_fed(manager: socket.socket) -> None:
    Notifier(environment(manager, WATCHDOG_USEC="300000", WATCHDOG_PID="1")).alive()
    assert notifications(manager) == []


def test_an_abstract_socket() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        name = f"observer-rt-test-{os.getpid()}"
        listening.bind(f"\0{name}")
        Notifier({"NOTIFY_SOCKET": f"@{name}"}).ready()
        assert listening.recv(100) == b"READY=1"


@pytest.mark.parametrize("settings", [{}, {"NOTIFY_SOCKET": "/nowhere/at/all"}])
def test_without_a_manager_nothing_happens(settings: dict[str, str]) -> None:
    notifier = Notifier(settings)
    notifier.ready()
    notifier.alive()
