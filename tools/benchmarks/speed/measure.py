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

from tools.benchmarks.command_line import JsonOption, chosen_names, finite, messages, print_lines, put_out
from tools.benchmarks.speed.core_alone import EvaluateTimes, measure_evaluate
from tools.benchmarks.speed.injectors import InjectorsRow, measure_injectors
from tools.benchmarks.speed.report import print_speed, save_histograms, speed_document
from tools.benchmarks.speed.roundtrip import RoundTrips, measure_roundtrips
from tools.benchmarks.speed.sample import SampleTimes, measure_sample
from tools.benchmarks.speed.scaling import Row, measure_scaling
from tools.benchmarks.speed.soak import run_soak, soak_table
from tools.benchmarks.speed.sustained import Startup, Sustained, measure_startup, measure_sustained
from tools.benchmarks.speed.traffic import make_traffic
from tools.benchmarks.speed.training import TrainingTimes, measure_training


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


@dataclass(frozen=True)
class Speed:
    """What was measured; None: was not. load: of the machine in the last minute, before and after."""

    load: tuple[float, float]
    sustained: Sustained | None = None
    roundtrips: RoundTrips | None = None
    sample: SampleTimes | None = None
    evaluate: EvaluateTimes | None = None
    training: TrainingTimes | None = None
    startup: Startup | None = None
    scaling: tuple[Row, ...] = ()
    injectors: tuple[InjectorsRow, ...] = ()


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


EXAMPLE = (
    "Examples: tools/bench speed --figures build/speed; tools/bench speed --quick --only sample,training"
)
SOAK_EXAMPLE = "Example: tools/bench soak --minutes 60"
SECONDS, QUICK_SECONDS = 600.0, 10.0
ROUNDTRIP_SECONDS, QUICK_ROUNDTRIP_SECONDS = 50.0, 5.0
INJECTORS_SECONDS, QUICK_INJECTORS_SECONDS = 60.0, 10.0
TABLE_WIDTH = 170  # where stdout is no terminal


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
    put_out(
        as_json,
        lambda: finite(speed_document(found)),
        lambda console: print_speed(found, console),
        TABLE_WIDTH,
    )


def soak(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 10.0,
    as_json: JsonOption = False,
) -> None:
    """A learning daemon at 100 kHz, its Python paused at random: what grows, what is lost? Exit code 1 for a loss."""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        found = run_soak(Path(folder), minutes)
    put_out(
        as_json,
        lambda: finite(found.document()),
        lambda console: console.print(soak_table(found)),
        TABLE_WIDTH,
    )
    if not as_json:
        print_lines(messages, [found.farewell])
    if found.lost or found.repeated:
        raise typer.Exit(1)
