"""Findings about the machine: real-time rights, memory, processors."""

import os
from dataclasses import dataclass
from pathlib import Path

from observer_rt.check.findings import Finding, graded
from observer_rt.service.rights import PRIORITY, Rights, rights

PROCESSORS = 2  # one for the loop, one for learning


@dataclass(frozen=True)
class Host:
    """What the machine grants this process."""

    rights: Rights
    swap_in_use: bool
    processors: int


def this_host() -> Host:
    """The machine this runs on."""
    swaps = Path("/proc/swaps")
    return Host(
        rights=rights(),
        swap_in_use=swaps.exists() and len(swaps.read_text().splitlines()) > 1,  # the first line is a heading
        processors=len(os.sched_getaffinity(0)),
    )


def real_time_findings(host: Host) -> list[Finding]:
    """Whether the loop can be expected to keep up."""
    topic = "real time"
    return [
        graded(
            topic,
            host.rights.may_hurry,
            f"the loop gets real-time priority {PRIORITY}"
            if host.rights.may_hurry
            else "no real-time priority allowed",
            "in this shell: sudo prlimit --pid $$ --rtprio=99",
        ),
        graded(
            topic,
            host.rights.may_lock_memory,
            "memory is locked" if host.rights.may_lock_memory else "memory may not be locked",
            "in this shell: sudo prlimit --pid $$ --memlock=unlimited",
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
