"""`tools/bench accuracy`: run the cases, print what came out."""

from dataclasses import dataclass, replace
from functools import partial

from rich.console import Console

from tools.benchmarks.bars import followed, slow_sample, violations
from tools.benchmarks.cases import make_case
from tools.benchmarks.command_line import print_lines
from tools.benchmarks.paper_peer import has_paper, score_paper
from tools.benchmarks.peers import PeerScore, has_peers, score_peers
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Crash, Plan, Task, on_case
from tools.benchmarks.sample_time import measure_sample_time
from tools.benchmarks.score import CaseScore, SampleTime
from tools.benchmarks.scoring import score_case, warm_up
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
    runs = plan.campaign(console)
    kept = runs.store("observer", CaseScore, PACKAGE, BENCHMARKS)
    scores = runs.results("observer", kept, partial(on_case, make_case, score_case), plan.tasks, warm_up)
    for name, sources, is_run, score in (
        ("peers", (BENCHMARKS,), has_peers, score_peers),
        ("paper", (PACKAGE, BENCHMARKS), has_paper, score_paper),
    ):
        if plan.peers:
            tasks = [task for task in plan.tasks if is_run(task.class_name)]
            kept_parts = runs.store(name, PeerScore, *sources)
            parts = runs.results(name, kept_parts, partial(on_case, make_case, score), tasks, warm_up)
            scores = joined(scores, parts)
    found, took = plan.in_order(scores), measure_sample_time()
    return Results(found, runs.crashes, took, (*violations(found), *slow_sample(took)))


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
    print_lines(console, results.missed)
    print_lines(console, [f"{crash.task}: {crash.message}" for crash in results.crashes], "crash: ")


def joined(scores: dict[str, CaseScore], parts: dict[str, PeerScore]) -> dict[str, CaseScore]:
    """Scores by label, with those of peers that ran."""
    return {
        label: with_peers(score, parts[label]) if label in parts else score for label, score in scores.items()
    }


def with_peers(score: CaseScore, part: PeerScore) -> CaseScore:
    """The score with those of peers."""
    limits = part.limits_mg or score.limits_mg
    return replace(score, estimators=score.estimators + part.estimators, limits_mg=limits)
