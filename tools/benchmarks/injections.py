"""`tools/bench injections`: every injection of a history, corrected and live mass and rate against the truth."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MM3_PER_MS
from tests.observed_plants import bench_at, recording_of
from tests.plants.histories import SETS
from tests.plants.plant import record
from tests.plants.windows import true_masses, windows_of
from tools.benchmarks import command_line as cli
from tools.benchmarks import worn_lines
from tools.benchmarks.campaign import Bar, How, Row, conclude, run_cases, table, tally
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.scoring import NO_REPORT, WRONG_MASS, WRONG_RATE, injections_of

LEAST_RATE = 0.5  # share of an opening's largest rate from which on a sample's own error counts: not at the flanks
_LIMITS: dict[str, tuple[float, float, float]] = {  # largest error [%], share valid, share inside, of every set
    "first": (3.0, 0.9, 0.93),
    "laws": (3.0, 68 / 72, 0.93),
    "products": (3.0, 0.92, 0.93),
    "jumps": (2.0, 1.0, 0.93),
    "late": (3.0, 0.0, 0.0),
    "low": (3.0, 1.0, 0.93),
    "pilot": (3.0, 0.9, 0.93),
    "shots": (2.0, 0.0, 0.93),
}
_FIRST = (("error_pct", 50, 0.3), ("error_pct", 95, 1.2), ("live_error_pct", 50, 1.0), ("live_error_pct", 95, 3.0))
_FURTHER = {
    "first": (
        *(Bar(f"mass_{column}_p{p}", column, f"m{p}", most=most) for column, p, most in _FIRST),
        Bar("rate_rmse_median_mm3_per_ms", "rmse", "median", most=0.8),
        Bar("live_rate_rmse_median_mm3_per_ms", "live_rmse", "median", most=1.5),
    ),
    "low": (Bar("called_late", "refused", lambda reasons: float(sum(reasons == "LIFT_SENSOR_LAG")), most=0),),
    "shots": (Bar("sum_error_max_pct", "sum_error_pct", "m100", most=0.5),),
}
COLUMNS: dict[str, tuple[str, How]] = {
    "valid": ("valid", "of"),
    "mass error %, valid: median / p95 / max": ("error_pct", "spread"),
    "all": ("all_error_pct", "spread"),
    "inside": ("inside", "of"),
    "all ": ("all_inside", "of"),
    "1.96 sigma %": ("half_width_pct", "median"),
    "live %, all": ("live_error_pct", "spread"),
    "RMSE mm3/ms": ("rmse", "median"),
    "live": ("live_rmse", "median"),
    "samples valid": ("samples", "sum"),
    "wrong": ("samples_wrong", "sum"),
    "sums of events %": ("sum_error_pct", "spread"),
    "refused": ("refused", tally),
}


def score_history(asked: str, name: str, seed: int, line: Discrepancy | None, model: Path | None) -> Row:
    """Record a history, on the nominal line or one with waves, and compare every injection with the truth."""
    history = next(each for each in SETS[asked](seed) if each.name == name)
    bench = history.bench if line is None else worn_lines.on_line(history.bench, line, seed)
    outcome = record(bench)
    evaluation = evaluate(bench_at(bench.sample_rate, model), [recording_of(outcome)]).evaluations[0]
    windows, trace, rate = windows_of(outcome, bench.sample_rate), evaluation.trace, outcome.truth.injection_rate
    masses, published = true_masses(outcome, bench), trace.injection_rate
    rates = (published, trace.corrected_rate)
    live, corrected = (np.where(np.isnan(each), trace.nominal_rate, each) for each in rates)
    row: Row = {"kind": history.kind, "wrong": 0, **{column: [] for column, _ in COLUMNS.values()}}
    sums: dict[int, tuple[float, float]] = {}
    for injection in injections_of(evaluation, windows):
        if injection.event < history.count_from:
            continue
        report, true = injection.report, sum(masses[i] for i in injection.openings)
        window = np.unique(np.concatenate([np.r_[windows.ranges[i]] for i in injection.openings]))
        flowing = window[trace.valid[window] & (rate[window] > LEAST_RATE * rate[window].max())]
        facts: Row = {"valid": injection.valid, "samples": flowing.size}
        off = np.abs(published[flowing] / rate[flowing] - 1.0)
        facts["samples_wrong"] = int(np.sum(100.0 * off > WRONG_MASS))
        facts["live_rmse"], facts["rmse"] = (
            float(np.sqrt(np.mean((each - rate)[window] ** 2))) / MM3_PER_MS for each in (live, corrected)
        )
        if report is not None:
            facts["all_error_pct"] = 100.0 * (report.mass / true - 1.0)
            facts["live_error_pct"] = 100.0 * (report.live_mass / true - 1.0)
            if report.mass_ci95 is not None:
                low, high = report.mass_ci95
                facts |= {"all_inside": bool(low <= true <= high), "half_width_pct": 50.0 * (high - low) / true}
            estimated, injected = sums.get(injection.event, (0.0, 0.0))
            sums[injection.event] = (estimated + report.mass, injected + true)
        if injection.valid:
            facts |= {"error_pct": facts["all_error_pct"], "inside": facts.get("all_inside")}
            row["wrong"] += int(abs(facts["error_pct"]) > WRONG_MASS or facts["rmse"] > WRONG_RATE)
        else:
            facts["refused"] = NO_REPORT if report is None else report.reason.name
        for column, value in facts.items():
            row[column].append(value)
    return row | {"sum_error_pct": [100.0 * (estimated / true - 1.0) for estimated, true in sums.values()]}


@cli.app.command(
    epilog="Examples: tools/bench injections first; "
    "tools/bench injections first --kinds nozzle,lift --points '100 MPa' --tier B --lines plain"
)
def injections(
    asked: Annotated[str, typer.Argument(metavar="SET", help=f"{', '.join(SETS)}; low and pilot are of tier B.")],
    kinds: Annotated[str, typer.Option(help="Parts of names of kinds, by commas (default: all).")] = "",
    points: Annotated[str, typer.Option(help="The same of operating points.")] = "",
    lines: Annotated[str, typer.Option(help="Tier B: lines, by commas, which take turns (default: all).")] = "",
    seed: cli.SeedOption = 1,
    jobs: cli.JobsOption = cli.JOBS,
    out: cli.OutOption = None,
    tier: cli.TierOption = cli.Tier.A,
) -> None:
    """Every injection of histories that nothing has taught: corrected and live mass and rate against the truth.

    Nothing is learned before a history, and accuracies of 0 are stated. Corrected is the mass that is published; live
    the mass while it ran, as long as there is no other the same.
    """
    cli.chosen_names(asked, "SET", SETS, ())
    out = out or Path(f"build/injections-{asked}-{tier}")
    all_of_set = SETS[asked](seed)
    histories = [each for each in all_of_set if _is_chosen(each.kind, kinds) and _is_chosen(each.point, points)]
    if not histories:
        names = ", ".join(dict.fromkeys(each.name for each in all_of_set))
        raise UserError("--kinds, --points", "no history has both in its name", f"there are: {names}")
    chosen = cli.chosen_names(lines, "--lines", [*Discrepancy], [*Discrepancy]) if tier is cli.Tier.B else ()
    todo = {}
    for number, history in enumerate(histories):
        line = Discrepancy(chosen[number % len(chosen)]) if chosen else None
        model = worn_lines.worn_model(line, seed, out, history.fitted) if line else None
        todo[f"{asked} {line or ''} {history.name} {seed}"] = (asked, history.name, seed, line, model)
    frame = run_cases("injections", score_history, todo, jobs, out)
    most, valid, inside = _LIMITS.get(asked, (3.0, 0.0, 0.93))
    bars = (
        Bar("mass_error_max_pct", "error_pct", "m100", most=most),
        Bar("wrong_valid", "wrong", "sum", most=0),
        Bar("wrong_samples", "samples_wrong", "sum", most=0),
        Bar("inside_share", "inside", "mean", inside, 0.98),
        Bar("valid_share", "valid", "mean", least=valid, by="kind" if asked == "pilot" else ""),
        *_FURTHER.get(asked, ()),
    )
    conclude(frame, bars, {f"injections: {asked}": table(frame, "kind", COLUMNS)}, out)


def _is_chosen(name: str, parts: str) -> bool:
    return not parts or any(part.strip() in name for part in parts.split(","))
