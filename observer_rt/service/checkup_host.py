"""Findings about the machine: real-time rights, memory, processors, CAN interface. No socket is opened."""

import os
import resource
from dataclasses import dataclass
from pathlib import Path

from observer_rt.config import LinkConfig
from observer_rt.service.findings import Finding, Level, graded

PROCESSORS = 2  # one for the loop, one for learning
SHORTEST_QUEUE = 100  # frames
NETWORK = Path("/sys/class/net")
_CAN_FD_MTU = 72  # bytes
_CAP_SYS_NICE = 1 << 23
_INTERFACE_IS_UP = 1  # IFF_UP
_CAN_INTERFACE = 280  # ARPHRD_CAN


@dataclass(frozen=True)
class Host:
    """What the machine grants this process."""

    may_set_real_time_priority: bool
    swap_in_use: bool
    processors: int


def this_host() -> Host:
    """The machine this runs on."""
    swaps = Path("/proc/swaps")
    return Host(
        # A process may raise its soft limit to the hard one.
        may_set_real_time_priority=any(resource.getrlimit(resource.RLIMIT_RTPRIO))
        or bool(_effective_capabilities() & _CAP_SYS_NICE),
        swap_in_use=swaps.exists() and len(swaps.read_text().splitlines()) > 1,  # the first line is a heading
        processors=len(os.sched_getaffinity(0)),
    )


def real_time_findings(host: Host) -> list[Finding]:
    """Whether the loop can be expected to keep up."""
    topic = "real time"
    return [
        graded(
            topic,
            host.may_set_real_time_priority,
            "real-time priority allowed"
            if host.may_set_real_time_priority
            else "no real-time priority allowed",
            "in this shell: sudo prlimit --pid $$ --rtprio=99",
        ),
        graded(
            topic,
            not host.swap_in_use,
            "swap in use, which can stop the loop for long" if host.swap_in_use else "no swap",
            "sudo swapoff --all",
        ),
        graded(
            topic,
            host.processors >= PROCESSORS,
            f"{host.processors} processor(s)",
            f"loop and learning want {PROCESSORS}: taskset --cpu-list 0-{PROCESSORS - 1} COMMAND, where there are",
        ),
    ]


def interface_findings(link: LinkConfig, network: Path = NETWORK) -> list[Finding]:
    """What the kernel says of a SocketCAN interface in its folder below `network`."""
    topic, name = "interface", link.channel
    folder = network / name
    try:
        kind, flags, mtu, queue = (
            int((folder / entry).read_text(), 0) for entry in ("type", "flags", "mtu", "tx_queue_len")
        )
        state = (folder / "operstate").read_text().strip()
    except OSError:
        return [Finding(topic, Level.WARNING, f"{name} does not exist; {_create(link)}")]
    if kind != _CAN_INTERFACE:
        return [Finding(topic, Level.WARNING, f"{name} is no CAN interface; set link.channel to one")]
    is_up = bool(flags & _INTERFACE_IS_UP) and state != "down"
    findings = [graded(topic, is_up, f"{name}: {'up' if is_up else 'down'}", _bring_up(link))]
    if link.fd:
        findings.append(
            graded(
                topic,
                mtu >= _CAN_FD_MTU,
                f"{name}: mtu {mtu}, {'' if mtu >= _CAN_FD_MTU else 'no '}CAN FD",
                f"sudo ip link set {name} down && {_bring_up(link)}",
            )
        )
    findings.append(
        graded(
            topic,
            queue >= SHORTEST_QUEUE,
            f"{name}: queue of {queue} frames to send",
            f"sudo ip link set {name} txqueuelen {10 * SHORTEST_QUEUE}",
        )
    )
    return findings


def _create(link: LinkConfig) -> str:
    if _is_virtual(link):
        return f"sudo ip link add {link.channel} type vcan && {_bring_up(link)}"
    return "connect the device and load its driver; `ip -details link show type can` lists what there is"


def _bring_up(link: LinkConfig) -> str:
    name = link.channel
    if _is_virtual(link):
        return f"sudo ip link set {name}{f' mtu {_CAN_FD_MTU}' if link.fd else ''} up"
    fd = f" dbitrate {link.data_bit_rate:.0f} fd on" if link.fd else ""
    return f"sudo ip link set {name} up type can bitrate {link.bit_rate:.0f}{fd} restart-ms 100"


def _is_virtual(link: LinkConfig) -> bool:
    return link.channel.startswith("vcan")


def _effective_capabilities() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0
