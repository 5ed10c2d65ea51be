"""`tools/bench accuracy`: run the cases, print what came out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from rich.console import Console

import observer_rt
from observer_rt.screen import progress_bar
from tools.benchmarks.bars import violations
from tools.benchmarks.cases import make_case
from tools.benchmarks.paper_peer import has_paper, score_paper
from tools.benchmarks.peers import PeerScore, has_peers, score_peers
from tools.benchmarks.pool import Crash, Task, run_tasks
from tools.benchmarks.score import CaseScore
from tools.benchmarks.scoring import score_case, warm_up
from tools.benchmarks.store import Store, digest_of
from tools.benchmarks.tables import class_table, peer_tables

BENCHMARKS = Path(__file__).parent
PACKAGE = Path(observer_rt.__file__).parent
Part = TypeVar("Part", CaseScore, PeerScore)


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


@dataclass(frozen=True)
class Results:
    """What came out."""

    scores: tuple[CaseScore, ...]
    crashes: tuple[Crash, ...]


def run_accuracy(plan: Plan, console: Console) -> Results:
    """Score the cases not yet scored by this state of the code; progress goes to `console`.

    The peers' results are kept apart: they stay good while only the package changes. The paper's scheme is the
    package's, so its are not.
    """
    crashes: list[Crash] = []
    store = Store(plan.out / "observer.jsonl", CaseScore, digest_of((PACKAGE, BENCHMARKS)))
    scores = _scored("observer", store, score_task, plan.tasks, plan, console, crashes)
    if plan.peers:
        peer_store = Store(plan.out / "peers.jsonl", PeerScore, digest_of((BENCHMARKS,)))
        tasks = tuple(task for task in plan.tasks if has_peers(task.class_name))
        peers = _scored("peers", peer_store, peers_task, tasks, plan, console, crashes)
        paper_store = Store(plan.out / "paper.jsonl", PeerScore, digest_of((PACKAGE, BENCHMARKS)))
        tasks = tuple(task for task in plan.tasks if has_paper(task.class_name))
        paper = _scored("paper", paper_store, paper_task, tasks, plan, console, crashes)
        scores = {task: _joined(s, (peers.get(task), paper.get(task))) for task, s in scores.items()}
    return Results(tuple(scores[task] for task in plan.tasks if task in scores), tuple(crashes))


def print_results(results: Results, console: Console) -> None:
    """The tables, then a line for every bar that is missed and every crash."""
    console.print(class_table(results.scores))
    if any(score.limits_mg for score in results.scores):
        for table in peer_tables(results.scores):
            console.print(table)
    for line in violations(results.scores):
        console.print(line, highlight=False, markup=False)
    for crash in results.crashes:
        console.print(f"crash: {crash.task}: {crash.message}", highlight=False, markup=False)


def score_task(task: Task) -> CaseScore:
    """Work of one process: our observer on a case."""
    return score_case(make_case(task.class_name, task.master_seed, task.number))


def peers_task(task: Task) -> PeerScore:
    """Work of one process: the peers on a case."""
    return score_peers(make_case(task.class_name, task.master_seed, task.number))


def paper_task(task: Task) -> PeerScore:
    """Work of one process: the paper's scheme on a case."""
    return score_paper(make_case(task.class_name, task.master_seed, task.number))


def _scored(
    what: str,
    store: Store[Part],
    work: Callable[[Task], Part],
    tasks: tuple[Task, ...],
    plan: Plan,
    console: Console,
    crashes: list[Crash],
) -> dict[Task, Part]:
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


def _joined(score: CaseScore, parts: Sequence[PeerScore | None]) -> CaseScore:
    for part in parts:
        if part is not None:
            limits = part.limits_mg or score.limits_mg
            score = replace(score, estimators=score.estimators + part.estimators, limits_mg=limits)
    return score


def _task_of(score: CaseScore | PeerScore) -> Task:
    return Task(score.class_name, score.master_seed, score.number)
