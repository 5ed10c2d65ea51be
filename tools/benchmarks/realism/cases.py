"""A disturbed recording by the name of what disturbs it, a master seed and a number; a third of them healthy."""

import zlib
from dataclasses import replace

import numpy as np

from tools.benchmarks.cases import Case, drawn_events
from tools.benchmarks.plant import Bench, Needle
from tools.benchmarks.plant_parameters import Faults, Injector
from tools.benchmarks.realism.catalogue import Entry, name_of, parsed
from tools.benchmarks.runs import Task
from tools.benchmarks.wave_plant import LINES, Variant, real_part

WEARS = (0.25, 0.0, -0.3)  # v_H


def make_realism_case(task: Task, is_rich: bool = False) -> Case:
    """The case of a task, whose class is the name of an entry; is_rich: on the plant of tier B.

    What a bench file states changes nothing of the recording.
    """
    entry = parsed(task.class_name)
    name = name_of(tuple(replace(each, is_stated=False) for each in entry))
    rng = np.random.default_rng([task.master_seed, zlib.crc32(name.encode()), task.number])
    wear = WEARS[(zlib.crc32(name.encode()) + task.number) % len(WEARS)]
    seed = int(rng.integers(2**62))
    needle = Needle(0.80 * rng.uniform(0.85, 1.15), 0.90 * rng.uniform(0.85, 1.15))
    schedule = drawn_events(rng, varying=rng.random() < 0.5)
    events = tuple(replace(event, faults=Faults(orifice_area=wear)) for event in schedule)
    bench = Bench(Injector(), needle, events, seed=seed)
    if is_rich:
        bench = replace(bench, injector=real_part(task.master_seed), line=LINES[Variant.PLAIN])
    return Case(task.class_name, task.master_seed, task.number, disturbed(bench, entry, rng))


def disturbed(bench: Bench, entry: Entry, rng: np.random.Generator) -> Bench:
    """The bench with what disturbs it: rhythms first, for others look at when the needle opens."""
    for each in sorted(entry, key=lambda each: not each.disturbance.rhythm):
        bench = each.disturbance.apply(bench, each.size, rng)
    return bench
