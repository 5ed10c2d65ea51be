"""A scenario: one recording of an independent plant, and what goes wrong while it is sent, drawn by a seed."""

import zlib
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.random import Generator

from tests.plants.parameters import Injector
from tests.plants.plant import PERIOD, Bench, drawn_needle, event_start
from tools.benchmarks.campaign import Task
from tools.benchmarks.cases import on_real_line, worn_events

SETTLED, LAST_BEGIN = 4, 10  # events: what goes wrong begins after the one, before the other
SHORTEST, LONGEST = 0.5 * PERIOD, 5 * PERIOD  # s
WEARS = (-0.3, 0.0, 0.25)  # v_H
AND = " + "
MOST_AT_ONCE = 3
LEARNING_SHARE = 0.8
SEVERAL_SHARE = 0.3  # of the scenarios


class Group(StrEnum):
    """What goes wrong."""

    INPUT = "input"
    BUS = "bus"
    TIME = "time"
    PROCESS = "process"


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    true_reasons: names of reasons that are true of it; late: s after the next opening until it is found, as
    docs/validity.md states; shortest: s that it lasts at least.
    """

    name: str
    group: Group
    true_reasons: frozenset[str]
    late: float = 0.0
    shortest: float = 0.0


@dataclass(frozen=True)
class Placed:
    """A fault of a kind between two times [s] of the recording; seed: of all else about it."""

    kind: Kind
    begin: float
    end: float
    seed: int

    @property
    def chance(self) -> Generator:
        """The same every time."""
        return np.random.default_rng(self.seed)


@dataclass(frozen=True)
class Scenario:
    """What is recorded, and what goes wrong; blocks: every signal has a message of its own."""

    task: Task
    bench: Bench
    placed: tuple[Placed, ...]
    learning: bool
    blocks: bool


def drawn(task: Task, kinds: dict[str, Kind], is_rich: bool) -> Scenario:
    """The scenario of a task, whose class names its kinds. Raises KeyError for an unknown one."""
    rng = np.random.default_rng([task.master_seed, zlib.crc32(task.class_name.encode()), task.number])
    needle = drawn_needle(rng)
    learning = bool(rng.random() < LEARNING_SHARE)
    wear = WEARS[int(rng.integers(len(WEARS)))] if learning else 0.0  # which nobody would learn
    bench = Bench(Injector(), needle, worn_events(rng, wear), seed=int(rng.integers(2**62)))
    if is_rich:
        bench = on_real_line(bench, task.master_seed)
    placed = tuple(_placed(kinds[name], rng) for name in task.class_name.split(AND))
    return Scenario(task, bench, placed, learning, blocks=bool(rng.random() < 0.5))


def tasks(names: tuple[str, ...], count: int, master_seed: int) -> list[Task]:
    """So many scenarios: every kind in turn, some with others at once."""
    rng = np.random.default_rng([master_seed, 0xFA17])
    found = []
    for number in range(count):
        together = [names[number % len(names)]]
        if len(names) > 1 and rng.random() < SEVERAL_SHARE:
            others = [name for name in names if name != together[0]]
            more = int(rng.integers(1, MOST_AT_ONCE))
            together += [str(name) for name in rng.choice(others, min(more, len(others)), replace=False)]
        found.append(Task(AND.join(together), master_seed, number))
    return found


def _placed(kind: Kind, rng: Generator) -> Placed:
    begin = rng.uniform(event_start(SETTLED), event_start(LAST_BEGIN))
    lasts = max(rng.uniform(SHORTEST, LONGEST), kind.shortest)
    return Placed(kind, begin, begin + lasts, int(rng.integers(2**62)))
