"""`tools/bench faults`: everything that may go wrong on a bench, at random times; are valid results right?"""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from observer_rt.desk.evaluation.evaluate import evaluate
from tests.benches import THREE_MESSAGES, with_signals
from tests.observed_plants import bench_at
from tests.plants.plant import record
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, How, Row, conclude, frame_of, run_cases, table
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.faults import live as on_bus
from tools.benchmarks.faults import player
from tools.benchmarks.faults.daemons import Strike, strike
from tools.benchmarks.faults.fault import BenchFault, SensorFault
from tools.benchmarks.faults.scenario import Task, drawn, entries, tasks
from tools.benchmarks.faults.score import Verdict, facts_of
from tools.benchmarks.faults.table import TABLE
from tools.benchmarks.needles import recorded
from tools.benchmarks.worn_lines import worn_model

CASES, RIGHT_WITHOUT_LIFT = 520, 0.8
BARS = (
    Bar("crashes", "crashed", "sum", most=0),
    Bar("wrong_valid_samples", "wrong_samples", "sum", most=0),
    Bar("late_samples", "late_samples", "sum"),
    Bar("wrong_summaries", "wrong_summaries", "sum", most=0),
    Bar("valid_share", "free_valid", "mean", least=0.98),
    Bar("in_time_share", "in_time", "mean", least=1.0),
    Bar("recovery_injections_max", "recovered_after", "max"),
    Bar("named_share", "is_named", "mean", least=1.0),
    Bar("right_share", "right", "mean", least=0.85),
    Bar("refused_share", "refused", "mean"),
    Bar("rough_share", "rough", "mean"),
    Bar("records_lost", "lost", "sum", most=0),
    Bar("problems", "problems", "sum", most=0),
)
COLUMNS: dict[str, tuple[str, How]] = {
    "scenarios": ("label", "count"),
    "crashes": ("crashed", "sum"),
    "samples wrong": ("wrong_samples", "sum"),
    "late": ("late_samples", "sum"),
    "summaries wrong": ("wrong_summaries", "sum"),
    "found, ms": ("found_ms", "median"),
    "found, max": ("found_ms", "max"),
    "events until valid, max": ("recovered_after", "max"),
    "in time": ("in_time", "of"),
    "named": ("is_named", "of"),
    **{str(verdict): (str(verdict), "of") for verdict in Verdict},
    "valid if nothing wrong": ("free_valid", "mean"),
}
OF_NEEDLE = ("lift", "needle", "energizing", "edges")  # in names of rows that have no sense without a lift
WITHOUT_LIFT = {
    name: row
    for name, row in TABLE.items()
    if row.lasting and isinstance(row, BenchFault | SensorFault) and not any(word in name for word in OF_NEEDLE)
}
STRUCK: dict[str, tuple[str, How]] = {name: (name, "sum") for name in ("said", "lost", "problems")}


def score_scenario(task: Task, model: Path | None = None, has_lift: bool = True) -> Row:
    """Score a scenario, played to the observer, or without a lift as a recording (a live rate is preliminary)."""
    scenario = drawn(task, TABLE, model is not None)
    bench = bench_at(scenario.bench.sample_rate, model)
    if scenario.blocks:  # each signal has a message of its own
        bench = with_signals(bench, {role: {"message": name} for role, name in THREE_MESSAGES.items()})
    for placed in scenario.placed:
        bench = with_signals(bench, placed.stated)
    if has_lift:
        outcome = record(scenario.bench)
        return facts_of(scenario, outcome, player.play(scenario, outcome.measured, bench))
    moved, outcome, recording, _ = recorded(scenario.bench, bench.injector.parameters.needle_law)
    published = player.corrected(evaluate(bench, [recording]).evaluations[0])
    return facts_of(replace(scenario, bench=moved), outcome, published)


def is_faulty(row: Row) -> bool:
    return bool(row["is_wrong"] or row["crash"] or row["is_named"] is False or row["in_time"] is False)


def line_of(row: Row) -> str:
    wrong = f"{row['wrong_samples']} samples and {row['wrong_summaries']} injections valid and wrong"
    again = f"valid again after {row['recovered_after'] or '-'} events"
    return f"{row['label']}: {wrong}, {again}; {', '.join(row['reasons'])} {row['crash']}"


@cli.app.command(
    epilog="Examples: tools/bench faults; tools/bench faults --only frozen_line,lag_line; "
    "tools/vcan tools/bench faults --cases 0 --live 8 --daemons 6"
)
def faults(
    cases: cli.CasesOption = CASES,
    only: Annotated[str, typer.Option(help="Rows of the table, by commas.")] = "",
    tier: cli.TierOption = cli.Tier.A,
    seed: cli.SeedOption = 1,
    jobs: cli.JobsOption = cli.JOBS,
    out: cli.OutOption = None,
    live: Annotated[int, typer.Option(min=0, help="So many with a daemon on vcan0, too, in `tools/vcan`.")] = 0,
    daemons: Annotated[int, typer.Option(min=0, help="So many daemons killed, without disk space or power.")] = 0,
    no_lift: cli.NoLiftOption = False,
) -> None:
    """Everything that may go wrong with sensors, bus, clocks and processes, every row of the table in turn."""
    out = out or Path(f"build/faults-{tier}{'-no-lift' * no_lift}")
    rows = WITHOUT_LIFT if no_lift else TABLE
    names = entries(TABLE, cli.chosen_names(only, "--only", rows, rows))
    model = worn_model(Discrepancy.PLAIN, seed, out) if tier is cli.Tier.B and cases else None
    todo = {f"{t.label}{' by commands' * no_lift}": (t, model, not no_lift) for t in tasks(TABLE, names, cases, seed)}
    frames = [run_cases("faults", score_scenario, todo, jobs, out)]
    if live:
        frames.append(frame_of(on_bus.run_live(live, seed, out / "live")))
    if daemons:
        shutil.rmtree(out / "daemons", ignore_errors=True)
        ways = list(Strike)
        struck = {
            f"daemon {n} {ways[n % len(ways)]}": (ways[n % len(ways)], out / "daemons" / str(n), seed + n)
            for n in range(daemons)
        }
        (out / "struck.jsonl").unlink(missing_ok=True)
        frames.append(run_cases("struck", strike, struck, 1, out))
    frame = pd.concat([each for each in frames if len(each)] or frames, ignore_index=True)
    frame["fault"] = frame.get("fault")
    scenarios, kills = frame[frame["fault"].notna()], frame[frame["fault"].isna() & frame["failed"].isna()]
    tables = {"faults of sensors, bus, clocks and processes": table(scenarios, "fault", COLUMNS)}
    if daemons:
        tables["daemons struck"] = table(kills, "struck", STRUCK)
    seen = scenarios.astype(object)
    lines = [line_of(row) for row in seen.where(seen.notna(), None).to_dict("records") if is_faulty(row)]
    lines += [f"{row.label}: {each}" for row in kills.itertuples() for each in row.what]
    bars = [replace(bar, least=RIGHT_WITHOUT_LIFT) if no_lift and bar.column == "right" else bar for bar in BARS]
    conclude(frame, bars, tables, out, lines)
