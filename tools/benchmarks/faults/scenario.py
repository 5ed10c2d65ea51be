"""A scenario: one recording of an independent plant, and what goes wrong with it, row by row or drawn by a seed."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from tests.plants.parameters import Injector
from tests.plants.plant import PERIOD, Bench, drawn_needle
from tools.benchmarks.cases import worn_events
from tools.benchmarks.discovery.discrepancies import Discrepancy, plant_of
from tools.benchmarks.faults.fault import Fault, PlacedFault, Where

SETTLED, LAST_BEGIN = 4, 10  # events: what goes and comes begins after the one, before the other
SHORTEST, LONGEST = 0.5 * PERIOD, 5 * PERIOD  # s
WEARS = (-0.3, 0.0, 0.25)  # v_H
AND, AT, STATED = " + ", " ", " stated"
MOST_AT_ONCE = 3
LEARNING_SHARE = 0.8
SEVERAL_SHARE = 0.3  # of the scenarios


@dataclass(frozen=True)
class Task:
    """A scenario, by what determines it; class_name: its entries."""

    class_name: str
    master_seed: int
    number: int

    @property
    def label(self) -> str:
        return f"{self.class_name} {self.master_seed} {self.number}"


@dataclass(frozen=True)
class Scenario:
    """A bench to record, and the faults that come; blocks: every signal has a message of its own."""

    task: Task
    bench: Bench
    placed: tuple[PlacedFault, ...]
    learning: bool
    blocks: bool

    @property
    def is_lasting(self) -> bool:
        return all(each.fault.lasting for each in self.placed)


def entries(table: Mapping[str, Fault], only: tuple[str, ...] = ()) -> list[str]:
    """Every row in every size, and once more where the bench file may state it; only: of these rows."""
    return [
        f"{name}{AT}{size:g}{stated}"
        for name, row in table.items()
        if not only or name in only
        for size in row.sizes
        for stated in (("", STATED) if row.stated else ("",))
    ]


def tasks(table: Mapping[str, Fault], names: list[str], count: int, master_seed: int) -> list[Task]:
    """So many scenarios: every entry in turn, some with others of the rhythm at hand at once."""
    rng = np.random.default_rng([master_seed, 0xFA17])
    more_of = [name for name in names if table[name.split(AT)[0]].where is not Where.RHYTHM]
    drawn_tasks = []
    for number in range(count):
        together = [names[number % len(names)]]
        if rng.random() < SEVERAL_SHARE:
            others = [name for name in more_of if name.split(AT)[0] != together[0].split(AT)[0]]
            more = int(rng.integers(1, MOST_AT_ONCE))
            together += [str(name) for name in rng.choice(others, min(more, len(others)), replace=False)]
        drawn_tasks.append(Task(AND.join(together), master_seed, number))
    return drawn_tasks


def drawn(task: Task, table: Mapping[str, Fault], is_rich: bool) -> Scenario:
    """The scenario of a task by its entries, whether stated or not. Raises KeyError for an unknown entry."""
    key = task.class_name.replace(STATED, "")
    rng = np.random.default_rng([task.master_seed, zlib.crc32(key.encode()), task.number])
    parsed = (_parsed(name, table) for name in task.class_name.split(AND))
    rows = sorted(parsed, key=lambda row: list(Where).index(row[0].where))
    needle, is_lasting = drawn_needle(rng), all(fault.lasting for fault, _, _ in rows)
    learning = bool(rng.random() < LEARNING_SHARE) or is_lasting
    wear = WEARS[int(rng.integers(len(WEARS)))] if learning else 0.0  # which nobody would learn
    bench = Bench(Injector(), needle, worn_events(rng, wear), seed=int(rng.integers(2**62)))
    if is_rich:
        plant = plant_of(Discrepancy.PLAIN, task.master_seed)
        bench = replace(bench, injector=plant.part, line=plant.line)
    placed: list[PlacedFault] = []
    for fault, size, is_stated in rows:
        placed.append(replace(_placed(fault, size, bench, rng), is_stated=is_stated))
        bench = placed[-1].on(bench)
    return Scenario(task, bench, tuple(placed), learning, blocks=bool(rng.random() < 0.5))


def _parsed(name: str, table: Mapping[str, Fault]) -> tuple[Fault, float, bool]:
    row, _, size = name.removesuffix(STATED).partition(AT)
    return table[row], float(size), name.endswith(STATED)


def _placed(fault: Fault, size: float, bench: Bench, rng: Generator) -> PlacedFault:
    seed = int(rng.integers(2**62))
    if fault.lasting:
        return PlacedFault(fault, size, 0.0, np.inf, seed)
    begin = rng.uniform(bench.starts[SETTLED], bench.starts[LAST_BEGIN])
    return PlacedFault(fault, size, begin, begin + max(rng.uniform(SHORTEST, LONGEST), fault.shortest), seed)
