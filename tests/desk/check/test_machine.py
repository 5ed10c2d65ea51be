"""What `check` says of the machine: its rights, and a SocketCAN interface, from what the kernel tells."""

import errno
import json
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from observer_rt.config.bench_file import LinkConfig
from observer_rt.daemon.rights import Processors, Rights
from observer_rt.desk.check.findings import Finding, Level
from observer_rt.desk.check.machine import (
    Controller,
    Host,
    controller_in,
    interface_findings,
    read_controller,
    real_time_findings,
    socketcan_findings,
)

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
        (
            {"flags": "0x40040", "operstate": "down"},
            True,
            "up type can bitrate 500000 dbitrate 5000000 fd on",
        ),
        ({"operstate": "down"}, True, "sudo ip link set can0 up"),
        ({"tx_queue_len": "10"}, True, "sudo ip link set can0 txqueuelen 1000"),
        ({"type": "1"}, True, "set link.channel"),
    ],
)
def test_an_interface_that_is_ready_or_to_be_mended(
    network: Network, changes: dict[str, str], fd: bool, command: str | None
) -> None:
    findings = interface_findings(LinkConfig(channel="can0", fd=fd), network=network(**changes))
    assert findings
    assert_odd(findings, *([command] if command else []))


@pytest.mark.parametrize(
    ("channel", "remedy"), [("vcan7", "ip link add vcan7 type vcan"), ("can7", "driver")]
)
def test_an_interface_that_is_missing(network: Network, channel: str, remedy: str) -> None:
    assert_odd(interface_findings(LinkConfig(channel=channel), network=network()), remedy)


ANSWER: dict[str, Any] = {
    "ifname": "can0",
    "flags": ["NOARP", "UP", "LOWER_UP", "ECHO"],
    "linkinfo": {
        "info_kind": "can",
        "info_data": {
            "ctrlmode": ["FD"],
            "state": "ERROR-ACTIVE",
            "restart_ms": 100,
            "bittiming": {"bitrate": 500000, "sample_point": "0.875", "tq": 25, "sjw": 1, "brp": 1},
            "data_bittiming": {"bitrate": 5000000, "sample_point": "0.750", "tq": 25, "sjw": 1, "brp": 1},
        },
    },
}
GOOD = Controller("ERROR-ACTIVE", 500_000, 5_000_000, 100, ("FD",))


def answer(**changes: Any) -> str:
    """As iproute2 answers, with other details."""
    content = ANSWER["linkinfo"]["info_data"] | changes
    linkinfo = ANSWER["linkinfo"] | {"info_data": {k: v for k, v in content.items() if v is not None}}
    return json.dumps([ANSWER | {"linkinfo": linkinfo}])


def test_a_controller_is_read() -> None:
    assert controller_in(answer()) == GOOD


@pytest.mark.parametrize(
    ("changes", "rates"),
    [
        ({"data_bittiming": None}, (500_000, None)),  # classic
        ({"bittiming": {"bitrate": 0, "sample_point": "0.000"}}, (None, 5_000_000)),  # not set up yet
    ],
)
def test_bit_rates_that_there_are_not(changes: dict[str, Any], rates: tuple[int | None, int | None]) -> None:
    controller = controller_in(answer(**changes))
    assert controller is not None
    assert (controller.bit_rate, controller.data_bit_rate) == rates


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            "[]",
            "{}",
            "7",
            '[{"linkinfo": 3}]',
            json.dumps([ANSWER | {"linkinfo": {"info_kind": "vcan"}}]),
        ),
        *(
            answer(bittiming=3),
            answer(restart_ms="soon"),
            answer(bittiming={"bitrate": 1e400}),
            answer(ctrlmode=3),
        ),
    ],
)
def test_what_is_no_answer_tells_nothing(text: str) -> None:
    """Of a virtual interface, or of an iproute2 that writes otherwise."""
    assert controller_in(text) is None


def test_an_interface_that_is_not_there_has_no_controller() -> None:
    assert read_controller("no-such-one") is None


