"""`tools/bench accuracy`: run the cases, print what came out."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

import observer_rt
from observer_rt.screen import progress_bar
from tools.benchmarks.bars import violations
from tools.benchmarks.cases import make_case
from tools.benchmarks.pool import Crash, Task, run_tasks
from tools.benchmarks.score import CaseScore
from tools.benchmarks.scoring import score_case, warm_up
from tools.benchmarks.store import Store, digest_of
from tools.benchmarks.tables import class_table

SOURCES = (Path(observer_rt.__file__).parent, Path(__file__).parent)


@dataclass(frozen=True)
class Plan:
    """What to run: cases 0..cases-1 of every class, on a few processes; results are kept in `out`."""

    classes: tuple[str, ...]
    cases: int
    master_seed: int
    workers: int
    out: Path

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All cases, class by class."""
        return tuple(Task(c, self.master_seed, n) for c in self.classes for n in range(self.cases))


@dataclass(frozen=True)
class Results:
    """What came out."""

    scores: tuple[CaseScore, ...]
    crashes: tuple[Crash, ...]


def run_accuracy(plan: Plan, console: Console) -> Results:
    """Score the cases not yet scored by this state of the code; progress goes to `console`."""
    store = Store(plan.out / "observer.jsonl", CaseScore, digest_of(SOURCES))
    wanted = set(plan.tasks)
    scores = {task: s for s in store.load() if (task := _task_of(s)) in wanted}
    missing = [task for task in plan.tasks if task not in scores]
    crashes = []
    if scores and missing:
        console.print(f"{len(scores)} of {len(wanted)} cases are there already, in {plan.out}")
    if missing:
        with progress_bar(console, "accuracy", float(len(missing))) as progress:
            for number, result in enumerate(run_tasks(score_task, missing, plan.workers, warm_up)):
                if isinstance(result, Crash):
                    crashes.append(result)
                else:
                    store.add(result)
                    scores[_task_of(result)] = result
                progress(float(number + 1))
    return Results(tuple(scores[task] for task in plan.tasks if task in scores), tuple(crashes))


def print_results(results: Results, console: Console) -> None:
    """The table, then a line for every bar that is missed and every crash."""
    console.print(class_table(results.scores))
    for line in violations(results.scores):
        console.print(line, highlight=False, markup=False)
    for crash in results.crashes:
        console.print(f"crash: {crash.task}: {crash.message}", highlight=False, markup=False)


def score_task(task: Task) -> CaseScore:
    """Work of one process."""
    return score_case(make_case(task.class_name, task.master_seed, task.number))


def _task_of(score: CaseScore) -> Task:
    return Task(score.class_name, score.master_seed, score.number)
