"""What `check` says of the machine: its rights, and a SocketCAN interface, from what the kernel tells."""

import errno
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from observer_rt.config.bench_file import LinkConfig
from observer_rt.daemon.rights import Processors, Rights
from observer_rt.desk.check import machine
from observer_rt.desk.check.findings import Finding, Level

Network = Callable[..., Path]


@pytest.fixture
def network(tmp_path: Path) -> Network:
    """A folder as the kernel shows interfaces, with can0 in it."""

    def make(**changes: str) -> Path:
        folder = tmp_path / "net" / "can0"
        folder.mkdir(parents=True, exist_ok=True)
        entries = {"type": "280", "flags": "0x40041", "mtu": "72", "tx_queue_len": "1000", "operstate": "up"}
        for name, content in (entries | changes).items():
            (folder / name).write_text(content + "\n")
        return folder.parent

    return make


def assert_odd(findings: list[Finding], *words: str) -> None:
    """One of them is a warning of these words; without words none is."""
    odd = [finding for finding in findings if finding.level is not Level.OK]
    assert [finding.level for finding in odd] == [Level.WARNING] * bool(words)
    assert all(word in finding.text for word in words for finding in odd)


@pytest.mark.parametrize(
    ("changes", "fd", "command"),
    [
        ({}, True, None),
        ({"operstate": "unknown"}, True, None),  # of a virtual one, which has no carrier to report
        ({"mtu": "16"}, False, None),
        ({"mtu": "16"}, True, "sudo ip link set can0 down && sudo ip link set can0 up type can"),
        ({"flags": "0x40040", "operstate": "down"}, True, "up type can bitrate 500000 dbitrate 5000000 fd on"),
        ({"operstate": "down"}, True, "sudo ip link set can0 up"),
        ({"tx_queue_len": "10"}, True, "sudo ip link set can0 txqueuelen 1000"),
        ({"type": "1"}, True, "set link.channel"),
    ],
)
def test_an_interface_that_is_ready_or_to_be_mended(
    network: Network, changes: dict[str, str], fd: bool, command: str | None
) -> None:
    findings = machine.interface_findings(LinkConfig(channel="can0", fd=fd), network=network(**changes))
    assert findings
    assert_odd(findings, *([command] if command else []))


@pytest.mark.parametrize(("channel", "remedy"), [("vcan7", "ip link add vcan7 type vcan"), ("can7", "driver")])
def test_an_interface_that_is_missing(network: Network, channel: str, remedy: str) -> None:
    assert_odd(machine.interface_findings(LinkConfig(channel=channel), network=network()), remedy)


@pytest.mark.vcan
def test_a_real_virtual_interface(vcan: str) -> None:
    findings = machine.interface_findings(LinkConfig(channel=vcan))
    assert [finding.text for finding in findings] == [
        f"{vcan}: up",
        f"{vcan}: mtu 72, CAN FD",
        f"{vcan}: queue of 1000 frames to send",
    ]
    assert {finding.level for finding in findings} == {Level.OK}


GRANTED = Rights(may_hurry=True, may_lock_memory=True, priority=50)
GOOD: dict[str, Any] = {"granted": GRANTED, "swap_in_use": False, "cores": 4, "loops": Processors()}


@pytest.mark.parametrize(
    ("changes", "remedy"),
    [
        ({}, None),
        ({"granted": Rights(may_hurry=False, may_lock_memory=True, priority=50)}, "--rtprio=99"),
        ({"granted": Rights(may_hurry=True, may_lock_memory=False, priority=50)}, "--memlock=unlimited"),
        ({"granted": Rights(may_hurry=False, may_lock_memory=True, priority=0)}, None),
        ({"swap_in_use": True}, "sudo swapoff"),
        ({"cores": 1}, "taskset"),
        ({"loops": Processors(refused=(9,))}, "cpuset"),
    ],
)
def test_a_machine_that_may_keep_up_or_not(changes: dict[str, Any], remedy: str | None) -> None:
    findings = machine.real_time_findings(**(GOOD | changes))
    assert len(findings) == 5
    assert_odd(findings, *([remedy] if remedy else []))


def test_a_kernel_without_can_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    unsupported = OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")
    monkeypatch.setattr(socket, "socket", Mock(side_effect=unsupported))
    (finding,) = machine.socketcan_findings()
    assert finding.level is Level.WARNING
    assert "no SocketCAN" in finding.text
    assert "sudo modprobe can_raw" in finding.text
    assert 'interface = "udp_multicast"' in finding.text


def test_a_driver_that_cannot_be_used_here_and_who_else_hears_a_group(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "msgpack", None)
    missing, others = machine.driver_findings(LinkConfig(interface="udp_multicast", channel="239.74.163.2"))
    assert (missing.level, others.level) == (Level.WARNING, Level.OK)
    assert missing.text == "udp_multicast cannot be used on this computer; pip install msgpack"
    assert "may hear all groups" in others.text
