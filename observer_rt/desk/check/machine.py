"""Findings about the machine: real-time rights, memory, processors, its SocketCAN interfaces."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

from observer_rt.bus.can_frame import ARPHRD_CAN, FD_MTU
from observer_rt.bus.links.opening import missing_driver
from observer_rt.bus.links.socketcan import NO_SOCKETCAN
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import LinkConfig
from observer_rt.daemon.rights import REMEDY, Processors, Rights, processors, rights
from observer_rt.desk.check.findings import Finding, Statement, graded, ruled, warning

PROCESSORS = 2  # one for the loop, one for learning
SHORTEST_QUEUE = 100  # frames
NETWORK = Path("/sys/class/net")
_INTERFACE_IS_UP = 1  # IFF_UP
_VIRTUAL = "vcan"  # which the names of such interfaces begin with


def machine_findings(bench: Bench) -> list[Finding]:
    asked, swaps = bench.config.realtime, Path("/proc/swaps")
    findings = real_time_findings(
        rights(asked.priority),
        swap_in_use=swaps.exists() and len(swaps.read_text().splitlines()) > 1,  # the first line is a heading
        cores=len(os.sched_getaffinity(0)),
        loops=processors(asked.cpus, len(bench.injectors)),
    )
    ours = [link for link in bench.config.buses if link.config.interface == "socketcan"]
    findings += socketcan_findings() if ours else []
    for link in bench.config.buses:
        config, location = link.config, link.location
        findings += interface_findings(config, location=location) if link in ours else driver_findings(config)
    return findings


@ruled("real time")
def real_time_findings(granted: Rights, swap_in_use: bool, cores: int, loops: Processors) -> Iterator[Statement]:
    """Whether the loop can be expected to keep up, by what the machine grants this process."""
    here = "in this shell: sudo prlimit --pid $$"
    may, priority = granted.may_hurry, granted.priority
    text = f"the loop gets real-time priority {priority}" if may else "no real-time priority allowed"
    text = text if priority else "no real-time priority asked for"
    yield graded(may or not priority, text, f"{here} --rtprio=99")
    may = granted.may_lock_memory
    yield graded(may, "memory is locked" if may else "memory may not be locked", f"{here} --memlock=unlimited")
    text = "swap in use, which can stop the loop for long" if swap_in_use else "no swap"
    yield graded(not swap_in_use, text, "sudo swapoff --all")
    remedy = f"loop and learning want {PROCESSORS}: taskset --cpu-list 0-{PROCESSORS - 1} COMMAND, where there are"
    yield graded(cores >= PROCESSORS, f"{cores} processor(s)", remedy)
    yield graded(not loops.trouble, loops.trouble or loops.as_text(), REMEDY)


@ruled("interface")
def socketcan_findings() -> Iterator[Statement]:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as error:
        yield warning(f"the kernel offers no SocketCAN: {error.strerror}", NO_SOCKETCAN)


@ruled("interface")
def interface_findings(link: LinkConfig, network: Path = NETWORK, location: str = "link") -> Iterator[Statement]:
    """Findings about the interface with its folder below `network`; location: the section of the bench file."""
    name = link.channel
    folder = network / name
    try:
        kind, flags, mtu, queue = (
            int((folder / entry).read_text(), 0) for entry in ("type", "flags", "mtu", "tx_queue_len")
        )
        state = (folder / "operstate").read_text().strip()
    except OSError:
        remedy = "connect the device and load its driver; `ip -details link show type can` lists what there is"
        if name.startswith(_VIRTUAL):
            remedy = f"sudo ip link add {name} type vcan && {_bring_up(link)}"
        yield warning(f"{name} does not exist", remedy)
        return
    if kind != ARPHRD_CAN:
        yield warning(f"{name} is no CAN interface", f"set {location}.channel to one")
        return
    is_up = bool(flags & _INTERFACE_IS_UP) and state != "down"
    yield graded(is_up, f"{name}: {'up' if is_up else 'down'}", _bring_up(link))
    if link.fd:
        carries_fd = mtu >= FD_MTU
        anew = f"sudo ip link set {name} down && {_bring_up(link)}"
        yield graded(carries_fd, f"{name}: mtu {mtu}, {'' if carries_fd else 'no '}CAN FD", anew)
    longer = f"sudo ip link set {name} txqueuelen {10 * SHORTEST_QUEUE}"
    yield graded(queue >= SHORTEST_QUEUE, f"{name}: queue of {queue} frames to send", longer)


@ruled("interface")
def driver_findings(link: LinkConfig) -> Iterator[Statement]:
    """Whether python-can's driver of an interface is there, and who else is heard."""
    if remedy := missing_driver(link.interface):
        yield warning(f"{link.interface} cannot be used on this computer", remedy)
    if link.interface == "udp_multicast":
        yield (
            f"{link.channel}: frames of other groups do not come in; programs of this computer may hear all groups, "
            "and everybody in this network may send to this one"
        )


def _bring_up(link: LinkConfig) -> str:
    name = link.channel
    if name.startswith(_VIRTUAL):
        return f"sudo ip link set {name}{f' mtu {FD_MTU}' if link.fd else ''} up"
    fd = f" dbitrate {link.data_bit_rate:.0f} fd on" if link.fd else ""
    restart = "restart-ms 100 (leave that out where the adapter refuses it, for want of an automatic restart)"
    return f"sudo ip link set {name} up type can bitrate {link.bit_rate:.0f}{fd} {restart}"
