"""`tools/bench twice`: masses of recordings looked at once, as live, and twice, on the independent plants."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.twice import SecondLook
from observer_rt.model.effects import effective_model
from tests.observed_plants import recording_of
from tests.plants.plant import Outcome, record
from tests.plants.wave import Variant
from tools.benchmarks import command_line as cli
from tools.benchmarks.accuracy import make_wave_case
from tools.benchmarks.campaign import MEASURING, PACKAGE, Plan, Task, on_case
from tools.benchmarks.cases import CLASSES, WAVE_CLASSES, Case, Group, make_case
from tools.benchmarks.report import Columns, crash_lines, put_out, table_of
from tools.benchmarks.scoring import bench_for_case, score_evaluation, warm_up
from tools.benchmarks.wave_recordings import fitted_model

CASES = 10  # a class
FIRST = 3  # events of a recording that are called the first
STEADY = tuple(name for name, kind in CLASSES.items() if kind.group is Group.MAIN and not kind.windowed)


@dataclass(frozen=True)
class TwiceScore(Task):
    """A case looked at once and twice: errors [%] and halves of 95 % intervals [%] of masses, validity, by event."""

    once: tuple[tuple[float, float | None, bool], ...]
    twice: tuple[tuple[float, float | None, bool], ...]


def score_twice(case: Case, model: Path | None = None) -> TwiceScore:
    """Record a case, and evaluate it once and twice."""
    outcome, bench = record(case.bench), bench_for_case(case, model)
    once, twice = (_errors(case, outcome, bench, look) for look in (None, SecondLook()))
    return TwiceScore(case.class_name, case.master_seed, case.number, once, twice)


def _errors(
    case: Case, outcome: Outcome, bench: Bench, look: SecondLook | None
) -> tuple[tuple[float, float | None, bool], ...]:
    if look is None:
        history = evaluate(bench, [recording_of(outcome)])
    else:
        c = effective_model(bench.injector.parameters).coefficients
        history = evaluate(bench, [recording_of(outcome)], learner_of=look.learner, curves_of=c)
        look.revise(history.evaluations)
    score = score_evaluation(case, outcome, bench, history.evaluations[0], ())
    halves = [
        None if bounds is None else 50.0 * (bounds[1] - bounds[0]) / true
        for bounds, true in zip(score.mass_ci95_mg, score.true_mass_mg, strict=True)
    ]
    return tuple(zip(score.event_errors_pct().tolist(), halves, score.valid, strict=True))


def figures_of(looks: Sequence[tuple[tuple[float, float | None, bool], ...]]) -> dict[str, Any]:
    """Figures of cases looked at in one way."""
    valid = [[event for event in events if event[2]] for events in looks]
    first = [event for events in looks for event in events[:FIRST] if event[2]]
    every = [event for events in valid for event in events]

    def spread(events: Sequence[tuple[float, float | None, bool]]) -> dict[str, Any]:
        errors = np.abs([event[0] for event in events])
        covered = [abs(error) <= half for error, half, _ in events if half is not None]
        if not events:
            return {"median": np.nan, "p95": np.nan, "max": np.nan, "coverage": np.nan}
        return {
            "median": float(np.median(errors)),
            "p95": float(np.percentile(errors, 95)),
            "max": float(errors.max()),
            "coverage": float(np.mean(covered)) if covered else np.nan,
        }

    return {
        "cases": len(looks),
        "first_valid_share": len(first) / max(1, sum(len(events[:FIRST]) for events in looks)),
        "valid_share": len(every) / max(1, sum(map(len, looks))),
        "first": spread(first),
        "all": spread(every),
    }


_SPREAD = "{{[{name}][median]:.3f}} / {{[{name}][p95]:.3f}} / {{[{name}][max]:.3f}}"
COLUMNS: Columns[dict[str, Any]] = {
    "cases": "{[cases]}",
    "valid %\nfirst three": "{[first_valid_share]!p:.1f}",
    "\nall": "{[valid_share]!p:.1f}",
    "mass error % where valid\nfirst three: median / p95 / max": _SPREAD.format(name="first"),
    "\nall: median / p95 / max": _SPREAD.format(name="all"),
    "coverage %, first": "{[first][coverage]!p:.1f}",
    "of all": "{[all][coverage]!p:.1f}",
}


def document_of(scores: Sequence[TwiceScore]) -> dict[str, dict[str, Any]]:
    """Figures by class and look, those of all classes last."""
    result = {}
    for name in [*dict.fromkeys(score.class_name for score in scores), ""]:
        those = [score for score in scores if name in ("", score.class_name)]
        for look in ("once", "twice"):
            result[f"{name or 'all'}, {look}"] = figures_of([getattr(score, look) for score in those])
    return result


@cli.app.command(epilog="Examples: tools/bench twice; tools/bench twice --tier B --cases 5 --seed 7")
def twice(
    cases: Annotated[int, typer.Option(min=1, help="Cases per class.")] = CASES,
    classes: Annotated[str, typer.Option(help="Classes, by commas (default: those with wear).")] = "",
    seed: cli.SeedOption = 1,
    workers: cli.WorkersOption = cli.PROCESSES,
    out: cli.OutOption = None,
    tier: cli.TierOption = cli.Tier.A,
    model: cli.ModelOption = None,
    as_json: cli.JsonOption = False,
) -> None:
    """Masses of the first and of all injections, looked at once (as live) and twice (evaluate --twice)."""
    on_waves = tier is cli.Tier.B
    default = WAVE_CLASSES if on_waves else STEADY
    chosen = cli.chosen_names(classes, "--classes", CLASSES, default)
    plan = Plan(chosen, cases, seed, workers, out or Path("build") / f"twice-{tier}", False)
    make = make_case
    with cli.resumable("what is scored is"):
        if on_waves:
            make = partial(make_wave_case, Variant.PLAIN)
            model, _ = fitted_model(plan, model, Variant.PLAIN, False)
        runs = plan.campaign
        kept = runs.store("twice", TwiceScore, PACKAGE, *MEASURING, *([model] if model else []))
        work = partial(on_case, make, partial(score_twice, model=model))
        found = runs.found(plan.tasks, runs.results("twice", kept, work, plan.tasks, partial(warm_up, model)))
        document = document_of(found.results)
        put_out(as_json, document, _shown(document, found.crashes))


def _shown(document: dict[str, dict[str, Any]], crashes: Sequence[str]) -> Iterator[Any]:
    yield table_of("masses once and twice", "class", document, COLUMNS)
    yield from crash_lines(crashes)
