"""The commands `speed` and `soak` of `tools/bench`."""

import json
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.foundation.errors import UserError
from tools.benchmarks.screen import screen
from tools.benchmarks.speed.document import finite
from tools.benchmarks.speed.histogram import save_histograms
from tools.benchmarks.speed.measure import Part, SpeedPlan, measure_speed
from tools.benchmarks.speed.report import print_speed, speed_document
from tools.benchmarks.speed.soak import run_soak, soak_table

EXAMPLE = (
    "Examples: tools/bench speed --figures build/speed; tools/bench speed --quick --only sample,training"
)
SOAK_EXAMPLE = "Example: tools/bench soak --minutes 60"
SECONDS, QUICK_SECONDS = 600.0, 10.0
ROUNDTRIP_SECONDS, QUICK_ROUNDTRIP_SECONDS = 50.0, 5.0
INJECTORS_SECONDS, QUICK_INJECTORS_SECONDS = 60.0, 10.0
TABLE_WIDTH = 170  # where stdout is no terminal
messages = Console(stderr=True)


def speed(
    only: Annotated[str, typer.Option(help=f"Of {', '.join(Part)}, by commas (default: all).")] = "",
    quick: Annotated[
        bool, typer.Option("--quick", help="10 s of each, and no cold start: a look, no verdict.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(min=1.0, help="Of the sustained rate (600).")] = None,
    figures: Annotated[Path | None, typer.Option(help="Folder for the histogram of latencies.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on stdout.")] = False,
) -> None:
    """How fast, each beside a named peer: round trip, rate, a sample, training, start, scaling."""
    plan = SpeedPlan(
        _parts(only),
        seconds or (QUICK_SECONDS if quick else SECONDS),
        QUICK_ROUNDTRIP_SECONDS if quick else ROUNDTRIP_SECONDS,
        QUICK_INJECTORS_SECONDS if quick else INJECTORS_SECONDS,
        cold=not quick,
    )
    found = measure_speed(plan, messages)
    if figures is not None and (figure := save_histograms(found, figures)):
        messages.print(f"figure: {figure}", highlight=False)
    if as_json:
        print(json.dumps(finite(speed_document(found)), indent=2))
    else:
        print_speed(found, screen(TABLE_WIDTH))


def soak(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 10.0,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on stdout.")] = False,
) -> None:
    """A learning daemon at 100 kHz, its Python paused at random: what grows, what is lost? Exit code 1 for a loss."""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        found = run_soak(Path(folder), minutes)
    if as_json:
        print(json.dumps(finite(found.document()), indent=2))
    else:
        screen(TABLE_WIDTH).print(soak_table(found))
        messages.print(found.farewell, highlight=False, markup=False)
    if found.lost or found.repeated:
        raise typer.Exit(1)


def _parts(text: str) -> tuple[Part, ...]:
    names = [name.strip() for name in text.split(",") if name.strip()] or list(Part)
    for name in names:
        if name not in list(Part):
            raise UserError("--only", f"unknown name '{name}'", f"known: {', '.join(Part)}")
    return tuple(map(Part, names))
