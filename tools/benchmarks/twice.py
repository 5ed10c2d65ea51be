"""`tools/bench twice`: masses of recordings looked at once, as live, and twice, on the independent plants."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.twice import SecondLook
from observer_rt.model.effects import effective_model
from tests.observed_plants import recording_of
from tests.plants.plant import record
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, How, Row, conclude, run_cases, table
from tools.benchmarks.cases import CLASSES, WAVE_CLASSES, Group, make_case, on_real_line
from tools.benchmarks.fitting import plain_model
from tools.benchmarks.scoring import bench_for_case, score_evaluation

CASES = 10  # a class
ONCE, TWICE = "once", "twice"
FIRST = 3  # events of a recording that are called the first
STEADY = tuple(name for name, kind in CLASSES.items() if kind.group is Group.MAIN and not kind.windowed)
BARS = (
    Bar("first_error_p95_pct", "first_error_pct", "p95", most=0.4, of="look == 'twice'"),
    Bar("first_coverage", "first_held", "mean", 0.92, 0.98, of="look == 'twice'"),
    Bar("coverage", "held", "mean", 0.92, 0.98, of="look == 'twice'"),
)
COLUMNS: dict[str, tuple[str, How]] = {
    "recordings": ("label", "count"),
    "first three: valid": ("first_valid", "mean"),
    "mass error %, valid: median / p95 / max": ("first_error_pct", "spread"),
    "covered": ("first_held", "mean"),
    "all: valid": ("valid", "mean"),
    "mass error %": ("error_pct", "spread"),
    "covered ": ("held", "mean"),
}


def score_look(look: str, class_name: str, seed: int, number: int, model: Path | None) -> Row:
    """Record a case, and evaluate it once or twice; masses and intervals are of valid events."""
    case = make_case(class_name, seed, number)
    if model is not None:
        case = replace(case, bench=on_real_line(case.bench, seed))
    outcome, bench = record(case.bench), bench_for_case(case, model)
    if look == ONCE:
        history = evaluate(bench, [recording_of(outcome)])
    else:
        second, c = SecondLook(), effective_model(bench.injector.parameters).coefficients
        history = evaluate(bench, [recording_of(outcome)], learner_of=second.learner, curves_of=c)
        second.revise(history.evaluations)
    score = score_evaluation(case, outcome, bench, history.evaluations[0])
    errors, row = np.abs(score.event_errors_pct()).tolist(), Row(class_name=class_name, look=look)
    for which, events in (("first_", range(FIRST)), ("", range(len(errors)))):
        valid = [event for event in events if score.valid[event]]
        row[f"{which}valid"] = [score.valid[event] for event in events]
        row[f"{which}error_pct"] = [errors[event] for event in valid]
        row[f"{which}held"] = [score.covered(event) for event in valid]
    return row


@cli.app.command(epilog="Examples: tools/bench twice; tools/bench twice --tier B --cases 5 --seed 7")
def twice(
    cases: cli.CasesOption = CASES,
    classes: Annotated[str, typer.Option(help="Classes, by commas (default: those with wear).")] = "",
    seed: cli.SeedOption = 1,
    jobs: cli.JobsOption = cli.JOBS,
    out: cli.OutOption = None,
    tier: cli.TierOption = cli.Tier.A,
    as_json: cli.JsonOption = False,
) -> None:
    """Masses of the first and of all injections, looked at once (as live) and twice (evaluate --twice)."""
    out, on_waves = out or Path(f"build/twice-{tier}"), tier is cli.Tier.B
    names = cli.chosen_names(classes, "--classes", CLASSES, WAVE_CLASSES if on_waves else STEADY)
    model = plain_model(out, seed) if on_waves else None
    todo = {
        f"{name} {seed} {number} {look}": (look, name, seed, number, model)
        for name in names
        for number in range(cases)
        for look in (ONCE, TWICE)
    }
    frame = run_cases("twice", score_look, todo, jobs, out)
    tables = {look: table(frame[frame["look"] == look], "class_name", COLUMNS) for look in (ONCE, TWICE)}
    conclude(frame, BARS, tables, out, as_json)
