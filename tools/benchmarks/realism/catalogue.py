"""All disturbances, what is run of them: alone, stated in the bench file, in pairs, those of the table; its cases."""

import itertools
import zlib
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tests.plants.parameters import Injector
from tests.plants.plant import Bench, drawn_needle
from tools.benchmarks.campaign import Task
from tools.benchmarks.cases import Case, on_real_line, worn_events
from tools.benchmarks.realism import benches, channels, sensors
from tools.benchmarks.realism.disturbance import Disturbance, Reasons, Stated

DISTURBANCES = {d.name: d for part in (sensors, channels, benches) for d in part.DISTURBANCES}
PAIRS = 40
WEARS = (0.25, 0.0, -0.3)  # v_H
AND, AT, STATED = " + ", " ", " stated"
NONE = "none"


class Selection(StrEnum):
    """What is run."""

    ALL = "all"
    TABLE = "table"
    PAIRS = "pairs"


@dataclass(frozen=True)
class Sized:
    """A disturbance of one size; stated: the bench file says so."""

    disturbance: Disturbance
    size: float
    is_stated: bool = False

    @property
    def name(self) -> str:
        """Of which `parsed` makes it again."""
        return f"{self.disturbance.name}{AT}{self.size:g}{STATED if self.is_stated else ''}"

    @property
    def stated(self) -> Stated:
        """Keys of the bench file."""
        if not self.is_stated or self.disturbance.stated is None:
            return {}
        return self.disturbance.stated(self.size)


Entry = tuple[Sized, ...]
"""What a recording is disturbed by: one, or a pair."""


def name_of(entry: Entry) -> str:
    """Of a line of the table; a command line may name it."""
    return AND.join(each.name for each in entry)


def parsed(name: str) -> Entry:
    """The entry of this name. Raises KeyError or ValueError for another."""
    found = []
    for part in name.split(AND):
        disturbance, _, size = part.removesuffix(STATED).partition(AT)
        found.append(Sized(DISTURBANCES[disturbance], float(size), part.endswith(STATED)))
    return tuple(found)


def true_reasons(entry: Entry) -> frozenset[str]:
    """Names of the reasons that are true of it."""
    return Reasons.ALWAYS.union(*(each.disturbance.true_reasons for each in entry))


def alone(table: bool = False) -> list[Entry]:
    """Every disturbance at every size, or those of the table; those a bench file may state, both ways."""
    return [
        (Sized(each, size, is_stated),)
        for each in DISTURBANCES.values()
        for size in each.sizes
        if not table or size == each.table
        for is_stated in ((False,) if each.stated is None else (False, True))
    ]


def pairs(master_seed: int) -> list[Entry]:
    """Pairs of different disturbances drawn by a master seed, one rhythm at the most; the smaller sizes of each."""
    rng = np.random.default_rng([master_seed, 0x9A12])
    disturbances = [d for d in DISTURBANCES.values() if d.name != NONE]
    known = [p for p in itertools.combinations(disturbances, 2) if not all(d.rhythm for d in p)]
    chosen = rng.choice(len(known), PAIRS, replace=False)
    return [
        tuple(Sized(d, d.sizes[int(rng.integers(min(2, len(d.sizes))))]) for d in known[i]) for i in chosen
    ]


def entries(selection: Selection, only: tuple[str, ...], master_seed: int) -> list[Entry]:
    """What a selection runs; only: of these disturbances, or entries."""
    found = [] if selection is Selection.PAIRS else alone(table=selection is Selection.TABLE)
    if selection is not Selection.TABLE:
        found += pairs(master_seed)
    is_chosen = (not only or name_of(e) in only or any(s.disturbance.name in only for s in e) for e in found)
    return list(itertools.compress(found, is_chosen))


def make_realism_case(task: Task, is_rich: bool = False) -> Case:
    """The case of a task, whose class is the name of an entry; is_rich: on the plant of tier B.

    What a bench file states changes nothing of the recording.
    """
    entry = parsed(task.class_name)
    name = name_of(tuple(replace(each, is_stated=False) for each in entry))
    rng = np.random.default_rng([task.master_seed, zlib.crc32(name.encode()), task.number])
    wear = WEARS[(zlib.crc32(name.encode()) + task.number) % len(WEARS)]
    seed = int(rng.integers(2**62))
    needle = drawn_needle(rng)
    bench = Bench(Injector(), needle, worn_events(rng, wear), seed=seed)
    if is_rich:
        bench = on_real_line(bench, task.master_seed)
    return Case(task.class_name, task.master_seed, task.number, disturbed(bench, entry, rng))


def disturbed(bench: Bench, entry: Entry, rng: np.random.Generator) -> Bench:
    """The bench with what disturbs it: rhythms first, for others look at when the needle opens."""
    for each in sorted(entry, key=lambda each: not each.disturbance.rhythm):
        bench = each.disturbance.apply(bench, each.size, rng)
    return bench
