"""The command `discovery` of `tools/bench`."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.foundation.errors import UserError
from tools.benchmarks.chosen import chosen_names
from tools.benchmarks.discovery.figures import save_figures
from tools.benchmarks.discovery.generator import HidingPlan
from tools.benchmarks.discovery.hidden import HIDDEN
from tools.benchmarks.discovery.real_line import tables as real_tables
from tools.benchmarks.discovery.real_line.cases import names_of, shared_out
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.discovery.real_line.generator import RealPlan
from tools.benchmarks.discovery.real_line.record_only import record_only
from tools.benchmarks.discovery.real_line.run import Asking, run_real_lines
from tools.benchmarks.discovery.real_line.run import print_results as print_real_lines
from tools.benchmarks.discovery.run import Plan, print_results, run_discovery
from tools.benchmarks.discovery.tables import json_document
from tools.benchmarks.screen import screen
from tools.benchmarks.tier import Tier

EXAMPLE = (
    "Examples: tools/bench discovery --cases 40 --effects lift_offset,seat_area --rate without; "
    "tools/bench discovery --tier B --cases 20 --discrepancy taper"
)
CASES, REAL_CASES = 300, 150
RATES = {"without": (False,), "with": (True,), "both": (False, True)}
TABLE_WIDTH = 210  # where stdout is no terminal
INTERRUPTED = 130  # exit code
messages = Console(stderr=True)


def discovery(
    cases: Annotated[
        int | None,
        typer.Option(
            min=0,
            help=f"Faulty cases, and as many healthy ones ({CASES}); tier B: of all kinds ({REAL_CASES}).",
        ),
    ] = None,
    effects: Annotated[
        str, typer.Option(help="Hidden effects, by commas (default: all); tier B: also a+b, healthy.")
    ] = "",
    rate: Annotated[str, typer.Option(help="Measured rate: without, with or both.")] = "both",
    tier: Annotated[
        Tier, typer.Option(help="A: plants of the nominal structure. B: others, to which `fit` fits first.")
    ] = Tier.A,
    healthy: Annotated[
        int | None, typer.Option(min=0, help="Tier B: healthy cases, beside the others (default: a fifth).")
    ] = None,
    discrepancy: Annotated[
        list[Discrepancy] | None, typer.Option(help="Tier B: of the plants; repeatable (default: all).")
    ] = None,
    only_record: Annotated[
        bool, typer.Option("--record-only", help="Tier B: only record and fit, into --out; nothing is asked.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Master seed.")] = 1,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = os.cpu_count() or 1,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results (default: in build/); a run interrupted goes on."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on stdout.")] = False,
) -> None:
    """Whether `discover` names effects hidden in recordings of independent plants."""
    if rate not in RATES:
        raise UserError("--rate", f"is '{rate}'", f"give {', '.join(RATES)}")
    try:
        if tier is Tier.B:
            plan = _real_plan(cases, healthy, effects, RATES[rate], discrepancy, seed)
            asking = Asking(plan, workers, out or Path("build/discovery-B"))
            if only_record:
                record_only(plan, asking.out, messages)
            else:
                _on_real_lines(asking, as_json)
            return
        chosen = chosen_names(effects, "--effects", HIDDEN, HIDDEN)
        count = CASES if cases is None else cases
        hiding = HidingPlan(chosen, count, count, RATES[rate], seed)
        _on_nominal_lines(Plan(hiding, workers, out or Path("build/discovery")), as_json)
    except KeyboardInterrupt:
        messages.print("interrupted; the answers are kept, the same command goes on")
        raise typer.Exit(INTERRUPTED) from None


def _on_nominal_lines(plan: Plan, as_json: bool) -> None:
    found = run_discovery(plan, messages)
    for figure in save_figures(found.results, plan.out):
        messages.print(f"figure: {figure}", highlight=False)
    if as_json:
        print(json.dumps(json_document(found.results, found.crashes), indent=2))
    else:
        print_results(found, screen(TABLE_WIDTH))


def _on_real_lines(asking: Asking, as_json: bool) -> None:
    found = run_real_lines(asking, messages)
    if as_json:
        print(json.dumps(real_tables.json_document(found.results, found.adequate, found.crashes), indent=2))
    else:
        print_real_lines(found, screen(TABLE_WIDTH))


def _real_plan(
    cases: int | None,
    healthy: int | None,
    effects: str,
    rates: tuple[bool, ...],
    discrepancies: list[Discrepancy] | None,
    seed: int,
) -> RealPlan:
    names = tuple(name for name in effects.split(",") if name)
    for name in names:
        try:
            names_of(name)
        except KeyError as error:
            raise UserError("--effects", f"unknown name {error}", "give one, one+other or healthy") from None
    numbers = shared_out(REAL_CASES if cases is None else cases)
    if healthy is not None:
        numbers = replace(numbers, healthy=healthy)
    return RealPlan(numbers, rates, tuple(map(str, discrepancies or Discrepancy)), seed, names)
