"""`tools/bench faults`: scenarios worked through on a few processes, one table of what came of them, bars missed."""

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from matplotlib.figure import Figure

from tests.observed_plants import bench_at
from tests.plants.plant import record
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import MEASURING, PACKAGE, Found, Plan, Task
from tools.benchmarks.faults import live as on_bus
from tools.benchmarks.faults import player
from tools.benchmarks.faults.daemons import Kill, Strike, strike
from tools.benchmarks.faults.scenario import AND, AT, drawn, entries, tasks
from tools.benchmarks.faults.score import RECOVERY, FaultScore, Verdict, score
from tools.benchmarks.faults.table import TABLE
from tools.benchmarks.report import NOTHING, Shown, crash_lines, frame_table, put_out
from tools.benchmarks.scoring import warm_up, with_signals
from tools.benchmarks.wave_recordings import fitted_model

SCENARIOS = 520
FEWEST, VALID, RIGHT_SHARE = 500, 0.98, 0.85
SEVERAL = "several at once"
_BLOCKS = {
    "rail_pressure": {"message": "RailPressureBlock"},
    "needle_lift": {"message": "NeedleLiftBlock"},
    "line_pressure": {"message": "LinePressureBlock"},
}


def run_faults(names: list[str], plan: Plan, is_rich: bool, given: Path | None) -> Found[FaultScore]:
    """The plan's number of scenarios of these entries, those not yet scored by this state of the code."""
    model = fitted_model(plan, given)[0] if is_rich else None
    campaign, todo = plan.campaign, tasks(TABLE, names, plan.cases, plan.master_seed)
    kept = campaign.store("faults", FaultScore, PACKAGE, *MEASURING, *([model] if model else []))
    work, ready = partial(score_scenario, model), partial(warm_up, model)
    return campaign.found(todo, campaign.results("faults", kept, work, todo, ready))


def score_scenario(model: Path | None, task: Task) -> FaultScore:
    """Work of one process; model: the injector file, on tier B."""
    scenario = drawn(task, TABLE, is_rich=model is not None)
    outcome = record(scenario.bench)
    bench = bench_at(scenario.bench.sample_rate, model)
    if scenario.blocks:  # each signal has a message of its own
        bench = with_signals(bench, _BLOCKS)
    for placed in scenario.placed:
        bench = with_signals(bench, placed.stated)
    published = player.play(scenario, outcome.measured, bench)
    return score(scenario, outcome, published, scenario.bench.injector.density)


def frame_of(scores: tuple[FaultScore, ...]) -> pd.DataFrame:
    """A row a scenario, its facts as columns; `fault`: the row of the table."""
    frame = pd.DataFrame([asdict(each) for each in scores])
    frame["fault"] = [SEVERAL if AND in name else name.split(AT)[0] for name in frame["class_name"]]
    frame["recovered_in_time"] = (frame["recovered_after"] <= RECOVERY).where(frame["must_recover"])
    return frame.assign(
        crashed=frame["crash"] != "",
        found_ms=1e3 * frame["found_after"].astype(float),
        recovered_after=frame["recovered_after"].astype(float),
        is_named=frame["is_named"].astype(float),
        **{each.value: (frame["verdict"] == each).where(frame["verdict"].notna()) for each in Verdict},
    )


_FACTS: dict[str, tuple[str, str]] = {
    "scenarios": ("number", "size"),
    "crashes": ("crashed", "sum"),
    "wrong_valid_samples": ("wrong_samples", "sum"),
    "late_samples": ("late_samples", "sum"),
    "wrong_summaries": ("wrong_summaries", "sum"),
    "found_ms_median": ("found_ms", "median"),
    "found_ms_max": ("found_ms", "max"),
    "recovery_injections_max": ("recovered_after", "max"),
    "in_time_share": ("recovered_in_time", "mean"),
    "named_share": ("is_named", "mean"),
    "right_share": ("right", "mean"),
    "refused_share": ("refused", "mean"),
    "rough_share": ("rough", "mean"),
    "free": ("free", "sum"),
    "free_valid": ("free_valid", "sum"),
}
"""Columns of the table, and keys of the figures: what of the facts, and how it is summed up."""


