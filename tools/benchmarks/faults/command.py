"""`tools/bench faults`: its options."""

from pathlib import Path
from typing import Annotated

import typer

from tools.benchmarks.command_line import (
    PROCESSES,
    JsonOption,
    ModelOption,
    OutOption,
    SeedOption,
    Tier,
    TierOption,
    WorkersOption,
    app,
    chosen_names,
    resumable,
)
from tools.benchmarks.faults.live import run_live
from tools.benchmarks.faults.run import KINDS, Results, run_faults
from tools.benchmarks.faults.tables import faults_document, save_figure, shown
from tools.benchmarks.report import put_out
from tools.benchmarks.runs import Plan

SCENARIOS = 520


@app.command(
    epilog="Examples: tools/bench faults; tools/bench faults --only frozen_line,lag_line --figure faults.png"
)
def faults(
    scenarios: Annotated[int, typer.Option(min=1, help="How many, every kind in turn.")] = SCENARIOS,
    only: Annotated[str, typer.Option(help="Kinds of faults, by commas.")] = "",
    tier: TierOption = Tier.A,
    model: ModelOption = None,
    seed: SeedOption = 1,
    workers: WorkersOption = PROCESSES,
    out: OutOption = None,
    figure: Annotated[
        Path | None, typer.Option(help="PNG of times until found and until valid again.")
    ] = None,
    live: Annotated[
        int, typer.Option(min=0, help="So many on vcan0 instead: `tools/vcan tools/bench faults --live 16`.")
    ] = 0,
    as_json: JsonOption = False,
) -> None:
    """Sensors, bus, clocks and processes that fail at random times, up to three at once: is what is valid right?"""
    names = chosen_names(only, "--only", KINDS, KINDS)
    plan = Plan((), scenarios, seed, workers, out or Path("build") / f"faults-{tier}", peers=False)
    with resumable("what is scored is"):
        if live:
            results = Results(tuple(run_live(live, seed, plan.out / "live")), ())
        else:
            results = run_faults(names, plan, tier is Tier.B, model)
    if figure is not None and results.scores:
        save_figure(results, figure)
    put_out(as_json, faults_document(results), shown(results))
