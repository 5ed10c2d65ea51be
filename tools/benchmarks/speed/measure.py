"""The commands `speed` and `soak` of `tools/bench`; all measurements of `speed`, or those asked for."""

import os
import tempfile
from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from tools.benchmarks.command_line import JsonOption, app, chosen_names, messages
from tools.benchmarks.report import put_out
from tools.benchmarks.speed.core_alone import measure_evaluate
from tools.benchmarks.speed.injectors import measure_injectors
from tools.benchmarks.speed.report import Speed, save_histograms, shown, speed_document
from tools.benchmarks.speed.roundtrip import measure_roundtrips
from tools.benchmarks.speed.sample import measure_sample
from tools.benchmarks.speed.scaling import measure_scaling
from tools.benchmarks.speed.soak import run_soak, soak_table
from tools.benchmarks.speed.sustained import measure_startup, measure_sustained
from tools.benchmarks.speed.traffic import make_traffic
from tools.benchmarks.speed.training import measure_training

SECONDS, QUICK_SECONDS = 600.0, 10.0
ROUNDTRIP_SECONDS, QUICK_ROUNDTRIP_SECONDS = 50.0, 5.0
INJECTORS_SECONDS, QUICK_INJECTORS_SECONDS = 60.0, 10.0
TABLE_WIDTH = 170  # where stdout is no terminal


class Part(StrEnum):
    """What `--only` chooses from, in the order it is measured."""

    SUSTAINED = "sustained"
    ROUNDTRIP = "roundtrip"
    SAMPLE = "sample"
    EVALUATE = "evaluate"
    TRAINING = "training"
    STARTUP = "startup"
    SCALING = "scaling"
    INJECTORS = "injectors"


@dataclass(frozen=True)
class SpeedPlan:
    """What is measured. seconds: of the sustained rate; roundtrip_seconds: to each party.

    injectors_seconds: to each number of injectors; cold: start so, too.
    """

    parts: Collection[Part]
    seconds: float
    roundtrip_seconds: float
    injectors_seconds: float
    cold: bool


def measure_speed(plan: SpeedPlan, messages: Console) -> Speed:
    """Measure part after part. Raises UserError, RunError."""
    before = os.getloadavg()[0]

    def wanted(part: Part) -> bool:
        if part in plan.parts:
            messages.print(f"{part} ...", highlight=False)
        return part in plan.parts

    with tempfile.TemporaryDirectory(prefix="speed-") as name:
        folder = Path(name)
        traffic = make_traffic(folder)
        sustained = measure_sustained(folder, traffic, plan.seconds) if wanted(Part.SUSTAINED) else None
        roundtrips = measure_roundtrips(folder, plan.roundtrip_seconds) if wanted(Part.ROUNDTRIP) else None
        sample = measure_sample(folder) if wanted(Part.SAMPLE) else None
        evaluate = measure_evaluate(folder) if wanted(Part.EVALUATE) else None
        training = measure_training(traffic) if wanted(Part.TRAINING) else None
        startup = measure_startup(folder, cold=plan.cold) if wanted(Part.STARTUP) else None
        scaling = tuple(measure_scaling()) if wanted(Part.SCALING) else ()
        injectors = (
            measure_injectors(folder, traffic, plan.injectors_seconds) if wanted(Part.INJECTORS) else ()
        )
    load = before, os.getloadavg()[0]
    return Speed(load, sustained, roundtrips, sample, evaluate, training, startup, scaling, injectors)


@app.command(
    epilog="Examples: tools/bench speed --figures build/speed; tools/bench speed --quick --only sample,training"
)
def speed(
    only: Annotated[str, typer.Option(help=f"Of {', '.join(Part)}, by commas (default: all).")] = "",
    quick: Annotated[
        bool, typer.Option("--quick", help="10 s of each, and no cold start: a look, no verdict.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(min=1.0, help="Of the sustained rate (600).")] = None,
    figures: Annotated[Path | None, typer.Option(help="Folder for the histogram of latencies.")] = None,
    as_json: JsonOption = False,
) -> None:
    """How fast, each beside a named peer: round trip, rate, a sample, training, start, scaling."""
    plan = SpeedPlan(
        tuple(map(Part, chosen_names(only, "--only", list(Part), list(Part)))),
        seconds or (QUICK_SECONDS if quick else SECONDS),
        QUICK_ROUNDTRIP_SECONDS if quick else ROUNDTRIP_SECONDS,
        QUICK_INJECTORS_SECONDS if quick else INJECTORS_SECONDS,
        cold=not quick,
    )
    found = measure_speed(plan, messages)
    if figures is not None and (figure := save_histograms(found, figures)):
        messages.print(f"figure: {figure}", highlight=False)
    put_out(as_json, speed_document(found), shown(found), TABLE_WIDTH)


@app.command(epilog="Example: tools/bench soak --minutes 60")
def soak(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 10.0,
    as_json: JsonOption = False,
) -> None:
    """A learning daemon at 100 kHz, its Python paused at random: what grows, what is lost? Exit code 1 for a loss."""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        found = run_soak(Path(folder), minutes)
    put_out(as_json, found.document(), [soak_table(found), found.farewell], TABLE_WIDTH)
    if found.lost or found.repeated:
        raise typer.Exit(1)
