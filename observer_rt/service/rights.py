"""What keeps other programs, and this one's own Python, from delaying the loop: used where Linux grants it."""

import ctypes
import os
import resource
from dataclasses import dataclass
from pathlib import Path

PRIORITY = 50  # of SCHED_FIFO, that of the kernel's own interrupt threads
_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4  # mlockall(2)
_PR_SET_TIMERSLACK = 29
_CAP_SYS_NICE, _CAP_IPC_LOCK = 1 << 23, 1 << 14


@dataclass(frozen=True)
class Rights:
    """What this process may ask for, or has."""

    may_hurry: bool
    """Real-time priority."""
    may_lock_memory: bool
    """Pages once touched stay in memory."""

    def as_text(self) -> str:
        """In a few words."""
        priority = f"priority {PRIORITY} for the loop" if self.may_hurry else "no real-time priority"
        memory = "memory locked" if self.may_lock_memory else "memory not locked"
        return f"real time: {priority}, {memory}"


def rights() -> Rights:
    """Of this process. It may raise a soft limit to the hard one."""
    capabilities = _effective_capabilities()
    _, priority = resource.getrlimit(resource.RLIMIT_RTPRIO)
    _, memory = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    return Rights(
        may_hurry=priority == resource.RLIM_INFINITY
        or priority >= PRIORITY
        or bool(capabilities & _CAP_SYS_NICE),
        may_lock_memory=memory == resource.RLIM_INFINITY or bool(capabilities & _CAP_IPC_LOCK),
    )


def lock_memory(granted: Rights) -> None:
    """Keep what is touched from now on in memory."""
    if granted.may_lock_memory:
        limits = resource.getrlimit(resource.RLIMIT_MEMLOCK)
        resource.setrlimit(resource.RLIMIT_MEMLOCK, (limits[1], limits[1]))
        ctypes.CDLL(None, use_errno=True).mlockall(_CURRENT | _FUTURE | _ON_FAULT)


def hurry() -> None:
    """Put the calling thread before all that has no real-time priority, and wake it on time; where granted."""
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if rights().may_hurry:
        limits = resource.getrlimit(resource.RLIMIT_RTPRIO)
        resource.setrlimit(resource.RLIMIT_RTPRIO, (limits[1], limits[1]))
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


def take_time() -> None:
    """Put the calling thread behind all that hurries, whatever the process was started with."""
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _effective_capabilities() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0
