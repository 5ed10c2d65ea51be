"""What keeps other programs, and this one's own Python, from delaying the loop: used where Linux grants it."""

import contextlib
import ctypes
import os
import resource
import threading
from dataclasses import dataclass, replace
from pathlib import Path

PRIORITY = 50  # of SCHED_FIFO, that of the kernel's own interrupt threads
_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4  # mlockall(2)
_PR_SET_TIMERSLACK = 29
_CAP_IPC_LOCK = 1 << 14


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
    """Of this process, whose limits are raised as far as they can be."""
    granted: list[bool] = []
    trial = threading.Thread(
        target=lambda: granted.append(hurry())
    )  # limits do not tell what a sandbox forbids
    trial.start()
    trial.join()
    _raise_limit(resource.RLIMIT_MEMLOCK)
    memory, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    is_unlimited = memory == resource.RLIM_INFINITY or bool(_effective_capabilities() & _CAP_IPC_LOCK)
    return Rights(any(granted), is_unlimited)


def lock_memory(granted: Rights) -> Rights:
    """Keep what is touched from now on in memory; what was granted then."""
    if not granted.may_lock_memory:
        return granted
    failed = ctypes.CDLL(None).mlockall(_CURRENT | _FUTURE | _ON_FAULT)
    return replace(granted, may_lock_memory=not failed)


def hurry(processor: int | None = None) -> bool:
    """Put the calling thread before all that has no real-time priority, and wake it on time; whether it was.

    processor: that it is to stay on, if it still may.
    """
    if processor is not None:
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, {processor})
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    _raise_limit(resource.RLIMIT_RTPRIO)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        return False
    return True


def take_time() -> None:
    """Put the calling thread behind all that hurries, whatever the process was started with."""
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _raise_limit(which: int) -> None:
    """The soft limit to the hard one."""
    _, most = resource.getrlimit(which)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(which, (most, most))


def _effective_capabilities() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0
