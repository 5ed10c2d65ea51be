"""Findings about the machine: real-time rights, memory, processors."""

import os
import resource
from dataclasses import dataclass
from pathlib import Path

from observer_rt.check.findings import Finding, graded

PROCESSORS = 2  # one for the loop, one for learning
_CAP_SYS_NICE = 1 << 23


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


def _effective_capabilities() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0