def summary(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for every fault, and one for all."""
    whole = frame.assign(fault="all")
    found = pd.concat([each.groupby("fault", sort=False).agg(**_FACTS) for each in (frame, whole)])
    found["valid_share"] = found.pop("free_valid") / found.pop("free").replace(0, np.nan)
    return found.astype(float)


def missed_bars(total: pd.Series) -> Iterator[str]:
    """A line for every bar that the figures of all scenarios miss; a figure without a value misses none."""
    bars = {
        "scenarios": (FEWEST, np.inf),
        "crashes": (0, 0),
        "wrong_valid_samples": (0, 0),
        "wrong_summaries": (0, 0),
        "valid_share": (VALID, 1),
        "in_time_share": (1, 1),
        "named_share": (1, 1),
        "right_share": (RIGHT_SHARE, 1),
    }
    for name, (least, most) in bars.items():
        if total[name] < least or total[name] > most:
            yield f"missed: {name} is {total[name]:.3g}, {least:g} to {most:g} asked"


def is_faulty(each: FaultScore) -> bool:
    """Whether a scenario misses a bar by itself."""
    is_late = each.must_recover and (each.recovered_after or RECOVERY + 1) > RECOVERY
    return bool(each.wrong or each.crash or each.is_named is False or is_late)


def _told(each: FaultScore) -> str:
    wrong = f"{each.wrong_samples} samples and {each.wrong_summaries} injections valid and wrong"
    again = f"valid again after {each.recovered_after or NOTHING} events"
    return f"{each.label}: {wrong}, {again}; {', '.join(each.reasons)} {each.crash}"


def shown(found: Found[FaultScore]) -> Iterator[Shown]:
    """Every fault a line, the total, what is missed, and each scenario that was wrong."""
    if found.results:
        frame = frame_of(found.results)
        table = summary(frame)
        yield frame_table("Faults of sensors, bus, clocks and processes", table.dropna(axis=1, how="all"))
        yield from missed_bars(table.loc["all"])
        yield from (_told(each) for each in found.results if is_faulty(each))
    yield from crash_lines(found.crashes)


def faults_document(found: Found[FaultScore]) -> dict[str, Any]:
    """`figures` over all scenarios, `details` by fault and of each that was wrong."""
    if not found.results:
        return {"figures": None, "details": {"not_run": list(found.crashes)}}
    table = summary(frame_of(found.results))
    total = table.loc["all"]
    figures = total.to_dict() | {"valid_share_min": table.drop("all")["valid_share"].min()}
    return {
        "figures": figures,
        "details": {
            "faults": table.to_dict("index"),
            "wrong": [asdict(each) for each in found.results if is_faulty(each)],
            "violations": list(missed_bars(total)),
            "not_run": list(found.crashes),
        },
    }


def save_figure(found: Found[FaultScore], path: Path) -> None:
    """Time until a fault was found, and events until one was valid again, a line a fault, a dot a scenario."""
    frame = frame_of(found.results).query("fault != @SEVERAL")
    frame = frame[frame["verdict"].isna()]
    names = list(dict.fromkeys(frame["fault"]))
    row = frame["fault"].map(names.index)
    figure = Figure(figsize=(10, 0.24 * len(names) + 1.5), layout="constrained")
    soon, again = figure.subplots(1, 2, sharey=True)
    soon.plot(frame["found_ms"].clip(lower=0.01), row, ".", color="tab:blue", alpha=0.5)
    again.plot(frame["recovered_after"], row, ".", color="tab:green", alpha=0.5)
    soon.set(xscale="log", xlabel="first sample not valid, ms after the fault", yticks=range(len(names)))
    soon.set_yticklabels(names, fontsize=7)
    soon.invert_yaxis()
    again.axvline(RECOVERY + 0.5, color="tab:red", linewidth=0.8)
    again.set(xlabel="events after the fault until one is valid")
    figure.savefig(path, dpi=150)


def run_kills(count: int, seed: int, folder: Path) -> list[Kill]:
    """So many daemons struck, every way in turn, each in an emptied folder of its own."""
    shutil.rmtree(folder, ignore_errors=True)
    ways = list(Strike)
    return [
        strike(ways[number % len(ways)], folder / str(number), seed + number)
        for number in cli.tracked(range(count), "striking daemons")
    ]


def kills_shown(kills: Sequence[Kill]) -> Iterator[Shown]:
    """Every way a line, and what must not be."""
    facts = [{**asdict(each), "struck": each.strike, "problems": len(each.problems)} for each in kills]
    columns = {
        "kills": ("told", "size"),
        "told": ("told", "sum"),
        "records_lost": ("lost", "sum"),
        "problems": ("problems", "sum"),
    }
    yield frame_table("Daemons struck", pd.DataFrame(facts).groupby("struck", sort=False).agg(**columns))
    yield from (f"{each.strike}: {problem}" for each in kills for problem in each.problems)


@cli.app.command(
    epilog="Examples: tools/bench faults; tools/bench faults --only frozen_line,lag_line --figure faults.png; "
    "tools/vcan tools/bench faults --scenarios 0 --live 8 --daemons 6"
)
def faults(
    scenarios: Annotated[
        int, typer.Option(min=0, help="How many, every row of the table in turn.")
    ] = SCENARIOS,
    only: Annotated[str, typer.Option(help="Rows of the table, by commas.")] = "",
    tier: cli.TierOption = cli.Tier.A,
    model: cli.ModelOption = None,
    seed: cli.SeedOption = 1,
    workers: cli.WorkersOption = cli.PROCESSES,
    out: cli.OutOption = None,
    figure: Annotated[
        Path | None, typer.Option(help="PNG of times until found and until valid again.")
    ] = None,
    live: Annotated[
        int, typer.Option(min=0, help="So many with a daemon on vcan0, too, in `tools/vcan`.")
    ] = 0,
    daemons: Annotated[
        int, typer.Option(min=0, help="So many daemons killed, without room on the disk, without power.")
    ] = 0,
    as_json: cli.JsonOption = False,
) -> None:
    """Everything that may go wrong with sensors, bus, clocks and processes: is what is valid right?"""
    names = entries(TABLE, cli.chosen_names(only, "--only", TABLE, TABLE))
    plan = Plan((), scenarios, seed, workers, out or Path("build") / f"faults-{tier}", peers=False)
    with cli.resumable("what is scored is"):
        found = run_faults(names, plan, tier is cli.Tier.B, model) if scenarios else Found((), ())
        if live:
            results = (*found.results, *on_bus.run_live(live, seed, plan.out / "live"))
            found = Found(results, found.crashes)
        kills = run_kills(daemons, seed, plan.out / "daemons")
    if figure is not None and found.results:
        save_figure(found, figure)
    document = faults_document(found)
    if kills:
        struck = {"kills": len(kills), "records_lost": sum(each.lost for each in kills)}
        document["figures"] = {**(document["figures"] or {}), **struck}
        document["details"]["kills"] = [asdict(each) for each in kills]
    put_out(as_json, document, [*shown(found), *(kills_shown(kills) if kills else ())])
    if any(each.lost or each.problems for each in kills):
        raise typer.Exit(1)
