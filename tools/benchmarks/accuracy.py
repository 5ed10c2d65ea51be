"""`tools/bench accuracy`: run the cases, print what came out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rich.console import Console

from tools.benchmarks.bars import followed, slow_sample, violations
from tools.benchmarks.cases import make_case
from tools.benchmarks.paper_peer import has_paper, score_paper
from tools.benchmarks.peers import PeerScore, has_peers, score_peers
from tools.benchmarks.pool import Crash, Task
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Plan, scored
from tools.benchmarks.sample_time import measure_sample_time
from tools.benchmarks.score import CaseScore, SampleTime
from tools.benchmarks.scoring import score_case, warm_up
from tools.benchmarks.store import Store, digest_of
from tools.benchmarks.tables import class_table, following_table, has_peer, peer_tables


@dataclass(frozen=True)
class Results:
    """What came out; missed: a line for every bar that is missed."""

    scores: tuple[CaseScore, ...]
    crashes: tuple[Crash[Task], ...]
    sample_time: SampleTime
    missed: tuple[str, ...]


def run_accuracy(plan: Plan, console: Console) -> Results:
    """Score the cases not yet scored by this state of the code; progress goes to `console`.

    The peers' results are kept apart: they stay good while only the package changes. The paper's scheme is the
    package's, so its are not.
    """
    crashes: list[Crash[Task]] = []
    store = Store(plan.out / "observer.jsonl", CaseScore, digest_of((PACKAGE, BENCHMARKS)))
    scores = scored("observer", store, score_task, warm_up, plan.tasks, plan, console, crashes)
    if plan.peers:
        peer_store = Store(plan.out / "peers.jsonl", PeerScore, digest_of((BENCHMARKS,)))
        tasks = tuple(task for task in plan.tasks if has_peers(task.class_name))
        peers = scored("peers", peer_store, peers_task, warm_up, tasks, plan, console, crashes)
        paper_store = Store(plan.out / "paper.jsonl", PeerScore, digest_of((PACKAGE, BENCHMARKS)))
        tasks = tuple(task for task in plan.tasks if has_paper(task.class_name))
        paper = scored("paper", paper_store, paper_task, warm_up, tasks, plan, console, crashes)
        scores = {task: joined(s, (peers.get(task), paper.get(task))) for task, s in scores.items()}
    found = tuple(scores[task] for task in plan.tasks if task in scores)
    took = measure_sample_time()
    return Results(found, tuple(crashes), took, (*violations(found), *slow_sample(took)))


def print_results(results: Results, console: Console) -> None:
    """The tables, then a line for every bar that is missed and every crash."""
    console.print(class_table(results.scores))
    if any(has_peer(score) for score in results.scores):
        for table in peer_tables(results.scores):
            console.print(table)
    if any(followed(s) is not None for s in results.scores):
        console.print(following_table(results.scores))
    took = results.sample_time
    console.print(
        f"one sample of the observer at 100 kHz, us: needle open {took.open_us:.2f}, shut {took.closed_us:.2f}",
        highlight=False,
    )
    for line in results.missed:
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


def joined(score: CaseScore, parts: Sequence[PeerScore | None]) -> CaseScore:
    """The score with those of peers that ran."""
    for part in parts:
        if part is not None:
            limits = part.limits_mg or score.limits_mg
            score = replace(score, estimators=score.estimators + part.estimators, limits_mg=limits)
    return score
