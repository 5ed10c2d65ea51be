"""Processors and real-time rights that Linux grants, so that neither other programs nor Python delay the loop."""

import ctypes
import os
import resource
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4  # mlockall(2)
_PR_SET_TIMERSLACK = 29
_CAP_IPC_LOCK = 1 << 14
_ISOLATED = Path("/sys/devices/system/cpu/isolated")
_T = TypeVar("_T")
REMEDY = "name others; `cat /sys/fs/cgroup/cpuset.cpus.effective` shows which there are"


@dataclass(frozen=True)
class Rights:
    """Rights that this process may ask for, or has."""

    may_hurry: bool
    """Real-time priority."""
    may_lock_memory: bool
    """Pages once touched stay in memory."""
    priority: int
    """Real-time priority that is asked for; 0: none."""

    def as_text(self) -> str:
        """Describes them in a few words."""
        priority = f"priority {self.priority} for the loop" if self.may_hurry else "no real-time priority"
        memory = "memory locked" if self.may_lock_memory else "memory not locked"
        return f"real time: {priority}, {memory}"


def rights(priority: int) -> Rights:
    """Rights of this process, whose limits are raised as far as possible; priority: wanted for the loop, 0: none."""
    may_hurry = _tried(partial(hurry, None, priority))  # limits do not tell what a sandbox forbids
    _raise_limit(resource.RLIMIT_MEMLOCK)
    memory, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    lines = Path("/proc/self/status").read_text().splitlines()
    capabilities = next((int(line.split()[1], 16) for line in lines if line.startswith("CapEff:")), 0)
    return Rights(may_hurry, memory == resource.RLIM_INFINITY or bool(capabilities & _CAP_IPC_LOCK), priority)


def lock_memory(granted: Rights) -> Rights:
    """Lock all pages that are touched from now on (`mlockall`); the rights that were granted."""
    if not granted.may_lock_memory:
        return granted
    failed = ctypes.CDLL(None).mlockall(_CURRENT | _FUTURE | _ON_FAULT)
    return replace(granted, may_lock_memory=not failed)


def touch(memory: object) -> None:
    """Write to every page of arrays, in tuples of any depth, so that none is fetched while the loop runs."""
    if isinstance(memory, np.ndarray):
        if memory.flags.writeable and memory.flags.c_contiguous:
            pages = memory.reshape(-1).view(np.uint8)[:: resource.getpagesize()]
            pages[:] = pages.copy()
    elif isinstance(memory, tuple):
        for part in memory:
            touch(part)


def hurry(processor: int | None, priority: int) -> bool:
    """Ask for a processor, exact wake-ups and real-time priority (1 to 99, 0: none); True if that was granted."""
    if processor is not None:
        with suppress(OSError):
            os.sched_setaffinity(0, {processor})
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if not priority:
        return False
    _raise_limit(resource.RLIMIT_RTPRIO)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return False
    return True


def _tried(what: Callable[[], _T]) -> _T:
    with ThreadPoolExecutor(1) as trial:
        return trial.submit(what).result()


def drop_priority() -> None:
    """Put the calling thread into the normal scheduler, whatever the process was started with."""
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _raise_limit(which: int) -> None:
    _, most = resource.getrlimit(which)
    with suppress(ValueError, OSError):
        resource.setrlimit(which, (most, most))


@dataclass(frozen=True)
class Processors:
    """CPUs of the loops. own: those that they have, in turn; refused: those that were asked for in vain."""

    own: tuple[int, ...] = ()
    refused: tuple[int, ...] = ()

    def of(self, loop: int) -> int | None:
        """CPUs at which loop number `loop` (0, 1, ...) is to stay, None: any."""
        return self.own[loop % len(self.own)] if self.own else None

    def as_text(self) -> str:
        """Describes them in a few words."""
        return f"the loop on CPU {_listed(self.own)}" if self.own else "no CPU of its own for the loop"

    @property
    def trouble(self) -> str:
        """Names the CPUs that were asked for and are not there; empty: none."""
        if not self.refused:
            return ""
        return f"CPU {_listed(self.refused)} of realtime.cpus cannot be used: not there, or kept from this process"


def processors(asked: Sequence[int] | None, loops: int) -> Processors:
    """CPUs for `loops` loops, of those asked for, or of those that are isolated if None. Each is tried."""
    isolated = numbers_in(_ISOLATED.read_text()) if _ISOLATED.exists() else ()
    wanted = tuple(dict.fromkeys(isolated if asked is None else asked))
    granted = _tried(lambda: tuple(filter(_may_stay_on, wanted)))
    refused = () if asked is None else tuple(cpu for cpu in wanted if cpu not in granted)
    return Processors(granted[:loops], refused)


def leave_to_loops(granted: Processors) -> None:
    """Keep the threads there are, and those they start, off the loops' processors, if they have others."""
    others = os.sched_getaffinity(0) - set(granted.own)
    if not granted.own or not others:
        return
    for task in Path("/proc/self/task").iterdir():
        with suppress(ProcessLookupError):  # it has ended
            os.sched_setaffinity(int(task.name), others)


def numbers_in(text: str) -> tuple[int, ...]:
    """Numbers in a list of CPUs as Linux writes it: `1,4-6`."""
    ranges = (range_.partition("-") for range_ in text.strip().split(",") if range_.strip())
    return tuple(n for first, _, last in ranges for n in range(int(first), int(last or first) + 1))


def _may_stay_on(processor: int) -> bool:
    try:
        os.sched_setaffinity(0, {processor})
    except OSError:
        return False
    return True


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, numbers))
