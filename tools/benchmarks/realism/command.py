"""The command `realism` of `tools/bench`."""

from pathlib import Path
from typing import Annotated

import typer

from observer_rt.foundation.errors import UserError
from tools.benchmarks.command_line import (
    PROCESSES,
    JsonOption,
    ModelOption,
    NoPeersOption,
    OutOption,
    SeedOption,
    Tier,
    TierOption,
    WorkersOption,
    messages,
    put_out,
    resumable,
)
from tools.benchmarks.realism.catalogue import DISTURBANCES, Selection, entries, name_of
from tools.benchmarks.realism.run import run_realism
from tools.benchmarks.realism.tables import print_realism, realism_document
from tools.benchmarks.runs import Plan

EXAMPLE = "Examples: tools/bench realism --set table; tools/bench realism --only hum_50_hz_line,frozen_line --cases 1"
CASES = 3  # each has another wear
TABLE_WIDTH = 200  # where stdout is no terminal


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
    tier: TierOption = Tier.A,
    model: ModelOption = None,
    seed: SeedOption = 1,
    workers: WorkersOption = PROCESSES,
    out: OutOption = None,
    no_peers: NoPeersOption = False,
    as_json: JsonOption = False,
) -> None:
    """Signals of a real bench: hum, drift, spikes, lag, ... on independent plants; right, or truly refused?"""
    chosen = tuple(name.strip() for name in only.split(",") if name.strip())
    found = entries(selection, chosen, seed)
    known = {*DISTURBANCES, *map(name_of, found)}
    for name in chosen:
        if name not in known:
            raise UserError("--only", f"unknown name '{name}'", f"known: {', '.join(DISTURBANCES)}")
    plan = Plan((), cases, seed, workers, out or Path("build") / f"realism-{tier}", not no_peers)
    with resumable("what is scored is"):
        results = run_realism(found, plan, tier is Tier.B, model, messages)
    put_out(
        as_json,
        lambda: realism_document(results),
        lambda console: print_realism(results, console),
        TABLE_WIDTH,
    )
