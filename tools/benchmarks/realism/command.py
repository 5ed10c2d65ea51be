"""The command `realism` of `tools/bench`."""

import json
import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.foundation.errors import UserError
from tools.benchmarks.realism.catalogue import DISTURBANCES, Selection, entries, name_of
from tools.benchmarks.realism.run import run_realism
from tools.benchmarks.realism.tables import print_realism, realism_document
from tools.benchmarks.runs import Plan
from tools.benchmarks.screen import screen
from tools.benchmarks.tier import Tier

EXAMPLE = "Examples: tools/bench realism --set table; tools/bench realism --only hum_50_hz_line,frozen_line --cases 1"
CASES = 3  # each has another wear
TABLE_WIDTH = 200  # where stdout is no terminal
INTERRUPTED = 130  # exit code
messages = Console(stderr=True)


def realism(
    cases: Annotated[
        int, typer.Option(min=1, help="Recordings of each size; three have three wears.")
    ] = CASES,
    only: Annotated[
        str, typer.Option(help="Disturbances, or lines of the table ('frozen_line 0.2'), by commas.")
    ] = "",
    selection: Annotated[
        Selection, typer.Option("--set", help="All; those of the table of sizes to be right; random pairs.")
    ] = Selection.ALL,
    tier: Annotated[
        Tier, typer.Option(help="A: a plant of the nominal structure. B: a richer one, to which `fit` fits.")
    ] = Tier.A,
    model: Annotated[
        Path | None, typer.Option(help="Tier B: injector file, instead of fitting one.", exists=True)
    ] = None,
    seed: Annotated[int, typer.Option(help="Master seed.")] = 1,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = os.cpu_count() or 1,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results (default: in build/); a run interrupted goes on."),
    ] = None,
    no_peers: Annotated[bool, typer.Option("--no-peers", help="Only our observer.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on stdout.")] = False,
) -> None:
    """Signals of a real bench: hum, drift, spikes, lag, ... on independent plants; right, or truly refused?"""
    chosen = tuple(name.strip() for name in only.split(",") if name.strip())
    found = entries(selection, chosen, seed)
    known = {*DISTURBANCES, *map(name_of, found)}
    for name in chosen:
        if name not in known:
            raise UserError("--only", f"unknown name '{name}'", f"known: {', '.join(DISTURBANCES)}")
    plan = Plan((), cases, seed, workers, out or Path("build") / f"realism-{tier}", not no_peers)
    try:
        results = run_realism(found, plan, tier is Tier.B, model, messages)
    except KeyboardInterrupt:
        messages.print("interrupted; what is scored is kept, the same command goes on")
        raise typer.Exit(INTERRUPTED) from None
    if as_json:
        print(json.dumps(realism_document(results), indent=2))
    else:
        print_realism(results, screen(TABLE_WIDTH))
