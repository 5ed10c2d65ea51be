"""`tools/bench injections`: every injection of a history, corrected and live mass and rate against the truth."""

import math
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from matplotlib.figure import Figure

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.figures import FOUND, GIVEN, MEASURED, save_figure
from observer_rt.foundation.units import MILLIGRAM, MM3_PER_MS
from tests.observed_plants import bench_at, recording_of
from tests.plants.histories import SETS
from tests.plants.plant import record
from tests.plants.windows import BINS, sample_facts, true_masses, windows_of
from tools.benchmarks import command_line as cli
from tools.benchmarks import worn_lines
from tools.benchmarks.campaign import Bar, How, Row, conclude, run_cases, table, tally
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.scoring import NO_REPORT, WRONG_MASS, WRONG_RATE, injections_of

LEAST_VALID = {"first": (0.6, 0.5), "drive": (0.9, 0.9)}  # share of settled samples in tiers A and B
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
_WRONG = Bar("wrong_samples", "valid_wrong", "sum", most=0)
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
    "samples valid": ("valid_wrong", "count"),
    "wrong": ("valid_wrong", "sum"),
    "sums of events %": ("sum_error_pct", "spread"),
    "refused": ("refused", tally),
}


def _median_and_p95(values: pd.Series) -> str:
    return " / ".join(f"{np.percentile(list(values), q):.3g}" for q in (50, 95))


LIVE_COLUMNS: dict[str, tuple[str, How]] = {
    "valid": ("settled_valid", "mean"),
    "wrong": ("valid_wrong", "of"),
    "mass error %, live: median / p95 / max": ("live_error_pct", "spread"),
    "open loop": ("open_loop_error_pct", "spread"),
    "fuel of a history %, live: max": ("live_fuel_pct", "m100"),
    "corrected": ("corrected_fuel_pct", "m100"),
}
LIVE_TABLES = {"samples, masses, fuel": LIVE_COLUMNS} | {
    f"error of the {name.replace('_', ' ')} rate %, median / p95": {
        f"{1e3 * low:g} to {1e3 * high:g} ms": (f"{name}_from_{1e6 * low:.0f}_us", _median_and_p95)
        for low, high in pairwise(BINS)
    }
    for name in ("live", "open_loop")
}


def score_history(asked: str, name: str, seed: int, line: Discrepancy | None, model: Path | None) -> Row:
    """Record a history, on the nominal line or one with waves, and compare every injection with the truth."""
    history = next(each for each in SETS[asked](seed) if each.name == name)
    bench = history.bench if line is None else worn_lines.on_line(history.bench, line, seed)
    outcome = record(bench)
    evaluation = evaluate(bench_at(bench.sample_rate, model), [recording_of(outcome)]).evaluations[0]
    windows, trace, rate = windows_of(outcome, bench.sample_rate), evaluation.trace, outcome.truth.injection_rate
    rates = (trace.injection_rate, trace.corrected_rate, trace.open_loop_rate)
    live, corrected, open_loop = (np.where(np.isnan(each), trace.nominal_rate, each) for each in rates)
    by_rate = {"live": live, "open_loop": open_loop}
    fuel = {name: windows.masses(each, bench.injector.density) for name, each in by_rate.items()}
    fuel["true"] = true_masses(outcome, bench)
    row: Row = defaultdict(list, {"set": asked, "kind": history.kind, "wrong": 0})
    sums: dict[int, tuple[float, float]] = {}
    for injection in injections_of(evaluation, windows):
        if injection.event < history.count_from:
            continue
        masses = {name: sum(each[i] for i in injection.openings) for name, each in fuel.items()}
        report, true = injection.report, masses["true"]
        window = np.unique(np.concatenate([np.r_[windows.ranges[i]] for i in injection.openings]))
        facts: Row = {"valid": injection.valid}
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
        masses["corrected"] = masses["live"] if report is None else report.mass
        facts |= {f"{name}_mg": mass / MILLIGRAM for name, mass in masses.items()}
        facts["open_loop_error_pct"] = 100.0 * (masses["open_loop"] / true - 1.0)
        for column, value in facts.items():
            row[column].append(value)
        for opened in (windows.opened[i] for i in injection.openings):
            since = np.arange(opened.stop - opened.start) * windows.interval
            parts = {name: each[opened] for name, each in by_rate.items()}
            for column, values in sample_facts(since, trace.valid[opened], rate[opened], parts).items():
                row[column] += values
    for name in ("live", "corrected"):
        row[f"{name}_fuel_pct"] = 100.0 * (sum(row[f"{name}_mg"]) / sum(row["true_mg"]) - 1.0)
    return row | {"sum_error_pct": [100.0 * (estimated / true - 1.0) for estimated, true in sums.values()]}


def draw_fuel(row: pd.Series) -> Figure:
    """Fuel of a history, summed up from injection to injection, and by how much that is off."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    true = np.cumsum(row["true_mg"])
    for name, colour in (("true", MEASURED), ("live", GIVEN), ("corrected", FOUND)):
        fuel = np.cumsum(row[f"{name}_mg"])
        above.plot(1e-3 * fuel, color=colour, label=name)
        below.plot(100.0 * (fuel / true - 1.0), color=colour)
    above.set(ylabel="fuel [g]", title=f"{row['set']}: {row['kind']}")
    below.set(xlabel="injection", ylabel="error [%]")
    above.legend()
    return figure


@cli.app.command(
    epilog="Examples: tools/bench injections first; "
    "tools/bench injections first --kinds nozzle,lift --points '100 MPa' --tier B --lines plain; "
    "tools/bench injections drive --live --kinds coking --plot fuel.png"
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
    live: Annotated[bool, typer.Option("--live", help="Of the rate as it is sent: samples, errors by time.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Picture of the first history's fuel.")] = None,
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
    if plot is not None:
        save_figure(draw_fuel(frame.iloc[0]), plot, dpi=110)
    most, valid, inside = _LIMITS.get(asked, (3.0, 0.0, 0.93))
    bars = (
        Bar("mass_error_max_pct", "error_pct", "m100", most=most),
        Bar("wrong_valid", "wrong", "sum", most=0),
        _WRONG,
        Bar("inside_share", "inside", "mean", inside, 0.98),
        Bar("valid_share", "valid", "mean", least=valid, by="kind" if asked == "pilot" else ""),
        *_FURTHER.get(asked, ()),
    )
    tables = {"injections": COLUMNS}
    if live:
        least = LEAST_VALID[asked][tier is cli.Tier.B] if asked in LEAST_VALID else -math.inf
        bars, tables = (_WRONG, Bar("valid_sample_share", "settled_valid", "mean", least)), LIVE_TABLES
    conclude(frame, bars, {f"{title}: {asked}": table(frame, "kind", each) for title, each in tables.items()}, out)


def _is_chosen(name: str, parts: str) -> bool:
    return not parts or any(part.strip() in name for part in parts.split(","))
