"""Findings about the machine: real-time rights, memory, processors, compiled code."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from observer_rt.check.findings import Finding, Level, graded
from observer_rt.foundation.compilation import CompiledCode
from observer_rt.service.processors import REMEDY, Processors, processors
from observer_rt.service.rights import PRIORITY, Rights, rights

PROCESSORS = 2  # one for the loop, one for learning


@dataclass(frozen=True)
class Host:
    """What the machine grants this process."""

    rights: Rights
    swap_in_use: bool
    processors: int
    loops: Processors


def this_host(cpus: Sequence[int] | None = None, loops: int = 1) -> Host:
    """The machine this runs on; cpus: asked for by the bench file, for so many loops."""
    swaps = Path("/proc/swaps")
    return Host(
        rights=rights(),
        swap_in_use=swaps.exists() and len(swaps.read_text().splitlines()) > 1,  # the first line is a heading
        processors=len(os.sched_getaffinity(0)),
        loops=processors(cpus, loops),
    )


def compiled_code_findings(code: CompiledCode) -> list[Finding]:
    """Whether what is compiled once is still there at the next start."""
    text = code.trouble or f"kept in {code.folder}"
    return [graded("compiled code", not code.trouble, text, code.remedy)]


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
        graded(topic, False, host.loops.trouble, REMEDY)
        if host.loops.trouble
        else Finding(topic, Level.OK, host.loops.as_text()),
    ]
