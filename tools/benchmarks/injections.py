"""`tools/bench injections`: every injection of a history, corrected and live mass and rate against the truth."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MM3_PER_MS
from tests.observed_plants import bench_at, recording_of
from tests.plants.plant import record
from tests.plants.windows import true_masses, windows_of
from tools.benchmarks import command_line as cli
from tools.benchmarks import worn_lines
from tools.benchmarks.campaign import Bar, How, Row, conclude, run_cases, table, tally
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.histories import SETS
from tools.benchmarks.scoring import NO_REPORT, WRONG_MASS, injections_of

LEAST_RATE = 0.5  # share of an opening's largest rate from which on a sample's own error counts: not at the flanks


def magnitude(percentile: float) -> How:
    """Percentile of magnitudes."""
    return lambda values: float(np.percentile(np.abs(values.astype(float)), percentile))


BARS = {
    "first": (
        Bar("mass_error_median_pct", "error_pct", magnitude(50), most=0.3),
        Bar("mass_error_p95_pct", "error_pct", magnitude(95), most=1.2),
        Bar("mass_error_max_pct", "error_pct", magnitude(100), most=3.0),
        Bar("valid_share", "valid", "mean", least=0.9),
        Bar("inside_share", "inside", "mean", 0.93, 0.98),
        Bar("rate_rmse_median_mm3_per_ms", "rmse", "median", most=0.8),
        Bar("live_mass_error_median_pct", "live_error_pct", magnitude(50), most=1.0),
        Bar("live_mass_error_p95_pct", "live_error_pct", magnitude(95), most=3.0),
        Bar("live_rate_rmse_median_mm3_per_ms", "live_rmse", "median", most=1.5),
    ),
}
COLUMNS: dict[str, tuple[str, How]] = {
    "valid": ("valid", "of"),
    "mass error %, valid: median / p95 / max": ("error_pct", "spread"),
    "of all": ("all_error_pct", "spread"),
    "inside": ("inside", "of"),
    "of all ": ("all_inside", "of"),
    "1.96 sigma %": ("half_width_pct", "median"),
    "live %, of all": ("live_error_pct", "spread"),
    "RMSE mm3/ms": ("rmse", "median"),
    "live": ("live_rmse", "median"),
    "samples valid": ("samples", "sum"),
    "wrong": ("samples_wrong", "sum"),
    "refused": ("refused", tally),
}


def score_history(asked: str, name: str, seed: int, line: Discrepancy | None, model: Path | None) -> Row:
    """Record a history, on the nominal line or one with waves, and compare every injection with the truth."""
    history = next(each for each in SETS[asked](seed) if each.name == name)
    bench = history.bench if line is None else worn_lines.on_line(history.bench, line, seed)
    outcome = record(bench)
    evaluation = evaluate(bench_at(bench.sample_rate, model), [recording_of(outcome)]).evaluations[0]
    windows, trace, rate = windows_of(outcome, bench.sample_rate), evaluation.trace, outcome.truth.injection_rate
    masses, off = true_masses(outcome, bench), trace.injection_rate - rate
    corrected = getattr(trace, "corrected_rate", trace.injection_rate)
    row: Row = {"kind": history.kind, **{column: [] for column, _ in COLUMNS.values()}}
    for injection in injections_of(evaluation, windows):
        report, true = injection.report, sum(masses[i] for i in injection.openings)
        samples = np.unique(np.concatenate([np.r_[windows.ranges[i]] for i in injection.openings]))
        flowing = samples[trace.valid[samples] & (rate[samples] > LEAST_RATE * rate[samples].max())]
        facts: Row = {"valid": injection.valid, "samples": flowing.size}
        facts["samples_wrong"] = int(np.sum(np.abs(off[flowing]) > WRONG_MASS / 100.0 * rate[flowing]))
        facts["live_rmse"], facts["rmse"] = (
            float(np.sqrt(np.mean(np.nan_to_num(each - rate, nan=rate.max())[samples] ** 2))) / MM3_PER_MS
            for each in (trace.injection_rate, corrected)
        )
        if report is not None:
            facts["all_error_pct"] = 100.0 * (report.mass / true - 1.0)
            facts["live_error_pct"] = 100.0 * (getattr(report, "live_mass", report.mass) / true - 1.0)
            if report.mass_ci95 is not None:
                low, high = report.mass_ci95
                facts |= {"all_inside": bool(low <= true <= high), "half_width_pct": 50.0 * (high - low) / true}
        if injection.valid:
            facts |= {"error_pct": facts["all_error_pct"], "inside": facts.get("all_inside")}
        else:
            facts["refused"] = NO_REPORT if report is None else report.reason.name
        for column, value in facts.items():
            row[column].append(value)
    return row


@cli.app.command(
    epilog="Examples: tools/bench injections first; "
    "tools/bench injections first --kinds nozzle,lift --points '100 MPa' --tier B --lines plain"
)
def injections(
    asked: Annotated[str, typer.Argument(metavar="SET", help=f"Histories: {', '.join(SETS)}.")],
    kinds: Annotated[str, typer.Option(help="Parts of names of kinds, by commas (default: all).")] = "",
    points: Annotated[str, typer.Option(help="The same of operating points.")] = "",
    lines: Annotated[str, typer.Option(help="Tier B: lines, by commas, which take turns (default: all).")] = "",
    seed: cli.SeedOption = 1,
    jobs: cli.JobsOption = cli.JOBS,
    out: cli.OutOption = None,
    tier: cli.TierOption = cli.Tier.A,
    as_json: cli.JsonOption = False,
) -> None:
    """Every injection of histories that nothing has taught: corrected and live mass and rate against the truth.

    Nothing is learned before a history, and accuracies of 0 are stated. Corrected is the mass that is published; live
    the mass while it ran, as long as there is no other the same.
    """
    cli.chosen_names(asked, "SET", SETS, ())
    out = out or Path(f"build/injections-{asked}-{tier}")
    histories = [
        each for each in SETS[asked](seed) if _is_chosen(each.kind, kinds) and _is_chosen(each.point, points)
    ]
    if not histories:
        known = dict.fromkeys(f"{each.kind} ({each.point})" for each in SETS[asked](seed))
        raise UserError("--kinds, --points", "no history has both in its name", f"known: {', '.join(known)}")
    on: list[tuple[Discrepancy | None, Path | None]] = [(None, None)]
    if tier is cli.Tier.B:
        on = [
            (Discrepancy(name), worn_lines.worn_model(Discrepancy(name), seed, out))
            for name in cli.chosen_names(lines, "--lines", [*Discrepancy], [*Discrepancy])
        ]
    todo = {
        f"{asked} {line or ''} {history.name} {seed}": (asked, history.name, seed, line, model)
        for number, history in enumerate(histories)
        for line, model in [on[number % len(on)]]
    }
    frame = run_cases("injections", score_history, todo, jobs, out)
    conclude(frame, BARS[asked], {f"injections: {asked}": table(frame, "kind", COLUMNS)}, out, as_json)


def _is_chosen(name: str, parts: str) -> bool:
    return not parts or any(part.strip() in name for part in parts.split(","))
