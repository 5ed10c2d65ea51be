"""Cases scored on a few processes, resumably."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from rich.console import Console

import observer_rt
from observer_rt.terminal.console import progress_bar
from tools.benchmarks.pool import Crash, Task, run_tasks
from tools.benchmarks.store import Store

BENCHMARKS = Path(__file__).parent
PACKAGE = Path(observer_rt.__file__).parent


Part = TypeVar("Part", bound=Task)


@dataclass(frozen=True)
class Plan:
    """What to run: cases 0..cases-1 of every class, on a few processes; results are kept in `out`."""

    classes: tuple[str, ...]
    cases: int
    master_seed: int
    workers: int
    out: Path
    peers: bool

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All cases, class by class."""
        return tuple(Task(c, self.master_seed, n) for c in self.classes for n in range(self.cases))


def scored(
    what: str,
    store: Store[Part],
    work: Callable[[Task], Part],
    warm_up: Callable[[], None],
    tasks: tuple[Task, ...],
    plan: Plan,
    console: Console,
    crashes: list[Crash[Task]],
) -> dict[Task, Part]:
    """Results of `tasks`, those not in the store worked out and added to it; progress goes to `console`."""
    wanted = set(tasks)
    scores = {task: s for s in store.load() if (task := _task_of(s)) in wanted}
    missing = [task for task in tasks if task not in scores]
    if scores and missing:
        console.print(f"{what}: {len(scores)} of {len(wanted)} cases are there already, in {plan.out}")
    if not missing:
        return scores
    with progress_bar(console, what, float(len(missing))) as progress:
        for number, result in enumerate(run_tasks(work, missing, plan.workers, warm_up)):
            if isinstance(result, Crash):
                crashes.append(result)
            else:
                store.add(result)
                scores[_task_of(result)] = result
            progress(float(number + 1))
    return scores


def _task_of(score: Task) -> Task:
    return Task(score.class_name, score.master_seed, score.number)