def test_a_computer_without_iproute2(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert read_controller("lo") is None


def of_controller(network: Network, controller: Controller) -> list[Finding]:
    return interface_findings(LinkConfig(channel="can0"), controller, network())


def test_a_controller_that_is_set_up_well(network: Network) -> None:
    findings = of_controller(network, GOOD)
    assert {finding.level for finding in findings} == {Level.OK}
    text = "\n".join(finding.text for finding in findings)
    assert "bit rate 500000 bit/s" in text
    assert "data bit rate 5000000 bit/s" in text
    assert "restart-ms 100" in text


@pytest.mark.parametrize(
    ("changes", "said", "command"),
    [
        ({"restart_ms": 0}, "after bus-off it stays off", "up type can restart-ms 100"),
        ({"bit_rate": 250_000}, "bit rate 250000", "bitrate 500000 dbitrate 5000000"),
        ({"data_bit_rate": 2_000_000}, "data bit rate 2000000", "set link.data_bit_rate"),
        ({"state": "BUS-OFF"}, "bus-off", "sudo ip link set can0 type can restart"),
        ({"state": "ERROR-PASSIVE"}, "error-passive", "termination"),
        ({"modes": ("LISTEN-ONLY", "FD")}, "nobody will hear", "listen-only off"),
    ],
)
def test_a_controller_to_be_set_up_otherwise(
    network: Network, changes: dict[str, Any], said: str, command: str
) -> None:
    controller = replace(GOOD, **changes)
    assert_odd(of_controller(network, controller), said, command)
    if "data_bit_rate" in changes:  # which does not matter on a classic link
        assert_odd(interface_findings(LinkConfig(channel="can0", fd=False), controller, network()))


def test_a_controller_that_is_off_is_not_called_down(network: Network) -> None:
    off = replace(GOOD, state="BUS-OFF")
    findings = interface_findings(LinkConfig(channel="can0"), off, network(operstate="down"))
    assert [f.text for f in findings if f.level is not Level.OK and "bus-off" not in f.text] == []


@pytest.mark.vcan
def test_a_real_virtual_interface(vcan: str) -> None:
    """The kernel's own folder and iproute2's own answer."""
    findings = interface_findings(LinkConfig(channel=vcan), read_controller(vcan))
    assert [finding.text for finding in findings] == [
        f"{vcan}: up",
        f"{vcan}: mtu 72, CAN FD",
        f"{vcan}: queue of 1000 frames to send",
    ]
    assert {finding.level for finding in findings} == {Level.OK}


GOOD_HOST = Host(
    Rights(may_hurry=True, may_lock_memory=True, priority=50),
    swap_in_use=False,
    processors=4,
    loops=Processors(),
)


@pytest.mark.parametrize(
    ("changes", "remedy"),
    [
        ({}, None),
        ({"rights": Rights(may_hurry=False, may_lock_memory=True, priority=50)}, "--rtprio=99"),
        ({"rights": Rights(may_hurry=True, may_lock_memory=False, priority=50)}, "--memlock=unlimited"),
        ({"rights": Rights(may_hurry=False, may_lock_memory=True, priority=0)}, None),
        ({"swap_in_use": True}, "sudo swapoff"),
        ({"processors": 1}, "taskset"),
        ({"loops": Processors(refused=(9,))}, "cpuset"),
    ],
)
def test_a_machine_that_may_keep_up_or_not(changes: dict[str, Any], remedy: str | None) -> None:
    findings = real_time_findings(replace(GOOD_HOST, **changes))
    assert len(findings) == 5
    assert_odd(findings, *([remedy] if remedy else []))


def test_a_kernel_without_can_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", refuse)
    (finding,) = socketcan_findings()
    assert finding.level is Level.WARNING
    assert "no SocketCAN" in finding.text
    assert "sudo modprobe can_raw" in finding.text
    assert 'interface = "udp_multicast"' in finding.text
