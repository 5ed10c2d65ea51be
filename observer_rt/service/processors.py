"""Processors (CPUs) that the loops have to themselves: those the bench file names, else those Linux keeps apart."""

import os
import threading
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

_ISOLATED = Path("/sys/devices/system/cpu/isolated")


@dataclass(frozen=True)
class Processors:
    """What the loops get. own: theirs, in turn; refused: asked for in vain.

    are_isolated: Linux keeps everything else off them; are_shared: Python has no others.
    """

    own: tuple[int, ...] = ()
    refused: tuple[int, ...] = ()
    are_isolated: bool = False
    are_shared: bool = False

    def of(self, loop: int) -> int | None:
        """Where loop number `loop` (0, 1, ...) is to stay, None: anywhere."""
        return self.own[loop % len(self.own)] if self.own else None

    def as_text(self) -> str:
        """In a few words."""
        if not self.own:
            return "no CPU of its own for the loop"
        text = f"the loop on CPU {_listed(self.own)}"
        if self.are_shared:
            return f"{text}, with Python on it, too"
        return f"{text}, isolated" if self.are_isolated else f"{text}, Python beside it"

    @property
    def trouble(self) -> str:
        """What was asked for and is not there; empty if nothing."""
        if not self.refused:
            return ""
        return f"CPU {_listed(self.refused)} of realtime.cpus cannot be used: not there, or kept from this process"


REMEDY = "name others; `cat /sys/fs/cgroup/cpuset.cpus.effective` shows which there are"


def processors(asked: Sequence[int] | None, loops: int) -> Processors:
    """What `loops` loops can have of the CPUs asked for, of those that are isolated if None. Each is tried."""
    isolated = numbers_in(_ISOLATED.read_text()) if _ISOLATED.exists() else ()
    wanted = tuple(dict.fromkeys(isolated if asked is None else asked))
    granted: set[int] = set()
    trial = threading.Thread(target=lambda: granted.update(filter(_may_stay_on, wanted)))
    trial.start()
    trial.join()
    own = tuple(each for each in wanted if each in granted)[:loops]
    return Processors(
        own,
        () if asked is None else tuple(each for each in wanted if each not in granted),
        bool(own) and set(own) <= set(isolated),
        not os.sched_getaffinity(0) - set(own),
    )


def leave_to_loops(found: Processors) -> None:
    """Keep the threads there are, and those they start, off the loops' processors, if they have others."""
    if not found.own or found.are_shared:
        return
    others = os.sched_getaffinity(0) - set(found.own)
    for task in Path("/proc/self/task").iterdir():
        with suppress(ProcessLookupError):  # it has ended
            os.sched_setaffinity(int(task.name), others)


def numbers_in(text: str) -> tuple[int, ...]:
    """Of a list of CPUs as Linux writes it: `1,4-6`."""
    ranges = (each.partition("-") for each in text.strip().split(",") if each.strip())
    return tuple(n for first, _, last in ranges for n in range(int(first), int(last or first) + 1))


def _may_stay_on(processor: int) -> bool:
    try:
        os.sched_setaffinity(0, {processor})
    except OSError:
        return False
    return True


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, numbers))
